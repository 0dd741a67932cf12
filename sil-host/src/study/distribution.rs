//! Values of many runs: percentiles and a histogram.

use plotters::style::RGBColor;
use serde::Serialize;

use crate::plot::chart::{Mark, Panel};

/// Bars of a histogram.
const BARS: usize = 60;

/// Where values lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// How many there are.
    pub count: usize,
    /// Half are at most this.
    pub median: f64,
    /// 90 % are at most this.
    pub p90: f64,
    /// 99 % are at most this.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

impl Percentiles {
    /// Of values in any order; none of none. A percentile is the least value that enough
    /// values do not exceed.
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
            p99: at(0.99),
            max,
        })
    }
}

/// A panel with the number of values in equal bins from 0 to `end`; larger ones are in the last.
pub fn histogram(title: &str, note: String, colour: RGBColor, end: f64, values: &[f64]) -> Panel {
    let width = end / BARS as f64;
    let mut counts = [0_u32; BARS];
    for value in values {
        let bin = (value / width).max(0.0) as usize;
        counts[bin.min(BARS - 1)] += 1;
    }
    let mut points = Vec::with_capacity(4 * BARS);
    for (bin, count) in counts.iter().enumerate() {
        let (left, right) = (bin as f64 * width, (bin + 1) as f64 * width);
        let top = f64::from(*count);
        points.extend([(left, 0.0), (left, top), (right, top), (right, 0.0)]);
    }
    let highest = counts.iter().max().map_or(1.0, |count| f64::from(*count));
    Panel {
        title: title.into(),
        note,
        y: Some(0.0..1.08 * highest.max(1.0)),
        marks: vec![Mark::line("", colour, points)],
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let found = Percentiles::of((1..=200).rev().map(f64::from).collect()).unwrap();
        assert_eq!((found.median, found.p90, found.p99), (100.0, 180.0, 198.0));
        assert_eq!((found.count, found.max), (200, 200.0));
        assert_eq!(Percentiles::of(Vec::new()), None);
    }

    #[test]
    fn every_value_is_in_a_bar() {
        let panel = histogram(
            "n",
            String::new(),
            RGBColor(0, 0, 0),
            6.0,
            &[0.0, 0.05, 9.0],
        );
        let Mark::Line { points, .. } = &panel.marks[0] else {
            panic!("no line");
        };
        assert_eq!((points[1].1, points[4 * BARS - 2].1), (2.0, 1.0));
    }
}
