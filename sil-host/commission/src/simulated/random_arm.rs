//! Healthy arms at random: geometry, masses, springs, belt, converters and mounting, with errors that the
//! scenario does not know.

use core::ops::Range;

use painleve_plant::scenario::{InitialState, Scenario};
use painleve_shared::counts::ForceCounts;
use painleve_shared::{Arm, ArmParameters, JointTorque, OutOfRange, Posture};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::rest::force_at_rest_n;

/// Returns the scenario of a healthy random arm. Its model in the controller has masses, springs and
/// damping of the arm to within 5 %, and converters to within 5 %.
///
/// # Errors
/// [`OutOfRange`] if a random arm does not reach its belt.
pub fn random_arm(seed: u64) -> Result<Scenario, OutOfRange> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut draw = |range: Range<f64>| generator.random_range(range);
    let mut scenario = Scenario {
        name: format!("random-arm-{seed}"),
        ..Scenario::default()
    };
    let nominal = ArmParameters::<f64>::default();
    let lengths = [0.21 * draw(0.7..1.3), 0.21 * draw(0.7..1.3)];
    let mut scaled =
        |values: [f64; 2], by: Range<f64>| values.map(|value| value * draw(by.clone()));
    let model = ArmParameters {
        link_length_m: lengths,
        link_mass_kg: scaled(nominal.link_mass_kg, 0.5..2.0),
        link_centre_of_mass_m: Some(scaled(lengths, 0.35..0.65)),
        stiffness_nm_rad: scaled(nominal.stiffness_nm_rad, 0.7..1.3),
        height_m: (lengths[0] + lengths[1]) * draw(0.8..0.93),
        tip_mass_kg: draw(0.0..0.05),
        belt_tilt_rad: draw(-10.0..10.0).to_radians(),
        ..nominal
    };
    let mut uncertain = |values: [f64; 2]| values.map(|value| value * draw(0.95..1.05));
    scenario.arm = ArmParameters {
        link_mass_kg: uncertain(model.link_mass_kg),
        stiffness_nm_rad: uncertain(model.stiffness_nm_rad),
        damping_nms_rad: uncertain(model.damping_nms_rad),
        ..model
    };
    scenario.arm_model = Some(model.cast());
    scenario.belt.friction = draw(0.3..1.0);
    let posture = if draw(0.0..1.0) < 0.5 {
        Posture::ElbowDown
    } else {
        Posture::ElbowUp
    };
    let arm = Arm::new(scenario.arm)?;
    let start = arm.link_angles_on_belt_rad(0.0, posture);
    let weight_n = start.and_then(|start| force_at_rest_n(&arm, &start, JointTorque::zeros()));
    if let Some(start) = start {
        let [theta_1, theta_2] = start.to_array().map(f64::to_degrees);
        scenario.initial = InitialState::at_rest(theta_1, theta_2);
    }
    let converters = &mut scenario.converters;
    converters.encoder.bits = draw(12.0..17.0) as u8;
    let modulus = f64::from(1 << converters.encoder.bits);
    converters.encoder.offset_counts = [0, 1].map(|_| draw(0.0..modulus) as u32);
    converters.encoder.eccentricity_rad = [0, 1].map(|_| draw(0.0..0.005));
    // A cell that suits the arm: its weight takes a tenth to two fifths of the range.
    converters.force.range_n = weight_n.map_or(0.0, |it| it.y) / draw(0.1..0.4);
    converters.force.noise_n = draw(0.0..0.1);
    converters.force.gain_error = [0, 1].map(|_| draw(-0.05..0.05));
    converters.force.cross_talk = [0, 1].map(|_| draw(-0.02..0.02));
    converters.torque.bits = draw(11.0..15.0) as u8;
    converters.torque.error.gain = [0, 1].map(|_| draw(-0.05..0.05));
    converters.torque.error.ripple = draw(0.0..0.02);
    let mut coin = || draw(0.0..1.0) < 0.5;
    let mounting = &mut converters.mounting;
    mounting.encoder_reversed = [coin(), coin()];
    mounting.stage_reversed = [coin(), coin()];
    mounting.force_reversed = [coin(), coin()];
    let counts = f64::from(1 << (converters.force.bits - 1));
    converters.mounting.force_tare =
        [0, 1].map(|_| ForceCounts((draw(-0.15..0.15) * counts) as i32));
    Ok(scenario)
}
