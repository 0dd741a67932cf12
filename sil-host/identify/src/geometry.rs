//! The tip and its distance from the line, as functions of the encoders' angles and the parameters.

use painleve_shared::Posture;

use crate::parameters::{Parameter, Parameters, Values};

/// Corrections of a correction: each makes its error smaller by the slope of an encoder's error.
const ITERATIONS: usize = 6;

/// Number of places at which a stretch is sampled.
const PLACES: usize = 41;

/// The stretch of the belt along which the tip slid in a posture, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The posture.
    pub posture: Posture,
    /// Smallest z_t.
    pub from_m: f64,
    /// Largest z_t.
    pub to_m: f64,
}

impl Range {
    /// Returns positions evenly along the stretch, m.
    pub fn places_m(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { from_m, to_m, .. } = *self;
        let step_m = (to_m - from_m) / (PLACES - 1) as f64;
        (0..PLACES).map(move |index| from_m + step_m * index as f64)
    }
}

/// The arm in one posture, by the parameters, with derivatives after each of them.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// l1 cos θ1 + l2 cos θ2 − H, m: how far the tip is inside the belt.
    pub depth_m: f64,
    /// Its derivatives.
    pub depth_by: Values,
    /// Position along the belt, m.
    pub tip_t_m: f64,
    /// Its derivatives.
    pub tip_by: Values,
    /// Derivatives of the depth after the angles of both joints, m/rad.
    pub depth_by_joint: [f64; 2],
    /// The same of the position along the belt.
    pub tip_by_joint: [f64; 2],
    /// How much each joint turns for its encoder.
    pub joint_by_encoder: [f64; 2],
}

/// Returns the angle of a joint, rad, from that of its encoder.
pub fn joint_rad(parameters: &Parameters, joint: usize, encoder_rad: f64) -> f64 {
    let mut angle = encoder_rad;
    for _ in 0..ITERATIONS {
        angle = encoder_rad + correction_rad(parameters, joint, angle);
    }
    angle
}

/// Returns the angle of an encoder, rad, from that of its joint.
pub fn encoder_rad(parameters: &Parameters, joint: usize, joint_rad: f64) -> f64 {
    joint_rad - correction_rad(parameters, joint, joint_rad)
}

/// What is added to an encoder's angle at an angle of the joint, rad, as the controller adds it.
fn correction_rad(parameters: &Parameters, joint: usize, angle: f64) -> f64 {
    basis(joint, angle)
        .into_iter()
        .map(|(parameter, value)| value * parameters.get(parameter))
        .sum()
}

/// Returns how much a joint turns for its encoder, at an angle of the joint, rad.
fn joint_by_encoder(parameters: &Parameters, joint: usize, angle: f64) -> f64 {
    let [
        _,
        (_, sine),
        (_, cosine),
        (_, second_sine),
        (_, second_cosine),
    ] = basis(joint, angle);
    let of = |parameter: Parameter| parameters.get(parameter);
    let slope = of(Parameter::Sine(joint)) * cosine - of(Parameter::Cosine(joint)) * sine
        + 2.0 * of(Parameter::SecondSine(joint)) * second_cosine
        - 2.0 * of(Parameter::SecondCosine(joint)) * second_sine;
    1.0 / (1.0 - slope)
}

fn basis(joint: usize, angle: f64) -> [(Parameter, f64); 5] {
    let (sine, cosine) = libm::sincos(angle);
    [
        (Parameter::Zero(joint), 1.0),
        (Parameter::Sine(joint), sine),
        (Parameter::Cosine(joint), cosine),
        (Parameter::SecondSine(joint), 2.0 * sine * cosine),
        (Parameter::SecondCosine(joint), 1.0 - 2.0 * sine * sine),
    ]
}

impl Place {
    /// Evaluates the arm at angles of its encoders, rad.
    pub fn at(parameters: &Parameters, encoders_rad: [f64; 2]) -> Self {
        let joints = [0, 1].map(|joint| joint_rad(parameters, joint, encoders_rad[joint]));
        let [length_1, length_2] = parameters.link_length_m();
        let ratio = parameters.get(Parameter::Ratio);
        let (sine_1, cosine_1) = libm::sincos(joints[0]);
        let (sine_2, cosine_2) = libm::sincos(joints[0] + joints[1]);
        let tip_t_m = length_1 * sine_1 + length_2 * sine_2;
        let reach_m = length_1 * cosine_1 + length_2 * cosine_2;
        let depth_by_joint = [-tip_t_m, -length_2 * sine_2];
        let tip_by_joint = [reach_m, length_2 * cosine_2];
        let joint_by_encoder =
            [0, 1].map(|joint| joint_by_encoder(parameters, joint, joints[joint]));
        let (mut depth_by, mut tip_by) = (Values::zeros(), Values::zeros());
        for joint in 0..2 {
            for (parameter, value) in basis(joint, joints[joint]) {
                // A joint turns for what is added as it does for its encoder.
                let turns = joint_by_encoder[joint] * value;
                depth_by[parameter.index()] = depth_by_joint[joint] * turns;
                tip_by[parameter.index()] = tip_by_joint[joint] * turns;
            }
        }
        let mut by = |parameter: Parameter, depth: f64, tip: f64| {
            depth_by[parameter.index()] = depth;
            tip_by[parameter.index()] = tip;
        };
        by(
            Parameter::Length,
            cosine_1 + ratio * cosine_2,
            sine_1 + ratio * sine_2,
        );
        by(Parameter::Ratio, length_1 * cosine_2, length_1 * sine_2);
        by(Parameter::Height, -1.0, 0.0);
        Self {
            depth_m: reach_m - parameters.get(Parameter::Height),
            depth_by,
            tip_t_m,
            tip_by,
            depth_by_joint,
            tip_by_joint,
            joint_by_encoder,
        }
    }

    /// Returns how both joints turn when the tip moves into the belt, at the same place along it, rad/m.
    pub fn across_rad_m(&self) -> [f64; 2] {
        let ([depth_1, depth_2], [tip_1, tip_2]) = (self.depth_by_joint, self.tip_by_joint);
        let determinant = depth_1 * tip_2 - depth_2 * tip_1;
        [tip_2 / determinant, -tip_1 / determinant]
    }

    /// Evaluates the arm with its tip on the belt at z_t (m) in a posture; `None` out of reach.
    pub fn on_belt(parameters: &Parameters, posture: Posture, tip_t_m: f64) -> Option<Self> {
        let height = parameters.get(Parameter::Height);
        let [length_1, length_2] = parameters.link_length_m();
        let distance = libm::hypot(tip_t_m, height);
        let shift = (length_1 - length_2) * (length_1 + length_2) / distance;
        let angle_1 = libm::acos((distance + shift) / (2.0 * length_1));
        let angle_2 = libm::acos((distance - shift) / (2.0 * length_2));
        if (angle_1 + angle_2).is_nan() {
            return None;
        }
        let direction = libm::atan2(tip_t_m, height);
        let side = match posture {
            Posture::ElbowUp => -1.0,
            Posture::ElbowDown => 1.0,
        };
        let joints = [direction + side * angle_1, -side * (angle_1 + angle_2)];
        let encoders = [0, 1].map(|joint| encoder_rad(parameters, joint, joints[joint]));
        Some(Self::at(parameters, encoders))
    }
}

/// Returns the largest |z_t| on the belt, m.
pub fn reach_m(parameters: &Parameters) -> f64 {
    let [length_1, length_2] = parameters.link_length_m();
    let (sum, height) = (length_1 + length_2, parameters.get(Parameter::Height));
    libm::sqrt((sum - height) * (sum + height))
}

/// Returns the derivatives of [`reach_m`].
pub fn reach_by(parameters: &Parameters) -> Values {
    let [length_1, length_2] = parameters.link_length_m();
    let (sum, height) = (length_1 + length_2, parameters.get(Parameter::Height));
    let reach = reach_m(parameters);
    let mut by = Values::zeros();
    by[Parameter::Length.index()] = sum / reach * (sum / length_1);
    by[Parameter::Ratio.index()] = sum / reach * length_1;
    by[Parameter::Height.index()] = -height / reach;
    by
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        fn arm()(
            zeros in [-0.05_f64..0.05, -0.05..0.05],
            harmonics in [-0.01_f64..0.01, -0.01..0.01, -0.01..0.01, -0.01..0.01],
            second in [-0.003_f64..0.003, -0.003..0.003, -0.003..0.003, -0.003..0.003],
            ratio in 0.7_f64..1.4, height in 0.82_f64..0.93,
        ) -> Parameters {
            let mut parameters = Parameters::of_arm([0.21, 0.21 * ratio], height * 0.21 * (1.0 + ratio));
            for (index, value) in zeros.into_iter().chain(harmonics).chain(second).enumerate() {
                parameters.0[index] = value;
            }
            parameters
        }
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_the_values(
            parameters in arm(), first in -1.0_f64..1.0, elbow in -1.5_f64..1.5,
        ) {
            let place = Place::at(&parameters, [first, elbow]);
            for index in 0..crate::parameters::COUNT {
                let step = 1e-6;
                let at = |sign: f64| {
                    let mut moved = parameters;
                    moved.0[index] += sign * step;
                    (Place::at(&moved, [first, elbow]), reach_m(&moved))
                };
                let ((plus, far), (minus, near)) = (at(1.0), at(-1.0));
                let close = |found: f64, two: f64| (found - two / (2.0 * step)).abs() < 1e-5;
                prop_assert!(close(place.depth_by[index], plus.depth_m - minus.depth_m), "{index}");
                prop_assert!(close(place.tip_by[index], plus.tip_t_m - minus.tip_t_m), "{index}");
                prop_assert!(close(reach_by(&parameters)[index], far - near), "{index}");
            }
            for joint in [0, 1] {
                let at = |step: f64| joint_rad(&parameters, joint, elbow + step);
                let turned = (at(1e-4) - at(-1e-4)) / 2e-4;
                let found = joint_by_encoder(&parameters, joint, at(0.0));
                prop_assert!((found - turned).abs() < 1e-6, "joint {joint}: {found}, {turned}");
            }
        }

        #[test]
        fn a_tip_on_the_belt_is_on_it_and_where_it_should_be(
            parameters in arm(), share in -0.9_f64..0.9, up: bool,
        ) {
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let tip = share * reach_m(&parameters);
            let place = Place::on_belt(&parameters, posture, tip).unwrap();
            prop_assert!(place.depth_m.abs() < 1e-9, "{}", place.depth_m);
            prop_assert!((place.tip_t_m - tip).abs() < 1e-8, "{}", place.tip_t_m);
        }
    }
}
