//! Costs of ticks: exact percentiles, and the worst tick.

use std::collections::BTreeMap;

use painleve_shared::frame::ActuatorFrame;
use serde::{Deserialize, Serialize};

/// The most expensive tick.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorstTick {
    /// Number of the tick.
    pub tick: u32,
    /// State of the supervisor in that tick.
    pub state: String,
    /// Cost.
    pub cost: u32,
}

/// Costs of the ticks of a run.
#[derive(Clone, Debug, Default)]
pub struct TickTimes {
    /// Number of ticks by cost; there are few different costs.
    ticks_by_cost: BTreeMap<u32, u64>,
    worst: Option<WorstTick>,
}

impl TickTimes {
    /// Adds one tick, which gave `answer`.
    pub fn push(&mut self, answer: &ActuatorFrame, cost: u32) {
        self.push_cost(cost);
        if self.worst.as_ref().is_none_or(|worst| cost > worst.cost) {
            self.worst = Some(WorstTick {
                tick: answer.tick,
                state: answer
                    .supervisor_state()
                    .map_or("unknown", |state| state.name())
                    .into(),
                cost,
            });
        }
    }

    /// Adds one tick of unknown circumstances.
    pub fn push_cost(&mut self, cost: u32) {
        *self.ticks_by_cost.entry(cost).or_default() += 1;
    }

    /// Returns the number of ticks.
    pub fn ticks(&self) -> u64 {
        self.ticks_by_cost.values().sum()
    }

    /// Returns the smallest cost that a fraction `quantile` of all ticks does not exceed; 0 without
    /// ticks.
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

    /// Returns the most expensive tick; the first, if there are several.
    pub fn worst(&self) -> Option<&WorstTick> {
        self.worst.as_ref()
    }

    /// Returns the costs with their numbers of ticks, ascending.
    pub fn histogram(&self) -> Vec<(u32, u64)> {
        self.ticks_by_cost.iter().map(|(c, n)| (*c, *n)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_exact_and_the_first_worst_tick_is_named() {
        let mut times = TickTimes::default();
        for tick in 0..1000_u32 {
            let answer = ActuatorFrame {
                tick,
                state: 2,
                ..Default::default()
            };
            times.push(&answer, if tick % 100 == 7 { 900 } else { tick % 3 + 500 });
        }
        assert_eq!(
            [0.0, 0.5, 0.999, 1.0].map(|quantile| times.at_quantile(quantile)),
            [500, 501, 900, 900]
        );
        assert_eq!(
            times.worst(),
            Some(&WorstTick {
                tick: 7,
                state: "tracking".into(),
                cost: 900
            })
        );
    }
}
