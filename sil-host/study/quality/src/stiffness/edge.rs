//! The farthest tip position on which a pressed tip stays, by trial.

use nalgebra::Vector2;
use painleve_plant::belt_line::BeltLine;
use painleve_plant::{Plant, State};
use painleve_shared::{Arm, GeneralisedTorque, LinkMotion, Pose, Posture, Slip};
use painleve_study_core::StudyError;

use super::Stiffness;

/// Normal force of the static torque, N.
const PRESSED_N: f64 = 10.0;
/// How long the tip must stay, s.
const HELD_S: f64 = 0.02;
/// Nearest place that is tried, as a fraction of the reach, and resolution, m.
const NEAREST: f64 = 0.3;
const FARTHEST: f64 = 0.999;
const RESOLUTION_M: f64 = 1e-5;

impl Stiffness {
    /// Returns the largest tip position at which the tip, pressed by the static torque for 10 N of sliding contact, stays on the
    /// belt, m.
    ///
    /// # Errors
    /// [`StudyError`] if the plant cannot continue.
    pub fn edge_m(&self, stiffness_n_m: Option<f64>, posture: Posture) -> Result<f64, StudyError> {
        let arm = Arm::new(self.parameters.arm)?;
        let reach_m = arm.reach_on_belt_m();
        let (mut holds_m, mut loses_m) = (NEAREST * reach_m, FARTHEST * reach_m);
        while loses_m - holds_m > RESOLUTION_M {
            let tip_t_m = 0.5 * (holds_m + loses_m);
            if self.holds(&arm, stiffness_n_m, posture, tip_t_m)? {
                holds_m = tip_t_m;
            } else {
                loses_m = tip_t_m;
            }
        }
        Ok(holds_m)
    }

    fn holds(
        &self,
        arm: &Arm<f64>,
        stiffness_n_m: Option<f64>,
        posture: Posture,
        tip_t_m: f64,
    ) -> Result<bool, StudyError> {
        let speed_m_s = self.parameters.belt.speed_m_s(0.0);
        let line = BeltLine::new(arm, posture);
        let Some(tau) = line.tau(tip_t_m) else {
            return Ok(false);
        };
        let theta = line.theta_rad(tau);
        let pose = Pose::new(&theta);
        let slip = Slip::of(-speed_m_s);
        let friction_n = -slip.sign::<f64>() * self.parameters.friction * PRESSED_N;
        let contact_n = Vector2::new(friction_n, PRESSED_N);
        // Equilibrium: u = w − Jᵀ f.
        let load = arm.passive_torque_nm(&theta, &LinkMotion::zeros(), &pose)
            - GeneralisedTorque::from_vector(arm.jacobian(&pose).transpose() * contact_n);
        let start = State::new(theta.first(), theta.second(), 0.0, 0.0);
        let mass_kg = self.sticking_mass_kg()?;
        let mut plant = self.plant(stiffness_n_m, speed_m_s, start, mass_kg)?;
        plant.command_torque(load.to_joints(), 0.0);
        let failed = |source| self.failed(stiffness_n_m, source);
        plant.advance(HELD_S, &mut ()).map_err(failed)?;
        Ok(plant.snapshot().mode.is_contact())
    }
}
