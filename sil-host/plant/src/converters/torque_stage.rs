//! Torque stages of both joints: conversion from counts, saturation, first-order lag, the transport
//! delay from sample to torque, and a watchdog for missing commands.

use painleve_shared::counts::{LinearScale, TorqueCounts};
use painleve_shared::{JointMotion, JointTorque, settings};

use super::fault::{ChannelFaults, FaultyChannel};
use super::torque_error::TorqueErrorSettings;

/// Longest delay, in whole ticks.
const MAXIMUM_DELAY_TICKS: usize = 16;

settings! {
    /// Settings of both torque stages.
    #[derive(Copy)]
    pub struct TorqueStageSettings {
        /// Resolution: 2^bits counts over the whole range.
        bits: u8 = 12, 4..=22, "bits";
        /// Full scale to either side.
        range_nm: f64 = 5.0, 1e-3..=1e6, "N·m";
        /// Time constant of the stage; 0 for none.
        lag_s: f64 = 0.0, 0.0..=1.0, "s";
        /// Time from the sample to the torque that answers it, in control ticks.
        delay_ticks: f64 = 1.0, 0.0..=MAXIMUM_DELAY_TICKS as f64 - 1.0, "ticks";
        /// Without a command for this long, the stage removes its torque for the rest of the run.
        /// The first command arms this watchdog.
        watchdog_ticks: u32 = 50, 1..=1_000_000, "ticks";
        /// Errors of stages and motors.
        error: TorqueErrorSettings = TorqueErrorSettings::default();
    }
}

impl TorqueStageSettings {
    fn scale(&self) -> LinearScale<f64> {
        LinearScale {
            bits: self.bits,
            range: self.range_nm,
        }
    }
}

/// Both torque stages with the commands in transit.
#[derive(Clone, Debug)]
pub struct TorqueStages {
    scale: LinearScale<f64>,
    lag_s: f64,
    whole_ticks: usize,
    fraction: f64,
    /// Ring buffer of commanded torques, N·m.
    commands: [JointTorque<f64>; MAXIMUM_DELAY_TICKS],
    next: usize,
    watchdog: CommandWatchdog,
    /// `None` without errors.
    error: Option<TorqueErrorSettings>,
    channels: [FaultyChannel; 2],
    /// Last commands that arrived, counts.
    last_counts: [i64; 2],
}

/// Removes the torque when commands stop arriving; latched.
#[derive(Clone, Debug)]
struct CommandWatchdog {
    limit_ticks: u32,
    /// Ticks since the last command; `None` before the first.
    silent_ticks: Option<u32>,
    tripped: bool,
}

impl CommandWatchdog {
    fn tick(&mut self, is_command: bool) {
        self.silent_ticks = if is_command {
            Some(0)
        } else {
            self.silent_ticks.map(|ticks| ticks.saturating_add(1))
        };
        let silent = self.silent_ticks.unwrap_or(0);
        self.tripped = self.tripped || silent >= self.limit_ticks;
    }
}

impl TorqueStages {
    /// Creates stages whose past commands were all zero torque, commanded every `tick_s` seconds.
    pub fn new(
        settings: &TorqueStageSettings,
        faults: &ChannelFaults,
        tick_s: f64,
        seed: u64,
    ) -> Self {
        let scale = settings.scale();
        let full_scale = i64::from(scale.maximum_counts());
        let channel = |fault, index| FaultyChannel::new(fault, full_scale, tick_s, seed, index);
        Self {
            scale,
            error: Some(settings.error).filter(|error| *error != TorqueErrorSettings::default()),
            channels: [channel(&faults.torque_1, 4), channel(&faults.torque_2, 5)],
            last_counts: [0; 2],
            lag_s: settings.lag_s,
            whole_ticks: settings.delay_ticks as usize,
            fraction: settings.delay_ticks.fract(),
            commands: [JointTorque::zeros(); MAXIMUM_DELAY_TICKS],
            next: 0,
            watchdog: CommandWatchdog {
                limit_ticks: settings.watchdog_ticks,
                silent_ticks: None,
                tripped: false,
            },
        }
    }

    /// Returns the time constant of the stages, s.
    #[inline]
    pub fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// Returns how long after a tick the torque changes, in ticks, 0 … 1.
    #[inline]
    pub fn change_after_tick(&self) -> f64 {
        self.fraction
    }

    /// Accepts this tick's command, or repeats the last one if there is none; called once per tick.
    /// Counts beyond the range saturate. `time_s` is the time of the tick.
    #[inline]
    pub fn command(&mut self, counts: Option<[TorqueCounts; 2]>, time_s: f64) {
        if let Some(counts) = counts {
            self.last_counts = counts.map(|count| i64::from(count.0));
        }
        let maximum = self.scale.maximum_counts();
        let mut torques_nm = [0.0; 2];
        for (joint, torque_nm) in torques_nm.iter_mut().enumerate() {
            let passed = self.channels[joint].pass(time_s, self.last_counts[joint]);
            let limited = passed.clamp(i64::from(-maximum - 1), i64::from(maximum));
            *torque_nm = self.scale.value(limited as i32);
        }
        self.commands[self.next] = JointTorque::from_array(torques_nm);
        self.next = (self.next + 1) % MAXIMUM_DELAY_TICKS;
        self.watchdog.tick(counts.is_some());
        if self.watchdog.tripped {
            self.commands = [JointTorque::zeros(); MAXIMUM_DELAY_TICKS];
        }
    }

    /// Returns whether the watchdog has removed the torque.
    #[inline]
    pub fn has_tripped(&self) -> bool {
        self.watchdog.tripped
    }

    /// Returns the torque commanded for the change within this tick, N·m.
    #[inline]
    pub fn commanded_nm(&self) -> JointTorque<f64> {
        let behind = self.whole_ticks + 1;
        self.commands[(self.next + MAXIMUM_DELAY_TICKS - behind) % MAXIMUM_DELAY_TICKS]
    }

    /// Returns the torque to which the joints' torque changes within this tick, N·m, with the errors at these joint
    /// angles (rad) and this time (s).
    #[inline]
    pub fn target_nm(&self, joints_rad: &JointMotion<f64>, time_s: f64) -> JointTorque<f64> {
        let commanded_nm = self.commanded_nm();
        self.error.map_or(commanded_nm, |error| {
            error.applied_nm(commanded_nm, joints_rad, time_s)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(settings: &TorqueStageSettings) -> TorqueStages {
        TorqueStages::new(settings, &ChannelFaults::default(), 1e-3, 1)
    }

    fn stages(delay_ticks: f64) -> TorqueStages {
        new(&TorqueStageSettings {
            delay_ticks,
            ..Default::default()
        })
    }

    #[test]
    fn commands_arrive_after_the_delay() {
        let mut stages = stages(1.5);
        assert_eq!(stages.change_after_tick(), 0.5);
        stages.command(Some([TorqueCounts(1024), TorqueCounts(-2048)]), 0.0);
        assert_eq!(stages.commanded_nm(), JointTorque::zeros());
        stages.command(None, 0.0);
        assert_eq!(stages.commanded_nm(), JointTorque::new(2.5, -5.0));
        stages.command(None, 0.0);
        assert_eq!(stages.commanded_nm(), JointTorque::new(2.5, -5.0));
    }

    #[test]
    fn without_commands_the_torque_is_removed_for_good() {
        let mut stages = new(&TorqueStageSettings {
            delay_ticks: 0.0,
            watchdog_ticks: 3,
            ..Default::default()
        });
        let full = Some([TorqueCounts(2047), TorqueCounts(2047)]);
        // No command has been sent yet, so the watchdog is not armed.
        (0..10).for_each(|_| stages.command(None, 0.0));
        assert!(!stages.has_tripped());
        stages.command(full, 0.0);
        stages.command(None, 0.0);
        stages.command(None, 0.0);
        assert!(stages.commanded_nm().first() > 4.9 && !stages.has_tripped());
        // A command in time restarts the watchdog.
        stages.command(full, 0.0);
        stages.command(None, 0.0);
        stages.command(None, 0.0);
        assert!(!stages.has_tripped());
        stages.command(None, 0.0);
        assert!(stages.has_tripped());
        assert_eq!(stages.commanded_nm(), JointTorque::zeros());
        stages.command(full, 0.0);
        assert_eq!(stages.commanded_nm(), JointTorque::zeros());
        assert!(stages.has_tripped());
    }

    #[test]
    fn counts_beyond_the_range_saturate() {
        let mut stages = stages(0.0);
        stages.command(Some([TorqueCounts(100_000), TorqueCounts(-100_000)]), 0.0);
        let lsb = 5.0 / 2048.0;
        assert_eq!(stages.commanded_nm(), JointTorque::new(2047.0 * lsb, -5.0));
    }
}
