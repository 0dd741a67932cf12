//! Torque stages of both joints: conversion from counts, saturation, first-order lag, the transport
//! delay from sample to torque, and a watchdog for missing commands.

use painleve_shared::counts::{LinearScale, TorqueCounts};
use painleve_shared::{JointTorque, settings};

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
    /// Creates stages whose past commands were all zero torque.
    pub fn new(settings: &TorqueStageSettings) -> Self {
        Self {
            scale: settings.scale(),
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
    pub fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// Returns how long after a tick the torque changes, in ticks, 0 … 1.
    pub fn change_after_tick(&self) -> f64 {
        self.fraction
    }

    /// Accepts this tick's command, or repeats the last one if there is none; called once per tick.
    /// Counts beyond the range saturate.
    pub fn command(&mut self, counts: Option<[TorqueCounts; 2]>) {
        let last = (self.next + MAXIMUM_DELAY_TICKS - 1) % MAXIMUM_DELAY_TICKS;
        self.commands[self.next] = match counts {
            Some(counts) => {
                let maximum = self.scale.maximum_counts();
                let [one, two] = counts.map(|count| {
                    let limited = count.0.clamp(-maximum - 1, maximum);
                    self.scale.value(limited)
                });
                JointTorque::new(one, two)
            }
            None => self.commands[last],
        };
        self.next = (self.next + 1) % MAXIMUM_DELAY_TICKS;
        self.watchdog.tick(counts.is_some());
        if self.watchdog.tripped {
            self.commands = [JointTorque::zeros(); MAXIMUM_DELAY_TICKS];
        }
    }

    /// Returns whether the watchdog has removed the torque.
    pub fn has_tripped(&self) -> bool {
        self.watchdog.tripped
    }

    /// Returns the torque commanded for the change within this tick, N·m.
    pub fn target_nm(&self) -> JointTorque<f64> {
        let behind = self.whole_ticks + 1;
        self.commands[(self.next + MAXIMUM_DELAY_TICKS - behind) % MAXIMUM_DELAY_TICKS]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(delay_ticks: f64) -> TorqueStages {
        TorqueStages::new(&TorqueStageSettings {
            delay_ticks,
            ..Default::default()
        })
    }

    #[test]
    fn commands_arrive_after_the_delay() {
        let mut stages = stages(1.5);
        assert_eq!(stages.change_after_tick(), 0.5);
        stages.command(Some([TorqueCounts(1024), TorqueCounts(-2048)]));
        assert_eq!(stages.target_nm(), JointTorque::zeros());
        stages.command(None);
        assert_eq!(stages.target_nm(), JointTorque::new(2.5, -5.0));
        stages.command(None);
        assert_eq!(stages.target_nm(), JointTorque::new(2.5, -5.0));
    }

    #[test]
    fn without_commands_the_torque_is_removed_for_good() {
        let mut stages = TorqueStages::new(&TorqueStageSettings {
            delay_ticks: 0.0,
            watchdog_ticks: 3,
            ..Default::default()
        });
        let full = Some([TorqueCounts(2047), TorqueCounts(2047)]);
        // No command has been sent yet, so the watchdog is not armed.
        (0..10).for_each(|_| stages.command(None));
        assert!(!stages.has_tripped());
        stages.command(full);
        stages.command(None);
        stages.command(None);
        assert!(stages.target_nm().first() > 4.9 && !stages.has_tripped());
        // A command in time restarts the watchdog.
        stages.command(full);
        stages.command(None);
        stages.command(None);
        assert!(!stages.has_tripped());
        stages.command(None);
        assert!(stages.has_tripped());
        assert_eq!(stages.target_nm(), JointTorque::zeros());
        stages.command(full);
        assert_eq!(stages.target_nm(), JointTorque::zeros());
        assert!(stages.has_tripped());
    }

    #[test]
    fn counts_beyond_the_range_saturate() {
        let mut stages = stages(0.0);
        stages.command(Some([TorqueCounts(100_000), TorqueCounts(-100_000)]));
        let lsb = 5.0 / 2048.0;
        assert_eq!(stages.target_nm(), JointTorque::new(2047.0 * lsb, -5.0));
    }
}
