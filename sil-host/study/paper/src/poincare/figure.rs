//! Fig. 5: θ1 at the returns, coloured by period, a strip of the motion, and the exponent.

use core::ops::Range;

use painleve_chart::style::{BLACK_INK, BLUE_INK, Colour, GREEN, GREY, ORANGE, PURPLE, QUIET, SKY};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::Row;
use super::outcome::PoincareDiagram;
use crate::cells::Cells;
use crate::chaos::Regime;
use crate::places::Places;

/// Red for chaotic motion, as in the paper.
const RED: Colour = Colour(0xC6, 0x1A, 0x1A);

/// The kinds of motion in the order of the legend.
const MOTIONS: [(&str, Colour); 8] = [
    ("period 1", BLACK_INK),
    ("period 2", BLUE_INK),
    ("period 3", GREEN),
    ("period 4", PURPLE),
    ("longer period", SKY),
    ("chaotic", RED),
    ("undecided", ORANGE),
    ("quiet", QUIET),
];

/// Returns the place of a row's motion in [`MOTIONS`].
fn motion(row: &Row) -> usize {
    match (row.regime, row.period) {
        (Regime::Periodic, Some(period @ 1..=4)) => period - 1,
        (Regime::Periodic, _) => 4,
        (Regime::Chaotic, _) => 5,
        (Regime::Undecided, _) => 6,
        (Regime::Quiet, _) => 7,
    }
}

impl Figure for PoincareDiagram {
    fn svg(&self) -> String {
        chart(self).svg()
    }
}

/// Draws the figure for the first friction coefficient and initial condition.
fn chart(diagram: &PoincareDiagram) -> Chart {
    let Cells {
        mu,
        v_belt_m_s,
        initial,
        transient_s,
        record_s,
        ..
    } = diagram.settings();
    let rows: Vec<&Row> = (0..v_belt_m_s.len())
        .map(|v_belt| &diagram.rows[v_belt * initial.len()])
        .collect();
    let places = Places::of(v_belt_m_s);
    Chart {
        title: format!("θ₁ where θ̇₁ turns positive, at μ = {}", mu[0]),
        subtitle: format!(
            "no control, from x0,{}, {record_s} s after {transient_s} s of transient (paper: Fig. 5)",
            initial[0]
        ),
        x_title: "Belt speed v_belt (m/s)".into(),
        x: Some(places.ends()),
        panels: vec![
            returns(&rows),
            strip(&rows, &places),
            exponents(&rows, places.ends()),
        ],
        ..Chart::default()
    }
}

fn returns(rows: &[&Row]) -> Panel {
    // The dots of a few belt speeds would hardly be seen in the size of a whole diagram.
    let size = if rows.len() < 40 { 10 } else { 4 };
    let marks = MOTIONS
        .iter()
        .enumerate()
        .filter_map(|(place, (name, colour))| {
            let rows = rows.iter().filter(|row| motion(row) == place);
            let points: Vec<(f64, f64)> = rows
                .flat_map(|row| {
                    let theta1 = row.theta1_rad.iter();
                    theta1.map(|theta1| (row.v_belt_m_s, theta1.to_degrees()))
                })
                .collect();
            (!points.is_empty()).then(|| Mark::Dots {
                name: (*name).into(),
                colour: *colour,
                size,
                points,
            })
        });
    Panel {
        title: "θ₁ (°)".into(),
        height: 700,
        marks: marks.collect(),
        ..Panel::default()
    }
}

fn strip(rows: &[&Row], places: &Places) -> Panel {
    let cells = places
        .nearest
        .iter()
        .map(|place| motion(rows[*place]) as u8);
    // The other names are in the legend of the returns.
    let palette = MOTIONS.iter().map(|(name, colour)| match *name {
        "quiet" => ((*name).to_owned(), *colour),
        _ => (String::new(), *colour),
    });
    Panel {
        title: "Motion".into(),
        y: Some(0.0..1.0),
        y_ticks: 0,
        height: 70,
        marks: vec![Mark::Cells {
            x: places.ends(),
            y: 0.0..1.0,
            columns: places.nearest.len(),
            palette: palette.collect(),
            cells: cells.collect(),
        }],
        ..Panel::default()
    }
}

fn exponents(rows: &[&Row], x: Range<f64>) -> Panel {
    let mut points: Vec<(f64, f64)> = rows
        .iter()
        .map(|row| (row.v_belt_m_s, row.exponent_per_s.unwrap_or(f64::NAN)))
        .collect();
    points.sort_by(|one, other| one.0.total_cmp(&other.0));
    Panel {
        title: "Largest Lyapunov exponent (1/s)".into(),
        note: "across the flow".into(),
        height: 330,
        marks: vec![
            Mark::line("", GREY, vec![(x.start, 0.0), (x.end, 0.0)]),
            Mark::line("", BLUE_INK, points),
        ],
        ..Panel::default()
    }
}
