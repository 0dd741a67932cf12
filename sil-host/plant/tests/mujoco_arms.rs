//! Mass matrix, bias torque and Jacobian of 1,000 random arms in random states against MuJoCo
//! (`data/mujoco_arms.csv`; `data/mujoco_arms.py` made it and says how).

use nalgebra::Matrix2;
use painleve_shared::{Arm, ArmParameters, JointMotion, Pose};

const ARMS: &str = include_str!("data/mujoco_arms.csv");
const RELATIVE: f64 = 1e-9;

#[test]
fn every_arm_moves_as_mujocos_does() {
    let mut lines = ARMS.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    for (index, line) in lines.enumerate() {
        let values: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let column = |name: &str| values[header.iter().position(|h| *h == name).unwrap()];
        let pair = |name: &str| [1, 2].map(|number| column(&format!("{name}{number}")));

        let [length_1, length_2] = pair("length");
        let arm = Arm::new(ArmParameters {
            link_length_m: [length_1, length_2],
            link_mass_kg: pair("mass"),
            link_centre_of_mass_m: Some(pair("centre")),
            link_inertia_kg_m2: Some(pair("inertia")),
            tip_mass_kg: column("tip"),
            damping_nms_rad: pair("damping"),
            stiffness_nm_rad: pair("stiffness"),
            spring_rest_rad: pair("rest"),
            rotor_inertia_kg_m2: pair("rotor"),
            // Nothing here depends on where the belt is.
            height_m: length_1.max(length_2),
            belt_tilt_rad: column("tilt"),
            gravity_m_s2: column("gravity"),
        })
        .unwrap();
        let theta = JointMotion::from(pair("q")).to_links();
        let theta_dot = JointMotion::from(pair("qd")).to_links();
        let pose = Pose::new(&theta);

        // θ = T q' and θ̇ = T q̇' with this T.
        let links_of_joints = Matrix2::new(1.0, 0.0, 1.0, 1.0);
        let mass = links_of_joints.transpose() * arm.mass_matrix(&pose) * links_of_joints;
        let bias = (arm.passive_torque_nm(&theta, &theta_dot, &pose)
            + arm.centrifugal_torque_nm(&theta_dot, &pose))
        .to_joints();
        let jacobian = arm.jacobian(&pose) * links_of_joints;

        let close = |name: &str, ours: f64, scale: f64| {
            let theirs = column(name);
            let error = (ours - theirs).abs() / scale;
            assert!(
                error < RELATIVE,
                "row {}: {name} is {ours:e}, MuJoCo has {theirs:e} (relative error {error:e})",
                index + 1
            );
        };
        // An element that cancels is compared on the scale of its matrix.
        close("m11", mass.m11, mass.amax());
        close("m12", mass.m12, mass.amax());
        close("m22", mass.m22, mass.amax());
        close("h1", bias.first(), bias.amax());
        close("h2", bias.second(), bias.amax());
        close("jt1", jacobian.m11, jacobian.amax());
        close("jt2", jacobian.m12, jacobian.amax());
        close("jn1", jacobian.m21, jacobian.amax());
        close("jn2", jacobian.m22, jacobian.amax());
    }
    assert_eq!(ARMS.lines().count(), 1001);
}
