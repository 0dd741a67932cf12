//! Faults of single channels, and many effects together.

use super::{BOTH, find};
use crate::effects::effect::LevelOverrides::Computed;
use crate::effects::effect::{Drawn, RigEffect, effects, set};
use crate::robustness::LiftOffRule;

/// An effect whose lift-offs are counted.
const COUNTED: RigEffect = RigEffect {
    lift_offs: LiftOffRule::Counted,
    ..BOTH
};

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = effects! {
    ..COUNTED;

    "force-cell-off": "converters.faults.normal_force", "s, at a random time",
        [0.002, 0.005, 0.01, 0.02, 0.05], typical 0.005,
        overrides: Computed(|level, drawn| force_cell_fault("off", level, drawn));

    "force-cell-stuck": "converters.faults.normal_force", "s, at a random time",
        [0.005, 0.02, 0.05, 0.2], typical 0.02,
        overrides: Computed(|level, drawn| force_cell_fault("stuck", level, drawn));

    "encoder-off": "converters.faults.encoder_1", "s, at a random time",
        [0.002, 0.005, 0.01, 0.02], typical 0.005,
        overrides: Computed(|level, drawn| encoder_fault("off", level, drawn));

    "encoder-stuck": "converters.faults.encoder_1", "s, at a random time",
        [0.002, 0.005, 0.01, 0.02, 0.05], typical 0.005,
        overrides: Computed(|level, drawn| encoder_fault("stuck", level, drawn));

    "torque-off": "converters.faults.torque_1", "s, at a random time",
        [0.002, 0.005, 0.01, 0.02, 0.05], typical 0.005,
        overrides: Computed(|level, drawn| torque_fault("off", level, drawn));

    "torque-stuck": "converters.faults.torque_1", "s, at a random time",
        [0.005, 0.01, 0.02, 0.05, 0.1], typical 0.01,
        overrides: Computed(|level, drawn| torque_fault("stuck", level, drawn));

    "everything": "many of the effects above at once", "of the typical levels",
        [0.25, 0.5, 1.0, 2.0], typical 1.0,
        compliant_only: true,
        largest_friction: Some(largest_friction_of_everything),
        overrides: Computed(everything);
};

/// A fault of a channel that begins at a random time and lasts for `duration_s`.
fn fault(channel: &str, kind: &str, duration_s: f64, drawn: &Drawn) -> Vec<String> {
    let (from_s, until_s) = (drawn.at_s, drawn.at_s + duration_s);
    set![
        "converters.faults.{channel}={{ kind = '{kind}', from_s = {from_s:?}, until_s = {until_s:?} }}"
    ]
}

/// A fault of both axes of the force cell; see [`fault`].
fn force_cell_fault(kind: &str, duration_s: f64, drawn: &Drawn) -> Vec<String> {
    ["normal_force", "tangential_force"]
        .iter()
        .flat_map(|channel| fault(channel, kind, duration_s, drawn))
        .collect()
}

/// A fault of the encoder of either joint; see [`fault`].
fn encoder_fault(kind: &str, duration_s: f64, drawn: &Drawn) -> Vec<String> {
    fault(
        drawn.joint("encoder_1", "encoder_2"),
        kind,
        duration_s,
        drawn,
    )
}

/// A fault of the torque of either joint; see [`fault`].
fn torque_fault(kind: &str, duration_s: f64, drawn: &Drawn) -> Vec<String> {
    fault(drawn.joint("torque_1", "torque_2"), kind, duration_s, drawn)
}

/// Largest friction coefficient with the patches of [`everything`].
fn largest_friction_of_everything(share: f64, friction: f64) -> f64 {
    find("friction-patches")
        .and_then(|patches| Some(patches.largest_friction?(share * patches.typical, friction)))
        .unwrap_or(friction)
}

/// Effects of a rig together, each at this share of its typical level.
fn everything(share: f64, drawn: &Drawn) -> Vec<String> {
    const TOGETHER: [&str; 23] = [
        "friction-patches",
        "waviness",
        "seam",
        "vibration",
        "joint-friction",
        "joint-damping",
        "backlash",
        "push-along",
        "payload",
        "torque-pulse",
        "force-noise",
        "force-bias",
        "force-drift",
        "force-gain",
        "force-cross-talk",
        "encoder-eccentricity",
        "encoder-offset",
        "torque-gain",
        "torque-ripple",
        "torque-cogging",
        "torque-dead-zone",
        "tick-jitter",
        "frame-loss",
    ];
    let effects = TOGETHER.iter().filter_map(|name| find(name));
    effects
        .flat_map(|effect| effect.overrides(share * effect.typical, drawn))
        .collect()
}
