//! The trials of a search: error beside change of torque, with those that no other one beats in both.

use painleve_chart::axis::logarithmic;
use painleve_chart::style::{BLUE_INK, GREEN, GREY, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};

use super::{Score, Trial};

/// Returns the figure as SVG text; `given` is the score of the given scenario.
pub fn svg(trials: &[Trial], given: &Score, best: &Trial) -> String {
    let at = |score: &Score| (score.error_mm.log10(), score.torque_change_nm.log10());
    let is_kept = |trial: &&Trial| trial.score.kept >= 1.0;
    let dots = |name: &str, colour, size, points| Mark::Dots {
        name: name.into(),
        colour,
        size,
        points,
    };
    let of = |kept: bool| {
        trials
            .iter()
            .filter(|trial| is_kept(trial) == kept)
            .map(|trial| at(&trial.score))
            .collect()
    };
    let scores = || trials.iter().map(|trial| &trial.score).chain([given]);
    let x = ends(scores().map(|score| score.error_mm));
    let y = ends(scores().map(|score| score.torque_change_nm));
    let panel = Panel {
        title: "Change of torque (N·m)".into(),
        x_labels: Some(logarithmic(&x)),
        x: Some(("Tracking error (mm)".into(), x)),
        y_labels: Some(logarithmic(&y)),
        y: Some(y),
        height: 700,
        marks: vec![
            dots("not kept in every case", VERMILLION, 9, of(false)),
            dots("trials", GREY, 9, of(true)),
            Mark::line(
                "Pareto front",
                BLUE_INK,
                front(trials).iter().map(at).collect(),
            ),
            dots("given", ORANGE, 22, vec![at(given)]),
            dots("best", GREEN, 22, vec![at(&best.score)]),
        ],
        ..Panel::default()
    };
    Chart {
        title: "Search for settings".into(),
        subtitle: format!(
            "{} trials; the best costs {:.3} of the given scenario",
            trials.len(),
            best.cost
        ),
        panels: vec![panel],
        ..Chart::default()
    }
    .svg()
}

/// Returns the ends of a logarithmic axis for values.
fn ends(values: impl Iterator<Item = f64>) -> core::ops::Range<f64> {
    let places = values.map(f64::log10).filter(|place| place.is_finite());
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
        (place.min(low), place.max(high))
    });
    if low <= high {
        low - 0.05..high + 0.05
    } else {
        0.0..1.0
    }
}

/// Returns the scores of kept trials that no other one beats in both error and change of torque, by error.
pub(super) fn front(trials: &[Trial]) -> Vec<Score> {
    let mut kept: Vec<Score> = trials
        .iter()
        .map(|trial| trial.score)
        .filter(|score| score.kept >= 1.0)
        .collect();
    kept.sort_by(|one, other| one.error_mm.total_cmp(&other.error_mm));
    let mut least_nm = f64::INFINITY;
    kept.retain(|score| {
        let is_less = score.torque_change_nm < least_nm;
        least_nm = least_nm.min(score.torque_change_nm);
        is_less
    });
    kept
}
