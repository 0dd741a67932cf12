//! Distribution of a value over many runs: percentiles and a histogram.

use painleve_chart::style::{Colour, VERMILLION};
use painleve_chart::{Mark, Panel};
use serde::Serialize;

/// Number of bars of a histogram.
const BARS: usize = 60;

/// Percentiles of a set of values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Number of values.
    pub count: usize,
    /// Median.
    pub median: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// The largest value.
    pub max: f64,
}

impl Percentiles {
    /// Returns the distribution of values in any order; `None` without values. A percentile is the
    /// smallest value
    /// that this fraction of the values does not exceed.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_unstable_by(f64::total_cmp);
        let max = *values.last()?;
        let at = |part: f64| {
            let rank = (part * values.len() as f64).ceil() as usize;
            values.get(rank.saturating_sub(1)).copied().unwrap_or(max)
        };
        Some(Self {
            count: values.len(),
            median: at(0.5),
            p90: at(0.9),
            p95: at(0.95),
            p99: at(0.99),
            max,
        })
    }
}

/// Returns a panel with the number of values in equal bins from 0 to `end` and the `limit` of the
/// values.
/// Larger values are in the last bin.
pub fn histogram(
    title: &str,
    note: String,
    colour: Colour,
    end: f64,
    limit: f64,
    values: &[f64],
) -> Panel {
    let width = end / BARS as f64;
    let mut counts = [0_u32; BARS];
    for value in values {
        let bin = (value / width).max(0.0) as usize;
        counts[bin.min(BARS - 1)] += 1;
    }
    let filled = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    let bars = filled.map(|(bin, count)| {
        let left = bin as f64 * width;
        (left..left + width, 0.0..f64::from(*count))
    });
    let highest = counts.iter().copied().max().unwrap_or(0).max(1);
    let top = 1.08 * f64::from(highest);
    let bars = Mark::Bars {
        name: String::new(),
        colour,
        bars: bars.collect(),
    };
    Panel {
        title: title.into(),
        note,
        y: Some(0.0..top),
        // Numbers of runs are whole.
        y_ticks: highest.clamp(2, 6) as usize,
        marks: vec![
            bars,
            Mark::dashed("limit", VERMILLION, vec![(limit, 0.0), (limit, top)]),
        ],
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_among_the_values() {
        let found = Percentiles::of((1..=200).rev().map(f64::from).collect()).unwrap();
        assert_eq!((found.median, found.p95, found.p99), (100.0, 190.0, 198.0));
        assert_eq!((found.count, found.max), (200, 200.0));
        assert_eq!(Percentiles::of(Vec::new()), None);
    }

    #[test]
    fn every_value_is_in_a_bar() {
        let panel = histogram(
            "n",
            String::new(),
            Colour(0, 0, 0),
            6.0,
            5.0,
            &[0.0, 0.05, 9.0],
        );
        let Mark::Bars { bars, .. } = &panel.marks[0] else {
            panic!("no bars");
        };
        let last = 59.0 * 0.1;
        assert_eq!(bars, &[(0.0..0.1, 0.0..2.0), (last..last + 0.1, 0.0..1.0)]);
    }
}
