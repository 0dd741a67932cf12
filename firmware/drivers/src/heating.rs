//! Estimates the temperature of the torque stages' windings from the commanded torques.
//!
//! A winding's rise over the ambient temperature, as a part of the allowed rise, follows
//! τ dϑ/dt = (T/T_c)² − ϑ, with the torque T, the continuous torque T_c and the time constant τ: I²t.

use painleve_shared::Real;
use painleve_shared::counts::{LinearScale, TorqueCounts};
use painleve_shared::stages::StageSettings;
use painleve_shared::winding::WindingSettings;

use crate::TURNS;

/// Time between two steps of the estimate, s.
const STEP_S: f32 = 0.1;

/// Rise below which a winding that was too hot counts as cold, as a part of the allowed rise.
const COOLED: f32 = 0.8;

/// Coefficients of the estimate.
#[derive(Clone, Copy, Debug)]
pub struct HeatingModel {
    /// Ticks of a step.
    ticks: u32,
    /// Part of the way to its final value that a rise goes in a step.
    share: [f32; 2],
    /// Final rise for a sum of squared torques over a step, per count².
    rise_per_square: [f32; 2],
}

impl HeatingModel {
    /// Makes a model of the windings of these stages, for `tick_hz` joint torques a second of this scale; `None`
    /// if the protection is switched off.
    pub fn new(
        settings: &WindingSettings,
        stages: &StageSettings,
        torque: &LinearScale<f32>,
        tick_hz: f32,
    ) -> Option<Self> {
        // The step ends at a turn.
        let ticks = ((STEP_S * tick_hz) as u32)
            .max(1)
            .next_multiple_of(TURNS.into());
        let step_s = ticks as f32 / tick_hz;
        let range_nm = stages.motor_range_nm(torque.range);
        let continuous_nm = settings.continuous_torque_nm;
        let mut continuous_nm = continuous_nm.unwrap_or(range_nm.map(|it| 0.5 * it));
        // At the joint, where the torques are counted.
        for (torque_nm, gear) in continuous_nm.iter_mut().zip(stages.joint_per_motor()) {
            *torque_nm *= gear;
        }
        settings.enabled.then(|| Self {
            ticks,
            share: settings.time_constant_s.map(|it| step_s / it),
            rise_per_square: continuous_nm.map(|it| {
                let ratio = torque.per_count() / it;
                ratio * ratio / ticks as f32
            }),
        })
    }
}

/// Temperatures of both windings; cold by default. They outlive a new configuration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heating {
    /// Rises, as parts of the allowed ones.
    rises: [f32; 2],
    /// Sums of the squared torques of this step, counts².
    squares: [f32; 2],
    /// Ticks of this step.
    ticks: u32,
    is_hot: bool,
}

impl Heating {
    /// Returns whether a winding was too hot after the last step, and has not cooled since.
    pub fn is_hot(&self) -> bool {
        self.is_hot
    }

    /// Returns the temperatures without the torques of the present step, whose scale may be another one.
    #[must_use]
    pub fn at_a_steps_start(&self) -> Self {
        Self {
            squares: [0.0; 2],
            ticks: 0,
            ..*self
        }
    }

    /// Records the torques of one tick.
    pub fn tick(&mut self, torques: [TorqueCounts; 2]) {
        for (sum, torque) in self.squares.iter_mut().zip(torques) {
            let counts = torque.0 as f32;
            *sum += counts * counts;
        }
        self.ticks = self.ticks.saturating_add(1);
    }

    /// Updates the temperatures if a step is over.
    pub fn step(&mut self, model: &HeatingModel) {
        if self.ticks < model.ticks {
            return;
        }
        let mut hottest = 0.0;
        for joint in 0..2 {
            let end = self.squares[joint] * model.rise_per_square[joint];
            self.rises[joint] += model.share[joint] * (end - self.rises[joint]);
            hottest = self.rises[joint].at_least(hottest);
        }
        self.is_hot = hottest >= if self.is_hot { COOLED } else { 1.0 };
        self.squares = [0.0; 2];
        self.ticks = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: LinearScale<f32> = LinearScale {
        bits: 12,
        range: 5.0,
    };
    const TICK_HZ: f32 = 1000.0;

    fn model() -> HeatingModel {
        let settings = WindingSettings {
            continuous_torque_nm: Some([1.0, 2.0]),
            time_constant_s: [10.0, 5.0],
            ..WindingSettings::default()
        };
        HeatingModel::new(&settings, &StageSettings::default(), &SCALE, TICK_HZ)
            .expect("switched on")
    }

    fn torques(torque_nm: [f32; 2]) -> [TorqueCounts; 2] {
        torque_nm.map(|it| TorqueCounts(SCALE.counts(it).0))
    }

    #[test]
    fn a_session_without_protection_heats_nothing_in_the_next_one() {
        let model = model();
        let mut heating = Heating::default();
        for _ in 0..600_000 {
            heating.tick(torques([5.0, 5.0]));
        }
        let mut next = heating.at_a_steps_start();
        for _ in 0..2 * model.ticks {
            next.tick(torques([0.0; 2]));
            next.step(&model);
        }
        assert_eq!(next.rises, [0.0; 2]);
    }

    /// Returns the time until a winding changes to hot or cold, s, if it is within a minute.
    fn time_s(heating: &mut Heating, torque_nm: [f32; 2]) -> Option<f64> {
        let before = heating.is_hot();
        let ticks = (1..=60_000).find(|_| {
            heating.tick(torques(torque_nm));
            heating.step(&model());
            heating.is_hot() != before
        })?;
        Some(f64::from(ticks) / f64::from(TICK_HZ))
    }

    /// −τ ln(1 − (T_c/T)²).
    #[test]
    fn a_winding_becomes_hot_when_the_closed_form_says() {
        for (torque_nm, time_constant_s, excess) in [
            ([2.0, 0.0], 10.0, 4.0),
            ([0.0, -4.5], 5.0, 5.0625),
            ([-1.1, 1.0], 10.0, 1.21),
        ] {
            let expected_s = -time_constant_s * f64::ln(1.0 - 1.0 / excess);
            let found_s = time_s(&mut Heating::default(), torque_nm).expect("hot");
            assert!(
                (found_s - expected_s).abs() < 0.25,
                "{found_s} {expected_s}"
            );
        }
    }

    #[test]
    fn the_continuous_torque_is_allowed_without_end() {
        assert_eq!(time_s(&mut Heating::default(), [0.99, -1.99]), None);
    }

    #[test]
    fn a_hot_winding_counts_as_hot_until_it_has_cooled() {
        let mut heating = Heating::default();
        assert!(time_s(&mut heating, [3.0, 0.0]).is_some());
        // τ ln(1/0.8), from slightly above the allowed rise.
        let cooled_s = time_s(&mut heating, [0.0; 2]).expect("cool");
        assert!((2.2..3.0).contains(&cooled_s), "{cooled_s}");
    }

    #[test]
    fn half_the_range_is_the_default_and_only_a_setting_switches_it_off() {
        let settings = WindingSettings::default();
        let stages = StageSettings::default();
        let model = HeatingModel::new(&settings, &stages, &SCALE, TICK_HZ).expect("switched on");
        let mut heating = Heating::default();
        for _ in 0..20_000 {
            heating.tick(torques([2.6, 0.0]));
            heating.step(&model);
        }
        assert!(!heating.is_hot());
        for _ in 0..60_000 {
            heating.tick(torques([2.6, 0.0]));
            heating.step(&model);
        }
        assert!(heating.is_hot());
        let off = WindingSettings {
            enabled: false,
            ..settings
        };
        assert!(HeatingModel::new(&off, &stages, &SCALE, TICK_HZ).is_none());
    }

    /// A motor of 0.5 N·m, of which it can give half without end, on a gear of 10 with an efficiency of 0.8: 2 N·m
    /// at the joint.
    #[test]
    fn a_winding_heats_by_the_torque_of_its_motor() {
        let stages = StageSettings {
            gear_ratio: [10.0, 1.0],
            gear_efficiency: [0.8, 1.0],
            motor_range_nm: Some([0.5, 5.0]),
        };
        let settings = WindingSettings::default();
        let model = HeatingModel::new(&settings, &stages, &SCALE, TICK_HZ).expect("switched on");
        for (torque_nm, expected) in [(1.98, false), (2.05, true)] {
            let mut heating = Heating::default();
            for _ in 0..200_000 {
                heating.tick(torques([torque_nm, 0.0]));
                heating.step(&model);
            }
            assert_eq!(heating.is_hot(), expected, "{torque_nm}");
        }
    }
}
