//! Encoders, force cell, torque stages, ticks and frames.

use core::f64::consts::PI;

use super::BOTH;
use crate::effects::effect::LevelOverrides::{Computed, RandomSigns};
use crate::effects::effect::{RigEffect, effects, set};
use crate::robustness::LiftOffRule::Counted;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = effects! {
    ..BOTH;

    "torque-pulse": "converters.torque.error.pulse_nm", "N·m for 5 ms on either joint",
        [0.1, 0.2, 0.5, 1.0], typical 0.2,
        lift_offs: Counted,
        overrides: Computed(|level, drawn| {
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
        });

    "force-noise": "converters.force.noise_n", "N", [0.05, 0.1, 0.2, 0.5, 1.0], typical 0.1;

    "force-resolution": "converters.force.bits", "bits", [10.0, 8.0, 6.0], typical 10.0;

    "force-bias": "converters.force.bias_n", "N in either axis", [0.1, 0.2, 0.5, 1.0, 2.0], typical 0.2,
        overrides: RandomSigns;

    "force-drift": "converters.force.drift_n_s", "N/s in either axis",
        [0.01, 0.05, 0.1, 0.2], typical 0.01,
        overrides: RandomSigns;

    "force-gain": "converters.force.gain_error", "", [0.05, 0.1, 0.2, 0.5], typical 0.05,
        overrides: RandomSigns;

    "force-cross-talk": "converters.force.cross_talk", "", [0.02, 0.05, 0.1, 0.2], typical 0.02,
        overrides: RandomSigns;

    "force-low-pass": "converters.force.low_pass_s", "s", [1e-3, 2e-3, 5e-3, 1e-2], typical 1e-3;

    "force-delay": "converters.force.delay_ticks", "ticks", [1.0, 2.0, 4.0, 8.0], typical 1.0;

    "encoder-eccentricity": "converters.encoder.eccentricity_rad", "rad",
        [5e-4, 1e-3, 2e-3, 5e-3, 1e-2], typical 1e-3,
        overrides: Computed(|level, drawn| {
            let phase_rad = drawn.phase_rad - PI;
            set![
                "converters.encoder.eccentricity_rad=[{level:?}, {level:?}]",
                "converters.encoder.eccentricity_phase_rad=[{phase_rad:?}, {phase_rad:?}]"
            ]
        });

    "encoder-offset": "converters.encoder.mounting_error_rad", "rad, unknown",
        [5e-4, 1e-3, 2e-3, 5e-3, 1e-2], typical 1e-3,
        overrides: RandomSigns;

    "encoder-resolution": "converters.encoder.bits", "bits", [13.0, 12.0, 11.0, 10.0], typical 12.0;

    "encoder-noise": "converters.encoder.noise_rad", "rad", [1e-4, 3e-4, 1e-3, 3e-3], typical 3e-4;

    "encoder-latency": "converters.encoder.latency_ticks", "ticks", [0.5, 1.0, 2.0, 3.0], typical 0.5;

    "torque-bandwidth": "converters.torque.lag_s", "s", [0.5e-3, 1e-3, 2e-3, 5e-3], typical 1e-3;

    "torque-delay": "converters.torque.delay_ticks", "ticks", [1.5, 2.0, 3.0, 4.0], typical 1.5;

    "torque-resolution": "converters.torque.bits", "bits", [11.0, 10.0, 9.0, 8.0], typical 10.0;

    "torque-gain": "converters.torque.error.gain", "", [0.05, 0.1, 0.2, 0.5], typical 0.05,
        overrides: RandomSigns;

    "torque-ripple": "converters.torque.error.ripple", "", [0.02, 0.05, 0.1, 0.2], typical 0.05;

    "torque-cogging": "converters.torque.error.cogging_nm", "N·m",
        [0.01, 0.02, 0.05, 0.1, 0.2], typical 0.02;

    "torque-dead-zone": "converters.torque.error.dead_zone_nm", "N·m",
        [0.01, 0.02, 0.05, 0.1, 0.2], typical 0.02;

    "tick-jitter": "run.tick_jitter", "ticks", [0.1, 0.2, 0.4, 0.8], typical 0.1;

    "tick-gaps": "converters.link.gap_ticks", "ticks, once a second on average",
        [2.0, 5.0, 10.0, 20.0, 40.0], typical 5.0,
        overrides: Computed(|level, _| {
            set![
                "converters.link.gap_probability=0.001",
                "converters.link.gap_ticks={level}"
            ]
        });

    "frame-loss": "converters.link.frame_loss", "", [0.005, 0.01, 0.05, 0.1], typical 0.01;
};
