//! Draws the figure of the trade-off between success and smoothness from its measured figures.

#![allow(clippy::unwrap_used)]

use painleve_chart::Mark;
use painleve_chart::chart::{Chart, Panel};
use painleve_chart::style::{BLUE_INK, Colour, VERMILLION};

use crate::documentation::{Entry, check_file, entries, number};

/// Returns the torque noise of an entry, mN·m a tick.
fn noise_mnm(entry: &Entry) -> f64 {
    1e3 * figure(entry, "torque change, holding, 90th percentile, N·m a tick")
}

/// Returns a panel of a figure of merit against the torque noise: value, lower and upper end for each entry.
fn panel(title: &str, entries: &[Entry], value: impl Fn(&Entry) -> [f64; 3]) -> Panel {
    let intervals = entries.iter().flat_map(|entry| {
        let (x, [_, low, high]) = (noise_mnm(entry), value(entry));
        [(x, low), (x, high), (f64::NAN, f64::NAN)]
    });
    let dots = |name: &str, colour: Colour, is_default: bool| {
        let chosen = entries
            .iter()
            .filter(|entry| (entry.name == "default") == is_default);
        Mark::Dots {
            name: name.into(),
            colour,
            size: 18,
            points: chosen
                .map(|entry| (noise_mnm(entry), value(entry)[0]))
                .collect(),
        }
    };
    let labels = entries.iter().map(|entry| Mark::Label {
        at: (noise_mnm(entry) + 1.0, value(entry)[0]),
        centred: false,
        text: entry.label.clone(),
    });
    let mut marks = vec![
        Mark::line("", BLUE_INK, intervals.collect()),
        dots("other gains", BLUE_INK, false),
        dots("default gains", VERMILLION, true),
    ];
    marks.extend(labels);
    Panel {
        title: title.into(),
        height: 300,
        marks,
        ..Panel::default()
    }
}

fn figure(entry: &Entry, key: &str) -> f64 {
    number(&entry.result[key]).unwrap()
}

#[test]
fn documentation_draws_the_trade_off_as_measured() {
    let entries = entries("smoothness");
    let success = panel("Success (%)", &entries, |entry| {
        let [successes, runs, lower, upper] =
            ["successes", "runs", "lower_percent", "upper_percent"].map(|key| figure(entry, key));
        [100.0 * successes / runs, lower, upper]
    });
    let error = panel("Error, 95th percentile (mm)", &entries, |entry| {
        [1e3 * figure(entry, "error, 95th percentile, m"); 3]
    });
    let [least, most] =
        [f64::min, f64::max].map(|of| entries.iter().map(noise_mnm).reduce(of).unwrap());
    // With room for the labels.
    let margin = 0.1 * (most - least);
    let chart = Chart {
        title: "Success and error against torque noise".into(),
        subtitle: "Labels: bandwidth relative to the default; bars: 95 % intervals".into(),
        x_title: "Torque change a tick while holding, 90th percentile (mN·m)".into(),
        x: Some(least - margin..most + margin),
        panels: vec![success, error],
        one_legend: true,
        ..Chart::default()
    };
    check_file("images/smoothness.svg", &chart.svg());
}
