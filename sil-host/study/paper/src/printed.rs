//! The paper's values, for comparison with the computed ones. They hold only for its own arm and
//! parameters.

use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::Scenario;
use painleve_shared::{ArmParameters, Posture, Slip};
use painleve_study_core::case::ControllerChoice;
use painleve_study_core::initial::Initial;

/// Friction coefficient of the paper's sections.
pub const FRICTION: f64 = 0.6;

/// Belt speeds at which the arm keeps bouncing (Fig. 4), m/s.
pub const BOUNCING_M_S: [f64; 2] = [-0.575, -0.3];

/// Table II: the interval of z_t with p > 0, m.
pub fn admissible_m(
    arm: &ArmParameters<f64>,
    mu: f64,
    posture: Posture,
    slip: Slip,
) -> Option<[f64; 2]> {
    let upper = match posture {
        Posture::ElbowUp => 0.183,
        Posture::ElbowDown => 0.168,
    };
    let of_paper = *arm == ArmParameters::default() && mu == FRICTION && slip == Slip::Positive;
    of_paper.then_some([-0.184, upper])
}

/// Smallest friction coefficient with bouncing in the paper's bifurcation diagram.
pub fn critical_friction(arm: &ArmParameters<f64>) -> Option<f64> {
    (*arm == ArmParameters::default()).then_some(0.4)
}

/// Section III: Z_t,sliding of a law in a posture, m. `Some(None)` if the paper found
/// no gains that slide, `None` if it gives no value.
pub fn sliding_m(
    scenario: &Scenario,
    controller: &ControllerChoice,
    posture: Posture,
) -> Option<Option<f64>> {
    let of_paper = scenario.arm == ArmParameters::default()
        && scenario.belt.friction == FRICTION
        && scenario.belt.profile == BeltProfile::default();
    let value = match (controller, posture) {
        (ControllerChoice::Scenario(_), _) => return None,
        (ControllerChoice::Pid, Posture::ElbowUp) => None,
        _ => Some(target_m(controller, posture)),
    };
    of_paper.then_some(value)
}

/// Returns the farthest target that the paper shows for a law in a posture, m; for the PID elbow
/// up, which never slides, that of elbow down.
pub fn target_m(controller: &ControllerChoice, posture: Posture) -> f64 {
    match (controller, posture) {
        (ControllerChoice::Pid, _) => 0.0375,
        (_, Posture::ElbowDown) => 0.148,
        (_, Posture::ElbowUp) => 0.163,
    }
}

/// Returns the paper's Fig. 12 result for a law, an initial condition and a target (m).
pub fn closed_loop_bounces(
    scenario: &Scenario,
    controller: &ControllerChoice,
    initial: Initial,
    towards_m: f64,
) -> Option<&'static str> {
    let of_paper = scenario.arm == ArmParameters::default()
        && scenario.belt.friction == FRICTION
        && initial == Initial::D
        && towards_m == target_m(controller, Posture::ElbowDown);
    match controller {
        ControllerChoice::Hybrid
        | ControllerChoice::HybridPaper
        | ControllerChoice::HybridPaperModel => of_paper.then_some("never bounces"),
        ControllerChoice::Pid | ControllerChoice::Scenario(_) => None,
    }
}

/// Why the sampled law of the paper differs from the continuous one.
pub const SAMPLED_FRICTION: &str = "hybrid-paper is the paper's law, sampled: the friction \
    that it feeds forward is that of the last sample, which closes a loop of gain −μ Q₁₂/p per sample. It \
    diverges at any rate of sampling where |μ Q₁₂| > p: elbow down near the edge, elbow up over much of the \
    way. hybrid-paper-model takes the friction of a known belt instead, which is what the continuous law is \
    where its algebraic loop is solved at every instant; hybrid is the built-in law.";
