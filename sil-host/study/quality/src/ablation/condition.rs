//! The conditions under which parts are switched off.

use painleve_plant::scenario::Scenario;
use painleve_study_core::StudyError;
use painleve_study_core::case::ControllerChoice;
use serde::Serialize;

use crate::capture::{self, Capture};
use crate::effects::{self, Contact, EffectsStudy};
use crate::robustness::{self, Arms, Criterion, LiftOffRule, Robustness};

/// A kind of random closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// The robustness campaign on rigid contact: errors of the arm that the controller does not know.
    Rigid,
    /// The same on a compliant contact of 10⁵ N/m.
    Compliant,
    /// A known arm on 10⁴ N/m with 0.15 of critical damping.
    Soft,
    /// A known arm on a belt that hangs: 20 g on 3·10⁴ N/m.
    Hanging,
    /// A known arm on patches of μ ± 0.1.
    Patches,
    /// A known arm with the effects of `everything` at half of their typical level.
    Half,
    /// An arm that bounces until the controller is switched on.
    Capture,
}

impl Condition {
    /// The keys that the condition sets in every run.
    pub fn fixed_keys(self) -> &'static [&'static str] {
        match self {
            Self::Rigid | Self::Compliant => &robustness::FIXED,
            Self::Soft | Self::Hanging | Self::Patches | Self::Half => &effects::FIXED,
            Self::Capture => &capture::FIXED,
        }
    }

    /// Returns the scenario of run `index`, and how its lift-offs are judged.
    ///
    /// # Errors
    /// [`StudyError`] if an override is invalid.
    pub fn scenario(
        self,
        seed: u64,
        index: usize,
        overrides: &[String],
    ) -> Result<(Scenario, LiftOffRule), StudyError> {
        let with = |more: &[&str]| {
            let first = more.iter().map(ToString::to_string);
            first.chain(overrides.iter().cloned()).collect()
        };
        let robustness = |overrides| {
            let campaign = Robustness {
                arms: Arms::Paper,
                seed,
                criterion: Criterion::Kept,
                runs: 1,
                overrides,
            };
            Ok((campaign.scenario(index)?, LiftOffRule::Fail))
        };
        let effect = |name, level, overrides| {
            let study = EffectsStudy {
                controllers: vec![ControllerChoice::Hybrid],
                contacts: vec![Contact::Compliant],
                effects: vec![name],
                levels: vec![level],
                seed,
                criterion: Criterion::Kept,
                runs: 1,
                overrides,
            };
            let cell = study.cells()[0];
            Ok((study.scenario(cell, index)?, cell.effect.lift_offs))
        };
        match self {
            Self::Rigid => robustness(with(&[])),
            Self::Compliant => robustness(with(&["contact.kind=compliant"])),
            Self::Soft => effect(
                "softer-contact",
                1e4,
                with(&["contact.normal.kelvin-voigt.damping_ns_m=6"]),
            ),
            Self::Hanging => effect("hanging-belt", 3e4, with(&[])),
            Self::Patches => effect("friction-patches", 0.1, with(&[])),
            Self::Half => effect("everything", 0.5, with(&[])),
            Self::Capture => {
                let study = Capture {
                    seed,
                    runs: 1,
                    overrides: with(&[]),
                };
                Ok((study.scenario(index)?, LiftOffRule::Fail))
            }
        }
    }
}
