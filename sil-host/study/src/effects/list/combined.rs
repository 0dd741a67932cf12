//! Faults of single channels, and many effects together.

use super::{BOTH, COMPLIANT, find};
use crate::effects::effect::{Drawn, RigEffect, set};
use crate::robustness::LiftOffRule;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = &[
    RigEffect {
        name: "force-cell-off",
        key: "converters.faults.normal_force",
        unit: "s, at a random time",
        levels: &[0.002, 0.005, 0.01, 0.02, 0.05],
        typical: 0.005,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| {
            let mut both = fault("normal_force", "off", level, drawn);
            both.extend(fault("tangential_force", "off", level, drawn));
            both
        },
        ..BOTH
    },
    RigEffect {
        name: "force-cell-stuck",
        key: "converters.faults.normal_force",
        unit: "s, at a random time",
        levels: &[0.005, 0.02, 0.05, 0.2],
        typical: 0.02,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| {
            let mut both = fault("normal_force", "stuck", level, drawn);
            both.extend(fault("tangential_force", "stuck", level, drawn));
            both
        },
        ..BOTH
    },
    RigEffect {
        name: "encoder-off",
        key: "converters.faults.encoder_1",
        unit: "s, at a random time",
        levels: &[0.002, 0.005, 0.01, 0.02],
        typical: 0.005,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| fault(drawn.joint("encoder_1", "encoder_2"), "off", level, drawn),
        ..BOTH
    },
    RigEffect {
        name: "encoder-stuck",
        key: "converters.faults.encoder_1",
        unit: "s, at a random time",
        levels: &[0.002, 0.005, 0.01, 0.02, 0.05],
        typical: 0.005,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| {
            fault(drawn.joint("encoder_1", "encoder_2"), "stuck", level, drawn)
        },
        ..BOTH
    },
    RigEffect {
        name: "torque-off",
        key: "converters.faults.torque_1",
        unit: "s, at a random time",
        levels: &[0.002, 0.005, 0.01, 0.02, 0.05],
        typical: 0.005,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| fault(drawn.joint("torque_1", "torque_2"), "off", level, drawn),
        ..BOTH
    },
    RigEffect {
        name: "torque-stuck",
        key: "converters.faults.torque_1",
        unit: "s, at a random time",
        levels: &[0.005, 0.01, 0.02, 0.05, 0.1],
        typical: 0.01,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| fault(drawn.joint("torque_1", "torque_2"), "stuck", level, drawn),
        ..BOTH
    },
    RigEffect {
        name: "everything",
        key: "all of the keys above but contact, model and faults",
        unit: "of the typical levels",
        levels: &[0.25, 0.5, 1.0, 2.0],
        typical: 1.0,
        lift_offs: LiftOffRule::Counted,
        overrides: everything,
        ..COMPLIANT
    },
];

/// A fault of a channel that begins at a random time and lasts for `duration_s`.
fn fault(channel: &str, kind: &str, duration_s: f64, drawn: &Drawn) -> Vec<String> {
    let (from_s, until_s) = (drawn.at_s, drawn.at_s + duration_s);
    set![
        "converters.faults.{channel}={{ kind = '{kind}', from_s = {from_s:?}, until_s = {until_s:?} }}"
    ]
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
        .flat_map(|effect| (effect.overrides)(share * effect.typical, drawn))
        .collect()
}
