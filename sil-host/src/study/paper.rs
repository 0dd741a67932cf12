//! What the paper says, to be set beside what is computed. Only for its own arm and
//! parameters; for anything else there is no paper's value.

use painleve_shared::{ArmParameters, Posture};

use super::case::Controller;
use crate::plant::belt::BeltProfile;
use crate::scenario::Scenario;

/// Friction coefficient of the paper's sections.
pub const FRICTION: f64 = 0.6;

/// Belt speeds at which the arm keeps bouncing (Fig. 4), m/s.
pub const BOUNCING_M_S: [f64; 2] = [-0.575, -0.3];

/// Table II: where p > 0, m.
pub fn admissible_m(arm: &ArmParameters<f64>, mu: f64, posture: Posture) -> Option<[f64; 2]> {
    let upper = match posture {
        Posture::ElbowUp => 0.183,
        Posture::ElbowDown => 0.168,
    };
    (*arm == ArmParameters::default() && mu == FRICTION).then_some([-0.184, upper])
}

/// The least friction with bounces in the paper's bifurcation diagram.
pub fn critical_friction(arm: &ArmParameters<f64>) -> Option<f64> {
    (*arm == ArmParameters::default()).then_some(0.4)
}

/// Section III: Z_t,sliding of a law in a posture, m. `Some(None)` where the paper found
/// no gains that slide, `None` where it does not say.
pub fn sliding_m(
    scenario: &Scenario,
    controller: &Controller,
    posture: Posture,
) -> Option<Option<f64>> {
    let of_paper = scenario.arm == ArmParameters::default()
        && scenario.belt.friction == FRICTION
        && scenario.belt.profile == BeltProfile::default();
    let value = match (controller, posture) {
        (Controller::Pid, Posture::ElbowDown) => Some(0.0375),
        (Controller::Pid, Posture::ElbowUp) => None,
        (Controller::Scenario(_), _) => return None,
        (_, Posture::ElbowDown) => Some(0.148),
        (_, Posture::ElbowUp) => Some(0.163),
    };
    of_paper.then_some(value)
}
