//! What the paper says, to be set beside what is computed. Only for its own arm and
//! parameters; for anything else there is no paper's value.

use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::Scenario;
use painleve_shared::{ArmParameters, Posture};

use super::case::Controller;

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
        (Controller::Scenario(_), _) => return None,
        (Controller::Pid, Posture::ElbowUp) => None,
        _ => Some(target_m(controller, posture)),
    };
    of_paper.then_some(value)
}

/// The farthest target that the paper shows for a law in a posture, m; for the PID elbow
/// up, which never slides, the same as elbow down.
pub fn target_m(controller: &Controller, posture: Posture) -> f64 {
    match (controller, posture) {
        (Controller::Pid, _) => 0.0375,
        (_, Posture::ElbowDown) => 0.148,
        (_, Posture::ElbowUp) => 0.163,
    }
}

/// What the paper's Fig. 12 says of a law and an initial condition.
pub fn closed_loop_bounces(controller: &Controller, initial: &str) -> Option<&'static str> {
    match controller {
        Controller::Hybrid | Controller::HybridPaper | Controller::HybridPaperModel
            if initial == "d" =>
        {
            Some("never bounces")
        }
        _ => None,
    }
}
