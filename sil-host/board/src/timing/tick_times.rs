//! Costs of ticks: exact percentiles, and the worst tick.

use std::collections::BTreeMap;

use painleve_shared::frame::ActuatorFrame;
use serde::{Deserialize, Serialize};

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
    /// Takes in one tick, which gave `answer`.
    pub fn push(&mut self, answer: &ActuatorFrame, cost: u32) {
        *self.ticks_by_cost.entry(cost).or_default() += 1;
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

    /// The most expensive tick, the first of them if there are several.
    pub fn worst(&self) -> Option<&WorstTick> {
        self.worst.as_ref()
    }

    /// Costs with the number of ticks that had them, ascending.
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
