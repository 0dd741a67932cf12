//! Tests of the whole plant against closed forms and conservation laws.

use painleve_shared::{Arm, ArmParameters, JointTorque, LinkMotion, Pose, Posture, Slip};

use crate::plant::{ContactMode, Event, Plant, State};
use crate::statistics::Statistics;

use super::belt::BeltProfile;
use super::impact::{ImpactLaw, Restitution};
use super::motion::{Evaluation, Motion, theta, theta_dot};
use super::torque::TorqueSegment;
use super::transition::{Continuation, Indeterminate, decide, goes_on};
use super::{ArmOnBelt, ArmProbe, ArmStep, PlantParameters, SolverSettings};

/// The paper's initial conditions, degrees at rest.
fn at_rest(theta1_deg: f64, theta2_deg: f64) -> State {
    State::new(theta1_deg.to_radians(), theta2_deg.to_radians(), 0.0, 0.0)
}

fn x0_a() -> State {
    at_rest(32.0, 18.27)
}

fn x0_d() -> State {
    at_rest(-11.4, -35.1)
}

fn plant(parameters: &PlantParameters, initial: State) -> ArmOnBelt {
    ArmOnBelt::new(parameters, initial).unwrap()
}

/// Largest error of the contact constraint during a run.
#[derive(Default)]
struct ConstraintDrift {
    gap_m: f64,
    modes: Vec<ContactMode>,
}

impl ArmProbe for ConstraintDrift {
    fn step(&mut self, step: &ArmStep<'_>) {
        if step.mode.is_contact() {
            self.gap_m = self.gap_m.max(step.motion.gap_m(step.end).abs());
        }
        if self.modes.last() != Some(&step.mode) {
            self.modes.push(step.mode);
        }
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

fn conservative() -> PlantParameters {
    PlantParameters {
        arm: ArmParameters {
            damping_nms_rad: [0.0; 2],
            ..Default::default()
        },
        friction: 0.0,
        impact: ImpactLaw {
            law: Restitution::Poisson,
            restitution: 1.0,
        },
        ..Default::default()
    }
}

#[test]
fn x0_a_is_thrown_off_immediately() {
    let mut statistics = Statistics::new(0.05);
    let mut plant = plant(&PlantParameters::default(), x0_a());
    let terms = plant.motion().terms(0.0, plant.state());
    assert!((terms.p_per_kg(0.6, painleve_shared::Slip::Positive) + 1.62).abs() < 0.01);
    assert!((terms.b_m_s2() + 2.09).abs() < 0.01);
    plant.settle(&mut statistics).unwrap();
    assert_eq!(statistics.impacts_without_collision, 1);
    assert_eq!(statistics.first_lift_off_s, Some(0.0));
    let speed = plant.motion().relative_velocity_m_s(0.0, plant.state()).y;
    assert!((speed - 0.0105).abs() < 5e-5, "thrown at {speed} m/s");
}

/// The rest position solves Jᵀ f = w with f_t = −μ f_n: z_t = −0.175689 m, f_n = 0.441238 N (root
/// found with an independent program).
#[test]
fn x0_d_slides_to_the_quiet_attractor() {
    let mut plant = plant(&PlantParameters::default(), x0_d());
    plant.advance(60.0, &mut ()).unwrap();
    assert_eq!(plant.mode(), ContactMode::SlidePositive);
    assert!((plant.motion().tip_t_m(plant.state()) + 0.175_689).abs() < 1e-6);
    let normal_n = plant.contact_force_n().y;
    assert!((normal_n - 0.441_238).abs() < 1e-5, "{normal_n} N");
}

#[test]
fn a_conservative_bouncing_arm_conserves_energy() {
    let mut statistics = Statistics::new(0.0);
    let mut plant = plant(&conservative(), at_rest(40.0, 10.0));
    let energy = |p: &ArmOnBelt| p.arm().energy_j(&theta(p.state()), &theta_dot(p.state()));
    let start = energy(&plant);
    let mut worst = 0.0_f64;
    for second in 1..=100 {
        plant.advance(f64::from(second), &mut statistics).unwrap();
        worst = worst.max((energy(&plant) - start).abs() / start.abs());
    }
    assert!(statistics.impacts > 50, "{} impacts", statistics.impacts);
    assert!(worst < 1e-8, "relative drift {worst:e}");
}

/// Steps of a millisecond use the method of order 5, except at a tolerance of 1e-12, which rejects
/// it.
#[test]
fn short_steps_meet_the_tolerance() {
    let end = |relative_tolerance: f64, lag_s: f64| {
        let solver = SolverSettings {
            relative_tolerance,
            absolute_tolerance: 0.1 * relative_tolerance,
            ..Default::default()
        };
        let parameters = PlantParameters {
            solver,
            ..Default::default()
        };
        let mut plant = plant(&parameters, x0_d());
        for tick in 1..=2000 {
            let torque = JointTorque::new(0.05 * f64::from(tick % 7), 0.02 * f64::from(tick % 5));
            plant.command_torque(torque, lag_s);
            plant.advance(f64::from(tick) * 1e-3, &mut ()).unwrap();
        }
        assert_eq!(plant.mode(), ContactMode::SlidePositive);
        *plant.state()
    };
    for lag_s in [0.0, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3] {
        let difference = (end(1e-9, lag_s) - end(1e-12, lag_s)).amax();
        let met = difference > 0.0 && difference < 1e-9;
        assert!(met, "{lag_s} s: {difference:e}");
    }
}

#[test]
fn a_sliding_tip_stays_on_the_belt() {
    let mut drift = ConstraintDrift::default();
    let mut plant = plant(&PlantParameters::default(), x0_d());
    plant.advance(20.0, &mut drift).unwrap();
    assert!(drift.modes.contains(&ContactMode::SlidePositive));
    assert!(drift.gap_m < 1e-10, "{:e}", drift.gap_m);
}

#[test]
fn a_sticking_tip_moves_with_an_accelerating_belt() {
    let parameters = PlantParameters {
        friction: 1.0,
        belt: BeltProfile::Sine {
            mean_m_s: 0.0,
            amplitude_m_s: 0.02,
            frequency_hz: 1.0,
        },
        ..Default::default()
    };
    let mut drift = ConstraintDrift::default();
    let mut plant = plant(&parameters, x0_d());
    // Press the tip down so that friction can hold it.
    plant.command_torque(JointTorque::new(-0.5, 0.2), 0.0);
    let mut worst = 0.0_f64;
    let mut start = None;
    for step in 1..=2000 {
        plant.advance(f64::from(step) * 1e-3, &mut drift).unwrap();
        if plant.mode() == ContactMode::Stick {
            let at = plant.snapshot();
            let slip = Slip::of(-at.tangential_force_n);
            let p = plant
                .motion()
                .arm
                .p_per_kg(&Pose::new(&at.theta_rad), 1.0, slip);
            assert!((at.p_per_kg - p).abs() < 1e-9, "{at:?}");
            let tip = plant.motion().tip_t_m(plant.state());
            let (since, anchor) = *start.get_or_insert((plant.time_s(), tip));
            let moved = parameters.belt.displacement_m(since, plant.time_s());
            worst = worst.max((tip - anchor - moved).abs());
        } else {
            start = None;
        }
    }
    assert!(
        drift.modes.contains(&ContactMode::Stick),
        "{:?}",
        drift.modes
    );
    assert!(drift.gap_m < 1e-10, "{:e}", drift.gap_m);
    assert!(worst < 1e-10, "drift along the belt {worst:e}");
}

#[test]
fn a_reversing_belt_makes_the_tip_stick_and_slide_back() {
    let parameters = PlantParameters {
        belt: BeltProfile::Ramp {
            from_m_s: -0.4,
            to_m_s: 0.4,
            start_s: 1.0,
            duration_s: 1.0,
        },
        ..Default::default()
    };
    let mut drift = ConstraintDrift::default();
    let mut plant = plant(&parameters, x0_d());
    plant.advance(4.0, &mut drift).unwrap();
    assert!(drift.modes.contains(&ContactMode::SlidePositive));
    assert!(
        drift.modes.contains(&ContactMode::SlideNegative),
        "{:?}",
        drift.modes
    );
    assert!(drift.gap_m < 1e-10);
}

#[test]
fn a_start_deep_inside_the_belt_is_refused() {
    let error = ArmOnBelt::new(&PlantParameters::default(), at_rest(0.0, 0.0)).unwrap_err();
    assert_eq!(error.key, "initial tip height over the belt in m");
}

/// The nearest place on the belt of an arm that hangs straight down is in no direction.
#[test]
fn a_start_that_does_not_lead_onto_the_belt_is_refused() {
    let parameters = PlantParameters {
        arm: ArmParameters {
            height_m: 0.4195,
            ..Default::default()
        },
        ..Default::default()
    };
    for degrees in [0.0, 0.01] {
        let error = ArmOnBelt::new(&parameters, at_rest(degrees, degrees)).unwrap_err();
        assert!(error.to_string().contains("initial.theta1_deg"), "{error}");
    }
    assert!(ArmOnBelt::new(&parameters, at_rest(2.5, 2.5)).is_ok());
}

/// Accuracy bar: a second of bouncing hardly depends on the tolerance.
#[test]
fn a_tighter_tolerance_hardly_changes_a_second_of_bouncing() {
    let run = |relative_tolerance: f64| {
        let parameters = PlantParameters {
            solver: SolverSettings {
                relative_tolerance,
                absolute_tolerance: 0.1 * relative_tolerance,
                ..Default::default()
            },
            ..Default::default()
        };
        let mut statistics = Statistics::new(0.05);
        let mut plant = plant(&parameters, x0_a());
        plant.advance(1.0, &mut statistics).unwrap();
        assert!(statistics.impacts > 2);
        *plant.state()
    };
    let change = run(1e-9) - run(1e-10);
    assert!(theta(&change).amax() < 1e-6, "moved by {change}");
}

#[test]
fn one_long_advance_equals_many_short_ones() {
    let run = |parts: u32| {
        let mut plant = plant(&PlantParameters::default(), x0_a());
        for part in 1..=parts {
            plant
                .advance(f64::from(part) / f64::from(parts), &mut ())
                .unwrap();
        }
        *plant.state()
    };
    assert!((run(1) - run(1000)).amax() < 1e-5);
}

/// Bouncing ends in finite time after infinitely many impacts.
#[test]
fn chatter_ends_in_contact() {
    for restitution in [0.0, 0.1, 0.8] {
        let parameters = PlantParameters {
            friction: 0.2,
            impact: ImpactLaw {
                law: Restitution::Energetic,
                restitution,
            },
            ..Default::default()
        };
        let mut initial = x0_d();
        initial[0] -= 0.05;
        let mut plant = plant(&parameters, initial);
        assert_eq!(plant.mode(), ContactMode::Flight);
        plant.advance(20.0, &mut ()).unwrap();
        assert!(plant.mode().is_contact(), "e = {restitution}");
    }
}

#[test]
fn the_attractor_is_in_torque_balance() {
    let mut plant = plant(&PlantParameters::default(), x0_d());
    plant.advance(120.0, &mut ()).unwrap();
    let angles = theta(plant.state());
    let pose = Pose::new(&angles);
    let jacobian = plant.arm().jacobian(&pose);
    let load = jacobian.transpose() * plant.contact_force_n();
    let passive = plant
        .arm()
        .passive_torque_nm(&angles, &LinkMotion::zeros(), &pose);
    let left_nm = load - passive.vector();
    assert!(left_nm.amax() < 1e-6, "{left_nm}");
    assert_eq!(Posture::of(&angles), Posture::ElbowDown);
}

/// The belt reverses the slip four times in a step of 5 ms.
#[test]
fn a_fast_belt_moves_the_tip_alike_in_long_and_short_steps() {
    let end_m = |ticks: u32| {
        let parameters = PlantParameters {
            belt: BeltProfile::Sine {
                mean_m_s: -0.1,
                amplitude_m_s: 0.4,
                frequency_hz: 800.0,
            },
            ..Default::default()
        };
        let mut plant = plant(&parameters, x0_d());
        for tick in 1..=ticks {
            let until_s = 3.0 * f64::from(tick) / f64::from(ticks);
            plant.advance(until_s, &mut ()).unwrap();
        }
        plant.motion().tip_t_m(plant.state())
    };
    let [long, short] = [600, 30_000].map(end_m);
    assert!((long - short).abs() < 1e-6, "{long} {short}");
}

#[test]
fn no_step_is_longer_than_the_longest_allowed() {
    struct Longest(f64);
    impl ArmProbe for Longest {
        fn step(&mut self, step: &ArmStep<'_>) {
            self.0 = self.0.max(step.end_s - step.start_s);
        }

        fn event(&mut self, _: f64, _: Event, _: &State) {}
    }
    let mut longest = Longest(0.0);
    let parameters = PlantParameters {
        solver: SolverSettings {
            maximum_step_s: 1e-4,
            ..Default::default()
        },
        ..Default::default()
    };
    plant(&parameters, x0_d())
        .advance(3e-3, &mut longest)
        .unwrap();
    assert!(longest.0 < 1.001e-4, "{} s", longest.0);
}

/// As p vanishes, the force −b/p of an indeterminate slide grows beyond all bounds.
#[test]
fn an_indeterminate_slide_ends_before_p_changes_its_sign() {
    let (arm, belt, state) = (
        Arm::new(ArmParameters::default()).unwrap(),
        BeltProfile::default(),
        x0_a(),
    );
    let motion = |friction| Motion {
        arm: &arm,
        belt: &belt,
        friction,
        torque: TorqueSegment::constant(JointTorque::new(1.0, 0.0)),
    };
    let terms = motion(0.0).terms(0.0, &state);
    assert!(terms.b_m_s2() > 0.0, "{}", terms.b_m_s2());
    let with_p = |share: f64| motion((1.0 - share) * terms.q.m22 / terms.q.m12);
    let slide = ContactMode::SlidePositive;
    for (share, mode) in [
        (-1e-3, slide),
        (-5e-7, ContactMode::Flight),
        (5e-7, ContactMode::Flight),
    ] {
        let next = decide(&with_p(share), 0.0, &state, Indeterminate::Slide);
        assert_eq!(next, Continuation::Mode(mode), "{share}");
    }
    let start = with_p(-1e-3).evaluate(slide, 0.0, &state);
    for share in [-5e-7, 5e-7] {
        let end = Evaluation {
            slip: start.slip,
            ..with_p(share).evaluate(slide, 0.0, &state)
        };
        let goes_on = goes_on(&with_p(-1e-3), slide, 1e-9, &start, &end);
        assert!(!goes_on, "{share}");
    }
}

/// Whether a plant that cannot continue is at full stretch, where Q is singular.
fn is_at_full_stretch(plant: &ArmOnBelt) -> bool {
    let tip_t_m = plant.motion().tip_t_m(plant.state());
    (plant.arm().reach_on_belt_m() - tip_t_m.abs()).abs() < 1e-7
}

/// Whether or not the step comes at the end of a stretch, the tip, which has slowed down, is dragged the other way by friction only.
#[test]
fn a_step_of_the_belts_speed_does_not_move_the_tip_at_once() {
    for until_s in [1.0, 1.0004] {
        let parameters = PlantParameters {
            belt: BeltProfile::Step {
                from_m_s: -0.4,
                to_m_s: 0.4,
                at_s: 1.0,
            },
            ..Default::default()
        };
        let mut drift = ConstraintDrift::default();
        let mut plant = plant(&parameters, x0_d());
        plant.advance(1.0 - 1e-6, &mut drift).unwrap();
        assert_eq!(plant.mode(), ContactMode::SlidePositive);
        let before = *plant.state();
        plant.advance(until_s, &mut drift).unwrap();
        plant.advance(1.0004, &mut drift).unwrap();
        assert_eq!(plant.mode(), ContactMode::SlideNegative);
        let change = (plant.state() - before).norm();
        assert!(change < 0.2, "{until_s}: {change}");
    }
}

#[test]
fn a_tip_that_starts_downwards_on_the_belt_collides_with_it() {
    let mut initial = x0_d();
    initial[2] = 1.0;
    let mut plant = plant(&PlantParameters::default(), initial);
    let approach_m_s = plant.motion().relative_velocity_m_s(0.0, plant.state()).y;
    assert!(approach_m_s < -0.03, "{approach_m_s}");
    let mut statistics = Statistics::new(0.0);
    plant.advance(1e-3, &mut statistics).unwrap();
    // A tenth of the velocity remains after each.
    assert!(statistics.impacts > 1, "{}", statistics.impacts);
}

/// Where p = 0 meets the limit of reach, μ = 0.488, the tip is thrown against its own links.
#[test]
fn an_arm_that_jams_at_full_stretch_is_reported_as_an_error() {
    let friction = 0.488;
    let parameters = PlantParameters {
        friction,
        belt: BeltProfile::Constant { speed_m_s: 0.0 },
        impact: ImpactLaw {
            law: Restitution::Poisson,
            restitution: 0.0,
        },
        ..Default::default()
    };
    let mut plant = plant(
        &parameters,
        at_rest(12.039_051_226_506_15, 48.336_841_664_901_43),
    );
    let error = plant.advance(1.0, &mut ()).unwrap_err();
    assert!(error.to_string().contains("the arm is straight"), "{error}");
    assert!(is_at_full_stretch(&plant));
}

mod any_scenario {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        fn belts()(kind in 0..3, a in -1.0_f64..1.0, b in -1.0_f64..1.0, at in 0.0_f64..2.0, f in -0.7_f64..3.0)
            -> BeltProfile {
            match kind {
                0 => BeltProfile::Step { from_m_s: a, to_m_s: b, at_s: at },
                1 => BeltProfile::Ramp { from_m_s: a, to_m_s: b, start_s: at, duration_s: 0.5 },
                _ => BeltProfile::Sine { mean_m_s: 0.3 * a, amplitude_m_s: b, frequency_hz: 10_f64.powf(f) },
            }
        }
    }

    proptest! {
        /// For any friction, belt, torque and start, the plant continues, and its tip stays out of
        /// the belt and, in contact, on it.
        #[test]
        fn the_plant_always_continues(
            friction in 0.0_f64..1.5, restitution in 0.0_f64..1.0, energetic: bool, belt in belts(),
            theta1 in -60.0_f64..60.0, theta2 in -60.0_f64..60.0,
            u1 in -1.0_f64..1.0, u2 in -1.0_f64..1.0,
        ) {
            let law = if energetic { Restitution::Energetic } else { Restitution::Poisson };
            let parameters = PlantParameters {
                friction,
                belt,
                impact: ImpactLaw { law, restitution },
                ..Default::default()
            };
            let initial = at_rest(theta1, theta2);
            let arm = Arm::new(parameters.arm).unwrap();
            prop_assume!(arm.gap_m(&Pose::new(&theta(&initial))) > -1e-3);
            let mut plant = plant(&parameters, initial);
            plant.command_torque(JointTorque::new(u1, u2), 0.0);
            let mut drift = ConstraintDrift::default();
            for tenth in 1..=30 {
                if let Err(error) = plant.advance(0.1 * f64::from(tenth), &mut drift) {
                    prop_assert!(is_at_full_stretch(&plant), "{}", error);
                    break;
                }
                prop_assert!(plant.motion().gap_m(plant.state()) > -1e-10);
            }
            prop_assert!(drift.gap_m < 1e-10);
        }
    }
}
