//! What a board's ticks cost: exact percentiles, and the worst tick.

use std::collections::BTreeMap;

use painleve_shared::message::Health;
use serde::{Deserialize, Serialize};

use super::TimedAnswer;

/// The most expensive tick.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorstTick {
    /// Its number.
    pub tick: u32,
    /// The supervisor's state in it.
    pub state: String,
    /// What it took.
    pub cost: u32,
}

/// What the ticks of a run cost.
#[derive(Clone, Debug, Default)]
pub struct TickTimes {
    /// Ticks by cost: there are few different costs.
    ticks_by_cost: BTreeMap<u32, u64>,
    worst: Option<WorstTick>,
}

impl TickTimes {
    /// Takes in one tick.
    pub fn push(&mut self, answer: &TimedAnswer) {
        let cost = answer.instructions;
        *self.ticks_by_cost.entry(cost).or_default() += 1;
        if self.worst.as_ref().is_none_or(|worst| cost > worst.cost) {
            self.worst = Some(WorstTick {
                tick: answer.frame.tick,
                state: answer
                    .frame
                    .supervisor_state()
                    .map_or("unknown", |state| state.name())
                    .into(),
                cost,
            });
        }
    }

    /// Ticks taken in.
    pub fn ticks(&self) -> u64 {
        self.ticks_by_cost.values().sum()
    }

    /// The smallest cost that `quantile` of all ticks do not exceed; 0 without ticks.
    pub fn at_quantile(&self, quantile: f64) -> u32 {
        let wanted = (self.ticks() as f64 * quantile).ceil().max(1.0) as u64;
        let mut ticks = 0;
        for (cost, count) in &self.ticks_by_cost {
            ticks += count;
            if ticks >= wanted {
                return *cost;
            }
        }
        0
    }

    /// The report.
    pub fn report(&self, host: &str, unit: &str, health: &Health) -> TimingReport {
        TimingReport {
            host: host.into(),
            unit: unit.into(),
            ticks: self.ticks(),
            min: self.at_quantile(0.0),
            median: self.at_quantile(0.5),
            p999: self.at_quantile(0.999),
            max: self.at_quantile(1.0),
            worst: self.worst.clone(),
            stack_bytes: health.stack_bytes,
            overruns: health.overruns,
            histogram: self.ticks_by_cost.iter().map(|(c, n)| (*c, *n)).collect(),
        }
    }
}

/// What the ticks of a run cost, for programs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimingReport {
    /// What ran the controller.
    pub host: String,
    /// Unit of all costs.
    pub unit: String,
    /// Ticks controlled.
    pub ticks: u64,
    /// Cheapest tick.
    pub min: u32,
    /// Median.
    pub median: u32,
    /// 99.9th percentile.
    pub p999: u32,
    /// Most expensive tick.
    pub max: u32,
    /// The same, with its circumstances.
    pub worst: Option<WorstTick>,
    /// Most stack ever used, bytes.
    pub stack_bytes: u32,
    /// Ticks that ended after the next should have begun.
    pub overruns: u32,
    /// Costs with the number of ticks that had them, ascending.
    pub histogram: Vec<(u32, u64)>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::frame::ActuatorFrame;

    #[test]
    fn percentiles_are_exact_and_the_first_worst_tick_is_named() {
        let mut times = TickTimes::default();
        for tick in 0..1000_u32 {
            times.push(&TimedAnswer {
                frame: ActuatorFrame {
                    tick,
                    state: 2,
                    ..Default::default()
                },
                instructions: if tick % 100 == 7 { 900 } else { tick % 3 + 500 },
            });
        }
        let report = times.report("qemu", "instructions", &Health::default());
        assert_eq!(
            (report.min, report.median, report.p999, report.max),
            (500, 501, 900, 900)
        );
        assert_eq!(
            report.worst,
            Some(WorstTick {
                tick: 7,
                state: "tracking".into(),
                cost: 900
            })
        );
    }
}
