//! Success over each factor of the campaign, with its interval in equal bins.

use core::ops::Range;

use painleve_chart::style::{BLUE_INK, GREY};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::outcome::RobustnessOutcome;
use super::{Criterion, Row};
use crate::proportion::Proportion;

/// A factor of the campaign: its name and unit, its range, the number of its bins and its value in a run.
type Factor = (&'static str, Range<f64>, usize, fn(&Row) -> f64);

/// The factors shown, which are drawn independently of each other.
const FACTORS: [Factor; 8] = [
    ("Friction μ", 0.2..1.0, 8, |row| row.mu),
    ("Belt speed (m/s)", -1.0..1.0, 8, |row| row.v_belt_m_s),
    ("Control rate (kHz)", 0.5..5.0, 8, |row| {
        1e-3 * f64::from(row.tick_hz)
    }),
    ("Encoder (bits)", 11.5..18.5, 7, |row| {
        f64::from(row.encoder_bits)
    }),
    ("Delay (ticks)", 0.0..2.0, 8, |row| row.delay_ticks),
    ("Lag of the torque (ms)", 0.0..1.0, 8, |row| {
        1e3 * row.torque_lag_s
    }),
    ("Noise of the force (N)", 0.0..0.1, 8, |row| {
        row.force_noise_n
    }),
    ("Lost frames (%)", 0.0..1.0, 8, |row| 100.0 * row.frame_loss),
];

impl Figure for RobustnessOutcome {
    fn svg(&self) -> String {
        let factors = FACTORS.map(|factor| (bins(&self.rows, &factor, self.criterion), factor));
        let lowest = factors
            .iter()
            .flat_map(|(bins, _)| bins)
            .map(|(_, success)| 100.0 * success.lower)
            .fold(100.0, f64::min);
        // One scale for all factors, so that they can be compared.
        let y = (lowest - 0.5).max(0.0).floor()..100.0 + 0.02 * (100.0 - lowest).max(1.0);
        let panels = factors
            .iter()
            .map(|(bins, (name, range, ..))| panel(name, range, bins, &y, self.success.rate));
        Chart {
            title: "Robustness".into(),
            subtitle: format!(
                "{} {}\nin equal bins of each factor, with 95 % intervals; grey: all runs",
                self.criterion.words(),
                self.success
            ),
            panels: panels.collect(),
            columns: 2,
            ..Chart::default()
        }
        .svg()
    }
}

/// Returns the success in each bin of a factor that has runs, with the bin's middle. An override can set a factor to a value
/// outside its range, which no bin stands for.
fn bins(
    rows: &[Row],
    (_, range, count, value): &Factor,
    criterion: Criterion,
) -> Vec<(f64, Proportion)> {
    let width = (range.end - range.start) / *count as f64;
    let mut counts = vec![(0, 0); *count];
    let is_shown = |row: &&Row| (range.start..=range.end).contains(&value(row));
    for row in rows.iter().filter(is_shown) {
        let bin = ((value(row) - range.start) / width) as usize;
        let (successes, runs) = &mut counts[bin.min(count - 1)];
        *successes += usize::from(criterion.holds(row.ending));
        *runs += 1;
    }
    let bins = counts.iter().enumerate().filter(|(_, (_, runs))| *runs > 0);
    bins.map(|(bin, &(successes, runs))| {
        let middle = range.start + (bin as f64 + 0.5) * width;
        (middle, Proportion::new(successes, runs))
    })
    .collect()
}

fn panel(
    name: &str,
    range: &Range<f64>,
    bins: &[(f64, Proportion)],
    y: &Range<f64>,
    overall: f64,
) -> Panel {
    let intervals = bins.iter().flat_map(|(x, success)| {
        let [low, high] = [success.lower, success.upper].map(|rate| 100.0 * rate);
        [(*x, low), (*x, high), (f64::NAN, f64::NAN)]
    });
    let rates = bins.iter().map(|(x, success)| (*x, 100.0 * success.rate));
    Panel {
        title: "Success (%)".into(),
        x: Some((name.into(), range.clone())),
        y: Some(y.clone()),
        height: 240,
        y_ticks: 5,
        marks: vec![
            Mark::Level {
                value: 100.0 * overall,
                colour: GREY,
            },
            Mark::line("", BLUE_INK, intervals.collect()),
            Mark::Dots {
                name: String::new(),
                colour: BLUE_INK,
                size: 16,
                points: rates.collect(),
            },
        ],
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robustness::Ending;

    #[test]
    fn every_run_is_in_one_bin_of_each_factor() {
        let row = |mu: f64, ending| Row {
            mu,
            ending,
            ..crate::robustness::tables::row(0, ending, 0.0)
        };
        let rows = [
            row(0.2, Ending::Reached),
            row(0.2, Ending::Fault),
            row(1.0, Ending::Reached),
        ];
        let found = bins(&rows, &FACTORS[0], Criterion::Kept);
        let counts: Vec<_> = found.iter().map(|(_, p)| (p.successes, p.runs)).collect();
        assert_eq!(counts, [(1, 2), (1, 1)]);
        let outside = [0.19, 1.01, f64::NAN].map(|mu| row(mu, Ending::Reached));
        assert!(bins(&outside, &FACTORS[0], Criterion::Kept).is_empty());
    }

    #[test]
    fn every_number_of_bits_has_a_bin() {
        let rows: Vec<Row> = (12..=18)
            .map(|encoder_bits| Row {
                encoder_bits,
                ..crate::robustness::tables::row(0, Ending::Reached, 0.0)
            })
            .collect();
        let encoder = FACTORS.iter().find(|factor| factor.0 == "Encoder (bits)");
        let found = bins(&rows, encoder.unwrap(), Criterion::Kept);
        let middles: Vec<f64> = found.iter().map(|(middle, _)| *middle).collect();
        assert_eq!(middles, [12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0]);
    }
}
