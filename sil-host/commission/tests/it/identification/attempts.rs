//! Slides that end early are repeated with a larger force, or refused with their reason.

use painleve_commission::identification::{
    IdentificationError, Slid, SlideRig, SlideTick, Surprise, identify_arm, slide_scenario,
};
use painleve_commission::simulated::{SimulatedError, SimulatedSlides, imperfect};
use painleve_firmware::law::LawSettings;
use painleve_identify::Refusal;
use painleve_plant::scenario::Scenario;
use painleve_shared::Posture;
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::SensorFrame;

use super::campaigns::{LOOPS, loops};
use super::{drawn, identified};

/// Simulated arms with the elbow up take more than 1.2 N·m.
#[test]
fn a_torque_limit_that_is_too_low_is_named_before_all_that_follows_from_it() {
    for (limit_nm, seed) in [(0.4, 3), (0.5, 1), (0.6, 2), (0.7, 1), (0.8, 3), (0.9, 2)] {
        let limit = format!("controller.torque_limit_nm={limit_nm}");
        let scenario = Scenario::default()
            .with_overrides("weak", &[limit])
            .unwrap();
        let (found, _) = identified(&scenario, seed, None);
        let refusal = found.map(|_| ()).unwrap_err();
        let expected =
            format!("a torque was at its limit (controller.torque_limit_nm = {limit_nm})");
        assert!(refusal.contains(&expected), "{limit_nm}, {seed}: {refusal}");
    }
}

/// Coarse encoders shake this arm of 7 kg and throw its tip, and its torques reach their limits until the slide ends.
#[test]
fn torques_of_a_tip_that_is_thrown_are_no_limit_that_is_too_low() {
    let heavy = [
        "arm.link_length_m=[0.6,0.5]",
        "arm.height_m=0.95",
        "arm.link_mass_kg=[4,3]",
        "arm.stiffness_nm_rad=[0,0]",
        "converters.torque.range_nm=60",
        "converters.force.range_n=100",
        "controller.torque_limit_nm=40",
        "initial={ tip_m=0.0, elbow='down' }",
    ];
    let scenario = Scenario::default()
        .with_overrides("heavy", &heavy.map(String::from))
        .unwrap();
    for seed in [6, 7, 10] {
        let (found, _) = identified(&scenario, seed, None);
        let refusal = found.map(|_| ()).unwrap_err();
        assert!(refusal.contains("18 N or more"), "{seed}: {refusal}");
        assert!(refusal.contains("converters.encoder.bits"), "{refusal}");
    }
}

/// Zeros that are wrong by almost 3° lift a tip that presses with 4 N only.
#[test]
#[ignore = "a long identification"]
fn a_tip_that_is_lifted_presses_more_at_the_next_attempt() {
    let study = loops(7_005_000, 211);
    let scenario = study.scenario(study.cells()[0], 210).unwrap();
    let (found, rig) = identified(&scenario, 7_005_070, None);
    assert_eq!(found.map(|_| ()), Ok(()));
    assert!(rig.largest_force_n < 10.0, "{}", rig.largest_force_n);
}

/// A tip that did not press yet when the drive takes it over would bounce, and then press with 11 N.
#[test]
fn a_tip_rests_on_its_belt_before_it_slides() {
    let study = loops(7_016_000, 450);
    let scenario = study.scenario(study.cells()[0], LOOPS * 59).unwrap();
    let actual = imperfect(&scenario, 7_016_059).unwrap();
    let mut rig = SimulatedSlides::new(actual, None);
    for (index, posture) in [Posture::ElbowDown, Posture::ElbowUp]
        .into_iter()
        .enumerate()
    {
        let slide = slide_scenario(&scenario, 0.2, posture, 4.0).unwrap();
        assert!(rig.slide(index, &slide, posture).unwrap().is_complete);
    }
    assert!(rig.largest_force_n < 7.0, "{}", rig.largest_force_n);
}

/// A rig that ends some of its attempts.
struct Breaking {
    rig: SimulatedSlides,
    break_off: fn(usize, &mut Slid),
    /// Normal force of each attempt, N.
    forces_n: Vec<f32>,
    /// Forces of the attempts that were announced as repeated.
    repeated_n: Vec<f32>,
}

impl SlideRig for Breaking {
    type Error = SimulatedError;

    fn slide(
        &mut self,
        index: usize,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Slid, SimulatedError> {
        let mut slid = self.rig.slide(index, scenario, posture)?;
        if let Some(LawSettings::Hybrid(law)) = scenario.controller.law.of_set() {
            self.forces_n.push(law.normal_force_n);
        }
        (self.break_off)(self.forces_n.len(), &mut slid);
        Ok(slid)
    }

    fn repeats(&mut self, _: &Refusal, force_n: f64) {
        self.repeated_n.push(force_n as f32);
    }
}

/// Returns why the arm of a rig is refused; `None` if it is identified.
fn refusal_by<R: SlideRig>(rig: &mut R, scenario: &Scenario) -> Option<Refusal> {
    match identify_arm(rig, scenario, &drawn()) {
        Ok(_) => None,
        Err(IdentificationError::Refused(refusal)) => Some(refusal),
        Err(other) => panic!("{other}"),
    }
}

/// Returns why the arm of such a rig is refused, and the normal force of each attempt, N.
fn broken_off(break_off: fn(usize, &mut Slid)) -> (Option<Refusal>, Vec<f32>) {
    let scenario = Scenario::default();
    let actual = imperfect(&scenario, 51_000).unwrap();
    let mut rig = Breaking {
        rig: SimulatedSlides::new(actual, None),
        break_off,
        forces_n: Vec::new(),
        repeated_n: Vec::new(),
    };
    let refusal = refusal_by(&mut rig, &scenario);
    let harder = rig.forces_n.iter().filter(|force_n| **force_n > 4.0);
    assert!(harder.eq(&rig.repeated_n), "{:?}", rig.repeated_n);
    (refusal, rig.forces_n)
}

/// As after a fault, with the tip on the belt until then.
fn end_early(slid: &mut Slid) {
    slid.ticks.truncate(1200);
    slid.is_complete = false;
}

#[test]
fn a_slide_that_ends_early_is_repeated_and_refused_if_none_is_whole() {
    let (refusal, forces_n) = broken_off(|attempt, slid| {
        if attempt == 1 {
            end_early(slid);
        }
    });
    assert_eq!(refusal, None);
    assert_eq!(forces_n, [4.0, 5.0, 4.0, 4.0, 4.0]);
    let (refusal, forces_n) = broken_off(|_, slid| end_early(slid));
    let Some(Refusal::NotOnBelt { percent, .. }) = refusal else {
        panic!("{refusal:?}");
    };
    assert!(percent < 20.0, "{percent}");
    assert_eq!(forces_n, [4.0, 5.0, 6.0, 4.0, 5.0, 6.0]);
}

/// The tip leaves its belt while the elbow turns at 3 rad/s.
fn throw(slid: &mut Slid) {
    end_early(slid);
    let thrown = turning(3.0, ForceCounts(0), 0..40);
    let lasts = slid.ticks.iter_mut().rev().take(40).rev();
    for (tick, thrown) in lasts.zip(thrown.ticks) {
        let [_, EncoderCounts(elbow)] = &mut tick.sensor.joints;
        *elbow = elbow.wrapping_add(thrown.sensor.joints[1].0) & 0x3fff;
        tick.sensor.normal_force = thrown.sensor.normal_force;
    }
}

#[test]
fn a_tip_that_is_thrown_presses_more_at_the_next_attempt() {
    let (refusal, forces_n) = broken_off(|attempt, slid| {
        if attempt <= 2 {
            throw(slid);
        }
    });
    assert_eq!(refusal, None);
    assert_eq!(forces_n, [4.0, 5.0, 6.0, 4.0, 4.0, 4.0]);
    let (refusal, forces_n) = broken_off(|_, slid| throw(slid));
    let is_fast = matches!(refusal, Some(Refusal::MovedTooFast { slide: 0, .. }));
    assert!(is_fast, "{refusal:?}");
    assert_eq!(forces_n, [4.0, 5.0, 6.0]);
}

/// Changes an arm, and returns why it is refused.
fn refusal_of(change: impl Fn(&mut Scenario)) -> Refusal {
    let scenario = Scenario::default();
    let mut actual = imperfect(&scenario, 51_000).unwrap();
    change(&mut actual);
    let mut rig = SimulatedSlides::new(actual, None);
    refusal_by(&mut rig, &scenario).unwrap()
}

/// The elbow's spring is six times as stiff as the drawing says; then somebody pushes the tip along the belt.
#[test]
fn a_tip_that_presses_too_hard_or_moves_too_fast_ends_the_slide_at_once() {
    let pressed = refusal_of(|actual| actual.arm.stiffness_nm_rad[1] *= 6.0);
    assert!(
        matches!(pressed, Refusal::PressedTooHard { slide: 0, .. }),
        "{pressed}"
    );
    let moved = refusal_of(|actual| {
        actual.effects.push.impulse_ns = [0.5, 0.0];
        actual.effects.push.duration_s = 0.05;
    });
    assert!(
        matches!(moved, Refusal::MovedTooFast { slide: 0, .. }),
        "{moved}"
    );
}

/// A force cell or a stage that is dead, and a spring that nobody told of: the values that the torques show would be wrong.
#[test]
fn torques_that_the_model_does_not_explain_are_refused() {
    let faults = [
        "tangential_force={ kind = 'off', from_s = 0.0, until_s = 1000.0 }",
        "torque_2={ kind = 'off', from_s = 3.0, until_s = 1000.0 }",
    ];
    let dead = faults.map(|fault| {
        refusal_of(|actual| {
            let fault = format!("converters.faults.{fault}");
            *actual = actual.clone().with_overrides("dead", &[fault]).unwrap();
        })
    });
    let untold = refusal_of(|actual| actual.arm.stiffness_nm_rad[0] = 0.8);
    for refusal in dead.into_iter().chain([untold]) {
        assert!(matches!(refusal, Refusal::OtherTorques { .. }), "{refusal}");
    }
}

/// Ticks of an arm whose elbow turns at a rate, with a normal force.
fn turning(rate_rad_s: f64, force: ForceCounts, ticks: impl Iterator<Item = u32>) -> Slid {
    let scale = Scenario::default().converters.scales().encoders[1];
    let tick = |tick: u32| SlideTick {
        sensor: SensorFrame {
            tick,
            joints: [
                EncoderCounts(0),
                scale.reading(rate_rad_s * f64::from(tick) * 1e-3),
            ],
            normal_force: force,
            ..SensorFrame::default()
        },
        ..SlideTick::default()
    };
    Slid {
        ticks: ticks.map(tick).collect(),
        is_complete: false,
    }
}

#[test]
fn a_surprise_lasts_and_is_seen_whatever_ticks_arrive() {
    let scenario = Scenario::default();
    let force = scenario.converters.scales().force;
    let [soft, hard] = [4.0, 18.0].map(|force_n| ForceCounts(force.counts(force_n).0));
    let of = |slid: Slid| slid.surprise(&scenario);
    let is_hard = |slid: Slid| matches!(of(slid), Some(Surprise::PressesTooHard { .. }));
    let is_fast = |slid: Slid| matches!(of(slid), Some(Surprise::MovesTooFast { .. }));
    // A link of 0.2 m or so; the serial line may carry one tick of four.
    for every in [1, 4] {
        let ticks = |count| (0..count).step_by(every);
        assert!(is_hard(turning(0.0, hard, ticks(20))));
        assert!(is_fast(turning(3.0, soft, ticks(40))));
        assert_eq!(of(turning(1.0, soft, ticks(40))), None);
        assert_eq!(of(turning(3.0, hard, ticks(8))), None);
    }
    assert_eq!(of(Slid::default()), None);
    // Two impacts, with the line silent between them.
    assert_eq!(of(turning(0.0, hard, [0, 200].into_iter())), None);
    // What is missing presses on nothing.
    assert_eq!(of(turning(0.0, ForceCounts::MISSING, 0..40)), None);
    // A reading that is wrong seems to throw the tip there and back, and a landing presses for some ticks.
    for wrong in 0..40 {
        let mut slid = turning(1.0, soft, 0..40);
        let sensor = &mut slid.ticks[wrong].sensor;
        sensor.joints[1] = EncoderCounts(sensor.joints[1].0 ^ 0x400);
        sensor.normal_force = hard;
        assert_eq!(of(slid), None, "{wrong}");
    }
}
