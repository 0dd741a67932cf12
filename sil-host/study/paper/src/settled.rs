//! Detection of a motion that has ended in permanent sliding.
//!
//! A run may stop early where its rest is certain: the tip slides at rest on a
//! belt of constant speed (θ̇ and θ̈ below 10⁻¹⁰), the equilibrium of the slide is
//! stable with its eigenvalues to the left of −10⁻³ 1/s, and slip, pressure and p are all well away
//! from zero. The state is then within about 10⁻⁷ of the equilibrium, where the linear
//! part outweighs the rest of the equations by orders of magnitude, so that the distance can only
//! shrink.

use nalgebra::{Matrix2, Vector2};
use painleve_plant::State;
use painleve_plant::mechanics::ArmOnBelt;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::motion::{theta, theta_dot};
use painleve_plant::mechanics::transition::event_functions;
use painleve_shared::Pose;

use crate::chaos::tangent::along;

/// Largest rates and accelerations at rest, rad/s and rad/s².
const AT_REST: f64 = 1e-10;

/// Required stability margin: the real parts of the eigenvalues are below minus this, 1/s.
const SLOWEST_DECAY_PER_S: f64 = 1e-3;

/// Required margin of slip (m/s), pressure (m/s²) and p (1/kg) from zero.
const WELL_AWAY: f64 = 1e-3;

/// Whether the plant, without further input, slides permanently where it is.
pub fn has_settled(plant: &ArmOnBelt) -> bool {
    let (mode, state, time_s) = (plant.mode(), plant.state(), plant.time_s());
    let motion = plant.motion();
    let steady_belt = matches!(motion.belt, BeltProfile::Constant { .. });
    if mode.slip().is_none() || !steady_belt || theta_dot(state).amax() > AT_REST {
        return false;
    }
    let slope = motion.derivative(mode, time_s, state);
    if theta_dot(&slope).amax() > AT_REST {
        return false;
    }
    if event_functions(&motion, mode, time_s, state)
        .iter()
        .any(|function| *function < WELL_AWAY)
    {
        return false;
    }
    // At rest on the belt there is one degree of freedom, in which θ̈ = −stiffness·offset −
    // damping·rate.
    let pose = Pose::new(&theta(state));
    let normal = motion.arm.jacobian(&pose).row(1).transpose();
    let tangent = Vector2::new(normal.y, -normal.x).normalize();
    let acceleration_along = |direction: State| {
        let change = along(state, &direction, |x| {
            motion.derivative(mode, time_s, &motion.onto_belt(x))
        });
        tangent.dot(theta_dot(&change).vector())
    };
    let linear = Matrix2::new(
        0.0,
        1.0,
        acceleration_along(State::new(tangent.x, tangent.y, 0.0, 0.0)),
        acceleration_along(State::new(0.0, 0.0, tangent.x, tangent.y)),
    );
    linear
        .complex_eigenvalues()
        .iter()
        .all(|eigenvalue| eigenvalue.re < -SLOWEST_DECAY_PER_S)
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::ContactMode;
    use painleve_plant::belt_line::bisected;
    use painleve_plant::mechanics::PlantParameters;
    use painleve_shared::{Arm, ArmParameters, Posture};

    fn plant(parameters: &PlantParameters, theta1_deg: f64, theta2_deg: f64) -> ArmOnBelt {
        let initial = State::new(theta1_deg.to_radians(), theta2_deg.to_radians(), 0.0, 0.0);
        ArmOnBelt::new(parameters, initial).unwrap()
    }

    #[test]
    fn a_settled_motion_stays_settled_and_settles_only_late() {
        let mut plant = plant(&PlantParameters::default(), -11.4, -35.1);
        plant.advance(5.0, &mut ()).unwrap();
        assert!(!has_settled(&plant));
        while !has_settled(&plant) {
            assert!(plant.time_s() < 200.0);
            plant.advance(plant.time_s() + 1.0, &mut ()).unwrap();
        }
        let before = *plant.state();
        plant.advance(plant.time_s() + 100.0, &mut ()).unwrap();
        assert!((plant.state() - before).amax() < 1e-8);
        assert!(has_settled(&plant));
    }

    #[test]
    fn a_bouncing_arm_never_settles() {
        let mut plant = plant(&PlantParameters::default(), 32.0, 18.27);
        for tenth in 0..300 {
            assert!(!has_settled(&plant));
            plant.advance(0.1 * f64::from(tenth), &mut ()).unwrap();
        }
    }

    /// A stiff spring pushes the arm straight, away on either side from a position in which it
    /// exerts no torque.
    #[test]
    fn rest_on_an_unstable_equilibrium_does_not_count() {
        let parameters = PlantParameters {
            arm: ArmParameters {
                spring_rest_rad: [0.0; 2],
                stiffness_nm_rad: [0.0, 10.0],
                ..Default::default()
            },
            friction: 0.0,
            ..Default::default()
        };
        let at = |tip_t_m: f64| {
            let arm = Arm::new(parameters.arm).unwrap();
            let theta = arm.link_angles_on_belt_rad(tip_t_m, Posture::ElbowUp);
            let theta = theta.unwrap();
            let initial = State::new(theta.first(), theta.second(), 0.0, 0.0);
            let mut plant = ArmOnBelt::new(&parameters, initial).unwrap();
            plant.settle(&mut ()).unwrap();
            assert_eq!(plant.mode(), ContactMode::SlidePositive);
            plant
        };
        let slope = |plant: &ArmOnBelt| {
            let motion = plant.motion();
            theta_dot(&motion.derivative(plant.mode(), 0.0, plant.state()))
        };
        let (lower, upper) = (-0.1, 0.1);
        assert!(slope(&at(lower)).first() < 0.0 && slope(&at(upper)).first() > 0.0);
        let between = bisected(lower, upper, |tip_t_m| slope(&at(tip_t_m)).first() < 0.0);
        let plant = at(between);
        assert!(slope(&plant).amax() < AT_REST, "{:?}", slope(&plant));
        assert!(!has_settled(&plant));
    }
}
