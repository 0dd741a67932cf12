use painleve_shared::Pose;

use super::*;
use crate::mechanics::ArmOnBelt;
use crate::mechanics::belt::BeltProfile;
use crate::mechanics::effects::payload::Payload;
use crate::mechanics::effects::push::Push;
use crate::mechanics::effects::surface::Surface;

/// The paper's x0,a, which is inconsistent at the start; x0,d lies on the belt.
const INCONSISTENT_DEG: (f64, f64) = (32.0, 18.27);
const ON_BELT_DEG: (f64, f64) = (-11.4, -35.1);

fn start(degrees: (f64, f64)) -> State {
    State::new(degrees.0.to_radians(), degrees.1.to_radians(), 0.0, 0.0)
}

/// A contact of this stiffness with damping ratio 0.6 for 40 g, and equal tangential stiffness at
/// 10 N.
fn contact(stiffness_n_m: f64, local_error: f64) -> TipContact {
    TipContact {
        kind: ContactKind::Compliant,
        stiffness_n_m,
        normal: NormalDamping::KelvinVoigt {
            damping_ns_m: 1.2 * (0.04 * stiffness_n_m).sqrt(),
        },
        bristle_stiffness_per_m: 0.1 * stiffness_n_m,
        local_error,
        ..Default::default()
    }
}

fn compliant(contact: &TipContact, effects: &Effects, degrees: (f64, f64)) -> CompliantArmOnBelt {
    let parameters = PlantParameters::default();
    CompliantArmOnBelt::new(&parameters, contact, effects, start(degrees)).unwrap()
}

/// A torque that keeps the tip on the belt and moves it, with a new value every millisecond.
fn torque_nm(tick: u32) -> JointTorque<f64> {
    let time_s = f64::from(tick) * 1e-3;
    JointTorque::new(0.002 * libm::sin(9.0 * time_s), 0.0)
}

#[test]
fn a_sliding_tip_converges_to_the_rigid_motion_as_the_stiffness_grows() {
    let parameters = PlantParameters::default();
    let mut quiet = ArmOnBelt::new(&parameters, start(ON_BELT_DEG)).unwrap();
    quiet.advance(30.0, &mut ()).unwrap();
    let deviation = |stiffness_n_m| {
        let contact = contact(stiffness_n_m, 1e-7);
        let effects = Effects::default();
        let mut soft =
            CompliantArmOnBelt::new(&parameters, &contact, &effects, *quiet.state()).unwrap();
        let mut rigid = ArmOnBelt::new(&parameters, *quiet.state()).unwrap();
        let mut largest = 0.0_f64;
        for tick in 0..100 {
            rigid.command_torque(torque_nm(tick), 0.0);
            soft.command_torque(torque_nm(tick), 0.0);
            let until_s = f64::from(tick + 1) * 1e-3;
            rigid.advance(until_s, &mut ()).unwrap();
            soft.advance(until_s, &mut ()).unwrap();
            assert!(rigid.mode().is_contact());
            largest = largest.max((soft.state() - rigid.state()).fixed_rows::<2>(0).norm());
        }
        largest
    };
    let deviations = [1e4, 1e5, 1e6].map(deviation);
    for pair in deviations.windows(2) {
        assert!(pair[1] < 0.5 * pair[0], "{deviations:?}");
    }
}

#[test]
fn a_tighter_tolerance_gives_the_same_motion_at_any_stiffness() {
    for stiffness_n_m in [1e4, 1e5, 1e6] {
        let end = |local_error| {
            let contact = contact(stiffness_n_m, local_error);
            let mut plant = compliant(&contact, &Effects::default(), ON_BELT_DEG);
            for tick in 0..20 {
                plant.command_torque(torque_nm(tick), 0.0);
                plant.advance(f64::from(tick + 1) * 1e-3, &mut ()).unwrap();
            }
            (plant.state(), plant.contact_force_n())
        };
        let ((coarse, force), (fine, finer_force)) = (end(1e-6), end(1e-7));
        assert!((coarse - fine).norm() < 2e-3, "{stiffness_n_m}");
        assert!((force - finer_force).norm() < 0.2, "{stiffness_n_m}");
    }
}

/// The rigid plant resolves the inconsistent start by an impact without collision, which throws the
/// tip off at 10.5 mm/s. A compliant contact also throws it off, without any such rule.
#[test]
fn the_inconsistent_start_throws_the_tip_off_as_on_the_rigid_belt() {
    for stiffness_n_m in [1e5, 1e6] {
        let contact = contact(stiffness_n_m, 1e-7);
        let mut plant = compliant(&contact, &Effects::default(), INCONSISTENT_DEG);
        let mut largest_n = 0.0_f64;
        let mut thrown_m_s = 0.0_f64;
        for step in 1..200 {
            plant.advance(f64::from(step) * 1e-4, &mut ()).unwrap();
            largest_n = largest_n.max(plant.contact_force_n().y);
            if plant.contact_force_n().y == 0.0 {
                thrown_m_s = thrown_m_s.max(plant.snapshot().gap_rate_m_s);
            }
        }
        assert!(largest_n > 1.0, "{stiffness_n_m}: {largest_n}");
        assert!(thrown_m_s > 1e-3, "{stiffness_n_m}: {thrown_m_s}");
    }
}

#[test]
fn the_contact_never_pulls_and_settles_at_the_force_of_the_quiet_attractor() {
    let contact = contact(1e5, 1e-6);
    let mut plant = compliant(&contact, &Effects::default(), ON_BELT_DEG);
    for step in 1..20_000 {
        plant.advance(f64::from(step) * 1e-3, &mut ()).unwrap();
        assert!(plant.contact_force_n().y >= 0.0);
    }
    // The quiet attractor, elbow down: z_t = −0.175689 m, f_n = 0.441238 N.
    assert!((plant.contact_force_n().y - 0.441_238).abs() < 2e-3);
    assert!((plant.snapshot().tip_t_m + 0.175_689).abs() < 1e-4);
}

#[test]
fn a_stiff_gear_without_joint_friction_hardly_changes_the_motion() {
    let mut geared = Effects::default();
    geared.gear.elastic = true;
    geared.gear.stiffness_nm_rad = 1e5;
    geared.gear.damping_nms_rad = 1.0;
    geared.gear.rotor_inertia_kg_m2 = 1e-7;
    let end = |effects: &Effects| {
        let mut plant = compliant(&contact(1e5, 1e-8), effects, ON_BELT_DEG);
        for tick in 0..200 {
            plant.command_torque(torque_nm(tick), 0.0);
            plant.advance(f64::from(tick + 1) * 1e-3, &mut ()).unwrap();
        }
        plant.state()
    };
    assert!((end(&Effects::default()) - end(&geared)).norm() < 1e-2);
}

#[test]
fn friction_of_the_arm_and_unknown_friction_have_the_same_effect() {
    let end = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        let scenario = crate::scenario::Scenario::load("hybrid-elbow-down", &set).unwrap();
        let mut plant = crate::mechanics::BuiltInPlant::new(&scenario).unwrap();
        plant.command_torque(torque_nm(0), 0.0);
        Plant::advance(&mut plant, 0.05, &mut ()).unwrap();
        plant.snapshot().theta_rad
    };
    let compliant = "contact.kind=compliant";
    let arm = end(&[compliant, "arm.coulomb_friction_nm=[0.1, 0.1]"]);
    assert_eq!(arm, end(&[compliant, "effects.joints.coulomb_nm=0.1"]));
    assert_ne!(arm, end(&[compliant]));
}

#[test]
fn a_push_changes_the_tips_velocity_by_its_impulse() {
    let push = Push {
        impulse_ns: [0.0, 0.02],
        at_s: 0.0,
        duration_s: 1e-4,
    };
    let velocity_m_s = |push: Push| {
        let effects = Effects {
            push,
            ..Default::default()
        };
        let mut plant = compliant(&contact(1e5, 1e-9), &effects, (0.0, 40.0));
        plant.advance(1e-4, &mut ()).unwrap();
        let motion = plant.motion().rigid(0.0, 0.0);
        let terms = motion.terms(0.0, &plant.state());
        (motion.relative_velocity_m_s(0.0, &plant.state()), terms.q)
    };
    let (pushed, q) = velocity_m_s(push);
    let (free, _) = velocity_m_s(Push::default());
    let expected = q * Vector2::new(0.0, 0.02);
    assert!(
        (pushed - free - expected).norm() < 0.02 * expected.norm(),
        "{pushed} {free} {expected}"
    );
}

#[test]
fn a_payload_changes_the_arm_once_it_is_picked_up_and_no_velocity_with_it() {
    let at_s = 0.0025;
    let payload = Payload {
        mass_kg: 0.03,
        at_s,
    };
    let effects = Effects {
        payload,
        ..Default::default()
    };
    let contact = contact(1e5, 1e-9);
    let mut picked = compliant(&contact, &effects, (0.0, 40.0));
    let mut free = compliant(&contact, &Effects::default(), (0.0, 40.0));
    for plant in [&mut picked, &mut free] {
        plant.advance(at_s, &mut ()).unwrap();
    }
    assert_eq!(picked.state(), free.state());
    // From here on it moves as an arm that had the mass from the start.
    picked.advance(at_s + 1e-6, &mut ()).unwrap();
    let parameters = PlantParameters {
        arm: painleve_shared::ArmParameters {
            tip_mass_kg: 0.03,
            ..Default::default()
        },
        ..Default::default()
    };
    let effects = Effects::default();
    let mut heavy = CompliantArmOnBelt::new(&parameters, &contact, &effects, free.state()).unwrap();
    // In flight: an impact would magnify the errors of integration.
    heavy.advance(0.002, &mut ()).unwrap();
    picked.advance(at_s + 0.002, &mut ()).unwrap();
    free.advance(at_s + 0.002, &mut ()).unwrap();
    assert!((picked.state() - heavy.state()).norm() < 1e-6);
    assert!((picked.state() - free.state()).norm() > 1e-3);
}

fn on_hanging_belt(stiffness_n_m: f64, joint_friction_nm: f64) -> CompliantArmOnBelt {
    let mut effects = Effects::default();
    effects.hanging_belt.mass_kg = 0.02;
    effects.hanging_belt.stiffness_n_m = stiffness_n_m;
    effects.joints.coulomb_nm = joint_friction_nm;
    compliant(&contact(1e5, 1e-8), &effects, ON_BELT_DEG)
}

#[test]
fn a_hanging_belt_sags_by_the_force_over_its_stiffness() {
    let mut plant = on_hanging_belt(2e4, 0.0);
    for step in 1..20_000 {
        plant.advance(f64::from(step) * 1e-3, &mut ()).unwrap();
    }
    let force_n = plant.contact_force_n().y;
    assert!(force_n > 0.3, "{force_n}");
    // Belt and contact are springs in series.
    let sag_m = force_n / 2e4;
    assert!((plant.state[11] + sag_m).abs() < 1e-3 * sag_m);
    let tip_m = plant
        .arm
        .gap_m(&Pose::new(&LinkMotion::new(plant.state[0], plant.state[1])));
    let both_m = force_n * (1.0 / 2e4 + 1.0 / 1e5);
    assert!((tip_m + both_m).abs() < 2e-3 * both_m, "{tip_m} {both_m}");
}

#[test]
fn a_hanging_belt_rings_at_its_natural_frequency_after_the_tip_has_left_it() {
    let mut plant = on_hanging_belt(2e4, 0.0);
    // The tip is far away, and the belt is released from 1 mm above its rest.
    plant.state[0] = 40.0_f64.to_radians();
    plant.state[1] = 80.0_f64.to_radians();
    plant.state[11] = 1e-3;
    let (natural, ratio) = ((2e4_f64 / 0.02).sqrt(), 0.15);
    let damped = natural * (1.0_f64 - ratio * ratio).sqrt();
    let period_s = core::f64::consts::TAU / damped;
    plant.advance(period_s, &mut ()).unwrap();
    let decayed_m = 1e-3 * (-ratio * natural * period_s).exp();
    assert!(
        (plant.state[11] - decayed_m).abs() < 1e-6,
        "{}",
        plant.state[11]
    );
}

#[test]
fn a_stiff_hanging_belt_is_a_belt_on_a_firm_bed_with_and_without_drives() {
    let end = |mut plant: CompliantArmOnBelt| {
        for tick in 0..200 {
            plant.command_torque(torque_nm(tick), 0.0);
            plant.advance(f64::from(tick + 1) * 1e-3, &mut ()).unwrap();
        }
        plant.state()
    };
    let firm = end(compliant(
        &contact(1e5, 1e-8),
        &Effects::default(),
        ON_BELT_DEG,
    ));
    let hanging = end(on_hanging_belt(1e9, 0.0));
    assert!((firm - hanging).norm() < 1e-3);
    let with_drives = end(on_hanging_belt(1e9, 1e-9));
    assert!((hanging - with_drives).norm() < 1e-3);
}

#[test]
fn a_start_on_an_uneven_belt_touches_its_surface_without_force() {
    for (waviness_m, step_height_m) in [(0.0, 0.01), (0.0, -0.01), (1e-3, 0.0)] {
        let surface = Surface {
            waviness_m,
            step_height_m,
            ..Default::default()
        };
        let effects = Effects {
            surface,
            ..Default::default()
        };
        let plant = compliant(&contact(1e5, 1e-6), &effects, ON_BELT_DEG);
        let start = plant.snapshot();
        assert!(start.gap_m.abs() < 1e-12, "{}", start.gap_m);
        assert!(start.normal_force_n < 1e-3, "{}", start.normal_force_n);
        assert!(start.mode.is_contact());
    }
}

#[test]
fn a_belt_that_changes_its_speed_keeps_its_surface_where_it_is() {
    let effects = Effects {
        surface: Surface {
            waviness_m: 1e-4,
            ..Default::default()
        },
        ..Default::default()
    };
    let mut plant = compliant(&contact(1e5, 1e-6), &effects, ON_BELT_DEG);
    plant.advance(3.0, &mut ()).unwrap();
    let before_n = plant.contact_force_n();
    let profile = BeltProfile::Constant { speed_m_s: -0.401 };
    plant.set_belt(&BeltSettings {
        profile,
        ..Default::default()
    });
    let change_n = (plant.contact_force_n() - before_n).norm();
    assert!(change_n < 0.05, "{change_n} N of {before_n}");
}

#[test]
fn the_rigid_plant_refuses_every_effect_by_its_key() {
    for (key, value) in [
        (
            "effects.friction",
            "effects.friction={ kind = 'sine', amplitude = 0.1, frequency_hz = 1.0 }",
        ),
        ("effects.surface", "effects.surface.waviness_m=1e-4"),
        ("effects.hanging_belt", "effects.hanging_belt.mass_kg=0.02"),
        ("effects.joints", "effects.joints.coulomb_nm=0.1"),
        (
            "arm.coulomb_friction_nm",
            "arm.coulomb_friction_nm=[0.0, 0.1]",
        ),
        ("effects.gear", "effects.gear.elastic=true"),
        ("effects.push", "effects.push.impulse_ns=[0.0, 0.1]"),
        ("effects.payload", "effects.payload.mass_kg=0.1"),
    ] {
        let load = |more: &[&str]| {
            let set: Vec<String> = more.iter().map(ToString::to_string).collect();
            crate::scenario::Scenario::load("edge", &set)
        };
        let error = load(&[value]).unwrap_err().to_string();
        assert!(
            error.contains(key) && error.contains("compliant"),
            "{error}"
        );
        // A study, which places the arm later, says the same.
        let unplaced = crate::scenario::Scenario::load_unplaced("edge", &[value.into()]);
        assert_eq!(unplaced.unwrap_err().to_string(), error);
        load(&[value, "contact.kind=compliant"]).unwrap();
    }
}
