//! Encoders, force cell, torque stages, ticks and frames.

use core::f64::consts::PI;

use super::BOTH;
use crate::effects::effect::{RigEffect, set};
use crate::robustness::LiftOffRule;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = &[
    RigEffect {
        name: "torque-pulse",
        key: "converters.torque.error.pulse_nm",
        unit: "N·m for 5 ms on either joint",
        levels: &[0.1, 0.2, 0.5, 1.0],
        typical: 0.2,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| {
            let at_s = drawn.at_s;
            let level = level.copysign(drawn.phase_rad - PI);
            let pulse = if drawn.share < 0.5 {
                [level, 0.0]
            } else {
                [0.0, level]
            };
            set![
                "converters.torque.error.pulse_nm={pulse:?}",
                "converters.torque.error.pulse_at_s={at_s:?}"
            ]
        },
        ..BOTH
    },
    RigEffect {
        name: "force-noise",
        key: "converters.force.noise_n",
        unit: "N",
        levels: &[0.05, 0.1, 0.2, 0.5, 1.0],
        typical: 0.1,
        overrides: |level, _| set!["converters.force.noise_n={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "force-resolution",
        key: "converters.force.bits",
        unit: "bits",
        levels: &[10.0, 8.0, 6.0],
        typical: 10.0,
        overrides: |level, _| set!["converters.force.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "force-bias",
        key: "converters.force.bias_n",
        unit: "N in either axis",
        levels: &[0.1, 0.2, 0.5, 1.0, 2.0],
        typical: 0.2,
        overrides: |level, drawn| {
            let [t, n] = drawn.signs(level);
            set!["converters.force.bias_n=[{t:?}, {n:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "force-drift",
        key: "converters.force.drift_n_s",
        unit: "N/s in either axis",
        levels: &[0.01, 0.05, 0.1, 0.2],
        typical: 0.01,
        overrides: |level, drawn| {
            let [t, n] = drawn.signs(level);
            set!["converters.force.drift_n_s=[{t:?}, {n:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "force-gain",
        key: "converters.force.gain_error",
        levels: &[0.05, 0.1, 0.2, 0.5],
        typical: 0.05,
        overrides: |level, drawn| {
            let [t, n] = drawn.signs(level);
            set!["converters.force.gain_error=[{t:?}, {n:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "force-cross-talk",
        key: "converters.force.cross_talk",
        levels: &[0.02, 0.05, 0.1, 0.2],
        typical: 0.02,
        overrides: |level, drawn| {
            let [t, n] = drawn.signs(level);
            set!["converters.force.cross_talk=[{t:?}, {n:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "force-low-pass",
        key: "converters.force.low_pass_s",
        unit: "s",
        levels: &[1e-3, 2e-3, 5e-3, 1e-2],
        typical: 1e-3,
        overrides: |level, _| set!["converters.force.low_pass_s={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "force-delay",
        key: "converters.force.delay_ticks",
        unit: "ticks",
        levels: &[1.0, 2.0, 4.0, 8.0],
        typical: 1.0,
        overrides: |level, _| set!["converters.force.delay_ticks={level}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-eccentricity",
        key: "converters.encoder.eccentricity_rad",
        unit: "rad",
        levels: &[5e-4, 1e-3, 2e-3, 5e-3, 1e-2],
        typical: 1e-3,
        overrides: |level, drawn| {
            let phase_rad = drawn.phase_rad - PI;
            set![
                "converters.encoder.eccentricity_rad=[{level:?}, {level:?}]",
                "converters.encoder.eccentricity_phase_rad=[{phase_rad:?}, {phase_rad:?}]"
            ]
        },
        ..BOTH
    },
    RigEffect {
        name: "encoder-offset",
        key: "converters.encoder.mounting_error_rad",
        unit: "rad, unknown",
        levels: &[5e-4, 1e-3, 2e-3, 5e-3, 1e-2],
        typical: 1e-3,
        overrides: |level, drawn| {
            let [one, two] = drawn.signs(level);
            set!["converters.encoder.mounting_error_rad=[{one:?}, {two:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "encoder-resolution",
        key: "converters.encoder.bits",
        unit: "bits",
        levels: &[13.0, 12.0, 11.0, 10.0],
        typical: 12.0,
        overrides: |level, _| set!["converters.encoder.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-noise",
        key: "converters.encoder.noise_rad",
        unit: "rad",
        levels: &[1e-4, 3e-4, 1e-3, 3e-3],
        typical: 3e-4,
        overrides: |level, _| set!["converters.encoder.noise_rad={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-latency",
        key: "converters.encoder.latency_ticks",
        unit: "ticks",
        levels: &[0.5, 1.0, 2.0, 3.0],
        typical: 0.5,
        overrides: |level, _| set!["converters.encoder.latency_ticks={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-bandwidth",
        key: "converters.torque.lag_s",
        unit: "s",
        levels: &[0.5e-3, 1e-3, 2e-3, 5e-3],
        typical: 1e-3,
        overrides: |level, _| set!["converters.torque.lag_s={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-delay",
        key: "converters.torque.delay_ticks",
        unit: "ticks",
        levels: &[1.5, 2.0, 3.0, 4.0],
        typical: 1.5,
        overrides: |level, _| set!["converters.torque.delay_ticks={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-resolution",
        key: "converters.torque.bits",
        unit: "bits",
        levels: &[11.0, 10.0, 9.0, 8.0],
        typical: 10.0,
        overrides: |level, _| set!["converters.torque.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-gain",
        key: "converters.torque.error.gain",
        levels: &[0.05, 0.1, 0.2, 0.5],
        typical: 0.05,
        overrides: |level, drawn| {
            let [one, two] = drawn.signs(level);
            set!["converters.torque.error.gain=[{one:?}, {two:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "torque-ripple",
        key: "converters.torque.error.ripple",
        levels: &[0.02, 0.05, 0.1, 0.2],
        typical: 0.05,
        overrides: |level, _| set!["converters.torque.error.ripple={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-cogging",
        key: "converters.torque.error.cogging_nm",
        unit: "N·m",
        levels: &[0.01, 0.02, 0.05, 0.1, 0.2],
        typical: 0.02,
        overrides: |level, _| set!["converters.torque.error.cogging_nm={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-dead-zone",
        key: "converters.torque.error.dead_zone_nm",
        unit: "N·m",
        levels: &[0.01, 0.02, 0.05, 0.1, 0.2],
        typical: 0.02,
        overrides: |level, _| set!["converters.torque.error.dead_zone_nm={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "tick-jitter",
        key: "run.tick_jitter",
        unit: "ticks",
        levels: &[0.1, 0.2, 0.4, 0.8],
        typical: 0.1,
        overrides: |level, _| set!["run.tick_jitter={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "tick-gaps",
        key: "converters.link.gap_ticks",
        unit: "ticks, once a second on average",
        levels: &[2.0, 5.0, 10.0, 20.0, 40.0],
        typical: 5.0,
        overrides: |level, _| {
            set![
                "converters.link.gap_probability=0.001",
                "converters.link.gap_ticks={level}"
            ]
        },
        ..BOTH
    },
    RigEffect {
        name: "frame-loss",
        key: "converters.link.frame_loss",
        levels: &[0.005, 0.01, 0.05, 0.1],
        typical: 0.01,
        overrides: |level, _| set!["converters.link.frame_loss={level:?}"],
        ..BOTH
    },
];
