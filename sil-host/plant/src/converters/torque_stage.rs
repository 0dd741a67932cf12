//! Torque stages of both joints: counts to torque, saturation, first-order lag,
//! and the transport delay from sample to torque.

use nalgebra::Vector2;
use painleve_shared::counts::{LinearScale, TorqueCounts};
use painleve_shared::settings;

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

/// Both torque stages with the commands on their way.
#[derive(Clone, Debug)]
pub struct TorqueStages {
    scale: LinearScale<f64>,
    lag_s: f64,
    whole_ticks: usize,
    fraction: f64,
    /// Ring of commanded torques, N·m.
    commands: [Vector2<f64>; MAXIMUM_DELAY_TICKS],
    next: usize,
}

impl TorqueStages {
    /// Stages that have been commanded zero torque for ever.
    pub fn new(settings: &TorqueStageSettings) -> Self {
        Self {
            scale: settings.scale(),
            lag_s: settings.lag_s,
            whole_ticks: settings.delay_ticks as usize,
            fraction: settings.delay_ticks.fract(),
            commands: [Vector2::zeros(); MAXIMUM_DELAY_TICKS],
            next: 0,
        }
    }

    /// Time constant of the stages, s.
    pub fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// How long after a tick the torque changes, in ticks, 0 … 1.
    pub fn change_after_tick(&self) -> f64 {
        self.fraction
    }

    /// Takes this tick's command, or repeats the last one if there is none;
    /// called once per tick. Counts beyond the range saturate.
    pub fn command(&mut self, counts: Option<[TorqueCounts; 2]>) {
        let last = (self.next + MAXIMUM_DELAY_TICKS - 1) % MAXIMUM_DELAY_TICKS;
        self.commands[self.next] = match counts {
            Some(counts) => {
                let maximum = self.scale.maximum_counts();
                let [one, two] = counts.map(|count| {
                    let limited = count.0.clamp(-maximum - 1, maximum);
                    self.scale.value(limited)
                });
                Vector2::new(one, two)
            }
            None => self.commands[last],
        };
        self.next = (self.next + 1) % MAXIMUM_DELAY_TICKS;
    }

    /// The torque commanded for the change within this tick, N·m.
    pub fn target_nm(&self) -> Vector2<f64> {
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
        assert_eq!(stages.target_nm(), Vector2::zeros());
        stages.command(None);
        assert_eq!(stages.target_nm(), Vector2::new(2.5, -5.0));
        stages.command(None);
        assert_eq!(stages.target_nm(), Vector2::new(2.5, -5.0));
    }

    #[test]
    fn counts_beyond_the_range_saturate() {
        let mut stages = stages(0.0);
        stages.command(Some([TorqueCounts(100_000), TorqueCounts(-100_000)]));
        let lsb = 5.0 / 2048.0;
        assert_eq!(stages.target_nm(), Vector2::new(2047.0 * lsb, -5.0));
    }
}
