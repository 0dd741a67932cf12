//! How well the controller works, beyond the paper.
//!
//! - [`robustness`]: random arms, belts and converters; [`ablation`]: the contribution of each part of the controller
//! - [`effects`]: success against the level of each effect of a real rig, on rigid and compliant contact
//! - [`stiffness`]: the compliant contact as it gets stiffer, beside the rigid one
//! - [`ringing`]: where the friction observer makes a compliant contact ring, beside the stability limit
//! - [`loop_margins`]: the sampled loop in the frequency domain, from finite differences and from injected sines
//! - [`capture`]: capture of a bouncing arm; [`lift_off`]: detection time of a lift-off
//! - [`tuning`]: a search for settings of a scenario
//! - [`contact_probe`], [`distribution`], [`proportion`], [`paired_difference`]: contact, distributions and success rates

pub mod ablation;
pub mod capture;
pub mod contact_probe;
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
    outcome.table().force_no_tty().to_string()
}
