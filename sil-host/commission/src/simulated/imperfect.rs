//! Arms as bad as life: errors of a rig that its scenario does not know.

use core::f64::consts::PI;

use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, ArmParameters, OutOfRange, Posture};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Returns the scenario with an arm that differs from what its controller knows. Uniformly: zeros by 3° (a plumb line
/// held by hand, and the magnet), errors of an AS5048A once (0.3°) and twice around (0.1°), the second link by 1 % and the
/// first, which has been measured, by 0.05 %, the belt's height by 3 mm and its tilt by 2°, springs by 10 %, joint
/// friction of 0.02 … 0.1 N·m of which nothing is known, stages by 10 % and their limits by 20 %, force cell by 3 % of gain and cross-talk; waves of the belt of
/// 0.1 mm and a seam of 0.2 mm, on a contact of 1e5 N/m.
///
/// # Errors
/// [`OutOfRange`] if the arm does not reach its belt.
pub fn imperfect(scenario: &Scenario, seed: u64) -> Result<Scenario, OutOfRange> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let mut draw = |most: f64| generator.random_range(-most..=most);
    let mut actual = scenario.clone();
    actual.arm_model = Some(scenario.controller_configuration().arm);
    let [length_1, length_2] = scenario.arm.link_length_m;
    let stiffness = scenario.arm.stiffness_nm_rad;
    actual.arm = ArmParameters {
        link_length_m: [length_1 * (1.0 + draw(5e-4)), length_2 * (1.0 + draw(0.01))],
        height_m: scenario.arm.height_m + draw(0.003),
        belt_tilt_rad: scenario.arm.belt_tilt_rad + draw(2.0_f64.to_radians()),
        stiffness_nm_rad: stiffness.map(|it| it * (1.0 + draw(0.1))),
        ..scenario.arm
    };
    let encoder = &mut actual.converters.encoder;
    encoder.mounting_error_rad = [draw(0.052), draw(0.052)];
    encoder.eccentricity_rad = [draw(0.0052).abs(), draw(0.0052).abs()];
    encoder.eccentricity_phase_rad = [draw(PI), draw(PI)];
    encoder.second_harmonic_rad = [draw(0.00175).abs(), draw(0.00175).abs()];
    encoder.second_harmonic_phase_rad = [draw(PI), draw(PI)];
    actual.converters.torque.error.gain = [draw(0.1), draw(0.1)];
    actual.converters.force.cross_talk = [draw(0.03), draw(0.03)];
    actual.converters.force.gain_error = [draw(0.03), draw(0.03)];
    actual.contact.kind = painleve_plant::mechanics::compliant::ContactKind::Compliant;
    actual.effects.joints.coulomb_nm = 0.06 + draw(0.04);
    actual.effects.joints.static_ratio = 1.2;
    actual.effects.surface.waviness_m = 1e-4;
    actual.effects.surface.seam_height_m = 2e-4;
    let limit_nm = f64::from(scenario.controller.torque_limit_nm);
    let torque_error = &mut actual.converters.torque.error;
    torque_error.limit_nm = Some([0, 1].map(|_| limit_nm * (1.0 + draw(0.2))));
    actual.run.seed = seed;
    set_down(scenario, &mut actual)?;
    Ok(actual)
}

/// Sets the arm down where the tip of the scenario's arm is.
fn set_down(scenario: &Scenario, actual: &mut Scenario) -> Result<(), OutOfRange> {
    let theta = theta(&scenario.initial.state(&scenario.arm)?);
    let tip_t_m = Arm::new(scenario.arm)?.tip_m(&Pose::new(&theta)).x;
    let arm = Arm::new(actual.arm)?;
    if let Some(there) = arm.link_angles_on_belt_rad(tip_t_m, Posture::of(&theta)) {
        let [theta_1, theta_2] = there.to_array().map(f64::to_degrees);
        actual.initial = InitialState::at_rest(theta_1, theta_2);
    }
    Ok(())
}
