//! How well the controller works, beyond the paper.
//!
//! - [`robustness`]: random arms, belts and converters; [`ablation`]: the contribution of each part of the controller
//! - [`effects`]: success against the level of each effect of a real rig, on rigid and compliant contact
//! - [`stiffness`]: the compliant contact as it gets stiffer, beside the rigid one
//! - [`ringing`]: where the friction observer makes a compliant contact ring, beside the stability limit
//! - [`loop_margins`]: the sampled loop in the frequency domain, from finite differences and from injected sines
//! - [`capture`]: capture of a bouncing arm; [`lift_off`]: detection time of a lift-off
//! - [`tuning`]: a search for settings of a scenario
//! - [`distribution`], [`proportion`], [`paired_difference`]: distributions and success rates
//!
//! Every closed-loop study also runs with a plant of your own:
//!
//! ```
//! use painleve_plant::mechanics::BuiltInPlant;
//! use painleve_plant::scenario::Scenario;
//! use painleve_plant::{Plant, PlantError, Probe, Snapshot};
//! use painleve_shared::JointTorque;
//! use painleve_shared::range::OutOfRange;
//! use painleve_study_core::loop_study::OnPlant;
//! use painleve_study_quality::robustness::{Arms, Criterion, Robustness};
//!
//! /// The arm with motors that give 2 % less torque than commanded.
//! struct WeakMotors(BuiltInPlant);
//!
//! impl WeakMotors {
//!     fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
//!         BuiltInPlant::new(scenario).map(Self)
//!     }
//! }
//!
//! impl Plant for WeakMotors {
//!     fn snapshot(&self) -> Snapshot {
//!         self.0.snapshot()
//!     }
//!
//!     fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
//!         self.0.command_torque(target_nm * 0.98, lag_s);
//!     }
//!
//!     fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError> {
//!         self.0.advance(until_s, probe)
//!     }
//! }
//!
//! let campaign = Robustness {
//!     arms: Arms::Paper,
//!     seed: 1,
//!     criterion: Criterion::Kept,
//!     runs: 2,
//!     overrides: Vec::new(),
//! };
//! let study = OnPlant { study: campaign, plants: WeakMotors::new };
//! let rows = painleve_study_core::rows(&study, || ())?;
//! assert!(rows.iter().all(|row| row.ending.is_kept()));
//! # Ok::<(), painleve_study_core::StudyError>(())
//! ```

pub mod ablation;
pub mod capture;
pub mod distribution;
pub mod effects;
pub mod lift_off;
pub mod loop_margins;
pub mod paired_difference;
pub mod proportion;
pub mod ringing;
pub mod robustness;
pub mod stiffness;
pub mod tuning;

/// The table as it is without a terminal, for snapshots.
#[cfg(test)]
fn plain(outcome: &impl painleve_study_core::Outcome) -> String {
    outcome.table().to_string()
}
