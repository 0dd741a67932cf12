//! Comparison of contact terms and impacts with an independent implementation:
//! 400 random states with the tip at belt height (`data/contact_states.csv`).

use nalgebra::Vector2;
use painleve_plant::mechanics::impact::{ImpactLaw, Restitution, collide};
use painleve_shared::{Arm, ArmParameters, JointTorque, LinkMotion, Pose, Slip};

const STATES: &str = include_str!("../data/contact_states.csv");
const RELATIVE: f64 = 1e-9;

fn assert_close(row: usize, name: &str, ours: f64, theirs: f64, scale: f64) {
    let error = (ours - theirs).abs() / scale.max(theirs.abs());
    assert!(
        error < RELATIVE,
        "row {row}: {name} is {ours:e}, the reference has {theirs:e} (relative error {error:e})"
    );
}

#[test]
fn every_reference_state_agrees() {
    let mut lines = STATES.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut rows = 0;
    for (index, line) in lines.enumerate() {
        let values: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let column = |name: &str| values[header.iter().position(|h| *h == name).unwrap()];
        let close = |name: &str, ours: f64, scale: f64| {
            assert_close(index + 1, name, ours, column(name), scale);
        };

        let arm = Arm::new(ArmParameters {
            stiffness_nm_rad: [0.0, column("k")],
            height_m: column("height"),
            ..Default::default()
        })
        .unwrap();
        let theta = LinkMotion::new(column("th1"), column("th2"));
        let theta_dot = LinkMotion::new(column("w1"), column("w2"));
        let friction = column("mu");
        let pose = Pose::new(&theta);
        let torque = JointTorque::new(column("u1"), column("u2")).to_links();
        let terms = arm.contact_terms(&theta, &theta_dot, &pose, &torque);
        // The reference has 12 decimals. Q and b are of order 1 to 100, so
        // values that cancel to nearly zero are compared on that scale.
        close("q11", terms.q.m11, 0.0);
        close("q12", terms.q.m12, 1e-1);
        close("q22", terms.q.m22, 0.0);
        close("b", terms.b_m_s2(), 1e-1);
        close("p_plus", terms.p_per_kg(friction, Slip::Positive), 1e-1);
        close("p_minus", terms.p_per_kg(friction, Slip::Negative), 1e-1);

        let jacobian = arm.jacobian(&pose);
        let velocity = jacobian * theta_dot.vector();
        close("vt", velocity.x, 1e-2);
        close("vn", velocity.y, 1e-2);

        let law = ImpactLaw {
            law: Restitution::Poisson,
            restitution: column("e"),
        };
        let relative = Vector2::new(velocity.x - column("v_belt"), velocity.y);
        // A resting tip collides only where sliding is inconsistent.
        let resting = column("vn") == 0.0;
        let relative = if resting {
            Vector2::new(relative.x, 0.0)
        } else {
            relative
        };
        let impact = collide(&terms.q, friction, &law, relative).unwrap();
        let after = theta_dot.vector()
            + arm.inverse_mass_matrix(&pose) * (jacobian.transpose() * impact.impulse_ns);
        close("w1_after", after.x, 1e-1);
        close("w2_after", after.y, 1e-1);
        close("p_normal", impact.impulse_ns.y, 1e-3);
        close("p_tangential", impact.impulse_ns.x, 1e-3);
        rows += 1;
    }
    assert_eq!(rows, 400);
}
