//! Fig. 5: θ1 at the returns, a strip of periodic and chaotic motion, and the exponent.

use core::ops::Range;

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREY, ORANGE};
use painleve_chart::{Chart, Mark, Panel, PlotError};
use plotters::style::RGBColor;

use super::Row;
use super::outcome::PoincareDiagram;
use crate::cells::Cells;
use crate::chaos::Regime;
use crate::outcome::Figure;
use crate::places::Places;

/// Red for chaotic motion, as in the paper.
const RED: RGBColor = RGBColor(0xC6, 0x1A, 0x1A);

/// The regimes of the strip, in the paper's colours.
const STRIP: [(Regime, RGBColor); 4] = [
    (Regime::Periodic, BLACK_INK),
    (Regime::Chaotic, RED),
    (Regime::Undecided, ORANGE),
    (Regime::Quiet, RGBColor(0xF2, 0xF2, 0xF2)),
];

impl Figure for PoincareDiagram {
    fn svg(&self) -> Result<String, PlotError> {
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
        title: format!("θ1 where θ̇1 turns positive, at μ = {}", mu[0]),
        subtitle: format!(
            "no control, from x0,{}, {record_s} s after {transient_s} s of transient (paper: Fig. 5)",
            initial[0]
        ),
        x_title: "belt speed v_belt in m/s".into(),
        x: Some(places.ends()),
        panels: vec![
            returns(&rows),
            strip(&rows, &places),
            exponents(&rows, places.ends()),
        ],
    }
}

fn returns(rows: &[&Row]) -> Panel {
    let points = rows.iter().flat_map(|row| {
        let theta1 = row.theta1_rad.iter();
        theta1.map(|theta1| (row.v_belt_m_s, theta1.to_degrees()))
    });
    Panel {
        title: "θ1 in degrees".into(),
        height: 760,
        marks: vec![Mark::Dots {
            name: String::new(),
            colour: BLUE_INK,
            size: 2,
            points: points.collect(),
        }],
        ..Panel::default()
    }
}

fn strip(rows: &[&Row], places: &Places) -> Panel {
    let kind = |place: &usize| {
        let regime = rows[*place].regime;
        STRIP.iter().position(|(kind, _)| *kind == regime)
    };
    let cells = places
        .nearest
        .iter()
        .map(|place| kind(place).unwrap_or(0) as u8);
    let palette = STRIP
        .iter()
        .map(|(kind, colour)| (kind.name().to_owned(), *colour));
    Panel {
        title: "motion".into(),
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
        title: "largest Lyapunov exponent in 1/s".into(),
        note: "across the flow".into(),
        height: 360,
        marks: vec![
            Mark::line("", GREY, vec![(x.start, 0.0), (x.end, 0.0)]),
            Mark::line("", BLUE_INK, points),
        ],
        ..Panel::default()
    }
}
