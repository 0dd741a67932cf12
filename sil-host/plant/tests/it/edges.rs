//! The governor knows the edges before a reference can pass them, for the posture that the arm has.

use painleve_shared::status::Fault;

use crate::run;

/// A reference that starts fast, before both edges have been found, and ends beyond one.
#[test]
fn a_reference_waits_until_the_edges_have_been_found() {
    let end = run(
        "edge",
        &[
            "initial.tip_m=0.14",
            "run.duration_s=2",
            "controller.reference=[{ minimum-jerk = { target_m = 0.18, duration_s = 0.1 } }]",
        ],
    );
    assert_eq!((end.statistics.lift_offs, end.fault), (0, None));
}

/// The elbow of this arm, which is switched on in the air, swings through straight after its recovery has begun. It lands
/// elbow down, where the upper edge is nearer than elbow up.
#[test]
fn an_arm_that_lands_in_another_posture_keeps_its_edges() {
    let end = run(
        "capture",
        &[
            "run.enable_at_s=0.1",
            "run.duration_s=4",
            "initial.theta1_deg=55.133",
            "initial.theta2_deg=-43.305",
            "initial.theta1_dot_rad_s=3.309",
            "initial.theta2_dot_rad_s=4.103",
            "controller.reference=[{ hold = { duration_s = 2 } }, \
             { minimum-jerk = { target_m = 0.184, duration_s = 1 } }]",
        ],
    );
    assert_eq!((end.statistics.lift_offs, end.fault), (0, None));
}

/// Friction and lengths are not those that the controller assumes, so that the edges that it knows while the tip lands are
/// wrong, and the belt drags the tip. Led back to where it first touched, it would pass an edge.
#[test]
fn a_captured_tip_is_not_led_back_to_where_it_touched() {
    for (friction, speed_m_s, length_m) in [
        (0.59, -0.36, 0.215),
        (0.66, -0.32, 0.2077),
        (0.74, -0.3, 0.213),
        (0.77, -0.42, 0.202),
    ] {
        let end = run(
            "capture",
            &[
                &format!("belt.friction={friction}"),
                &format!("belt.profile.speed_m_s={speed_m_s}"),
                &format!("arm_model.link_length_m=[{length_m}, {length_m}]"),
                "run.duration_s=4",
            ],
        );
        // Once: the arm bounces when the drive is switched on.
        let after = (end.statistics.lift_offs, end.fault);
        assert_eq!(after, (1, None), "{friction} {length_m}");
    }
}

/// The margin is larger than any place in reach can keep.
#[test]
fn a_thrown_tip_lands_no_nearer_the_edge_for_a_larger_margin() {
    let place_m = |distance_m: &str| {
        let distance = format!("controller.governor.distance_m={distance_m}");
        run("capture", &[&distance]).final_tip_t_m
    };
    let (near_m, far_m) = (place_m("0.06"), place_m("0.1"));
    assert!(far_m < near_m && near_m < 0.11, "{far_m} {near_m}");
}

/// At this control rate the default gains are far too high.
#[test]
fn estimates_of_an_unstable_arm_stay_numbers() {
    let end = run(
        "edge",
        &["run.tick_hz=10", "controller.estimator.bandwidth_rad_s=29"],
    );
    assert_ne!(end.fault, None);
    assert_ne!(end.fault, Some(Fault::NotFinite));
}

/// A reference passes a belt of 0.1 m/s, and ends beyond an edge: where the tip is slower again, the nearest stretch for its slip
/// lies farther along the belt. On a fast way there, it passed the belt once more and was thrown off.
#[test]
fn a_tip_is_not_led_past_a_slow_belt() {
    for ramp_s in ["1", "1.5"] {
        for deviation_m in ["0.001", "0.003"] {
            let reference = format!(
                "controller.reference=[{{ ramp = {{ target_m = -0.178, duration_s = {ramp_s} }} }}]"
            );
            let deviation = format!("controller.estimator.tip_deviation_m={deviation_m}");
            let end = run(
                "hybrid-elbow-up",
                &[
                    "initial={ tip_m = 0.0, elbow = 'up' }",
                    "belt.profile={ kind = 'constant', speed_m_s = -0.1 }",
                    "contact.kind=compliant",
                    "run.duration_s=7",
                    &reference,
                    &deviation,
                ],
            );
            assert_eq!((end.statistics.lift_offs, end.fault), (0, None));
            assert!((end.final_tip_t_m + 0.178).abs() < 1e-3);
        }
    }
}
