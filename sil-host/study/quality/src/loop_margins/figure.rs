//! Bode plots with the measured points on the linearised curves, the margins along the belt, and the steps.

use painleve_chart::axis::logarithmic;
use painleve_chart::style::{BLACK_INK, BLUE_INK, Colour, GREEN, ORANGE, PURPLE, SKY, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};

use super::{Loop, LoopOutcome, Point, Row};
use painleve_study_core::outcome::Figure;

/// Colours of the places, from one end of the belt to the other.
const COLOURS: [Colour; 7] = [SKY, BLUE_INK, GREEN, BLACK_INK, PURPLE, ORANGE, VERMILLION];
const HEIGHT: i32 = 380;

impl Figure for LoopOutcome {
    fn svg(&self) -> String {
        let mut names: Vec<(String, &'static str)> = Vec::new();
        for row in &self.rows {
            for one in &row.loops {
                let name = (row.controller.to_string(), one.name);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        let mut panels = Vec::new();
        for (controller, name) in &names {
            let of = |row: &Row| row.controller.to_string() == *controller;
            let loops: Vec<(&Row, &Loop)> = self
                .rows
                .iter()
                .filter(|row| of(row))
                .filter_map(|row| Some((row, row.loops.iter().find(|one| one.name == *name)?)))
                .collect();
            panels.push(self.bode(
                &format!("{controller}, {name}: gain (dB)"),
                &loops,
                0.0,
                |point| [point.gain_db, point.measured_gain_db],
            ));
            panels.push(self.bode(
                &format!("{controller}, {name}: phase (°)"),
                &loops,
                -180.0,
                |point| [point.phase_deg, point.measured_phase_deg],
            ));
        }
        panels.push(self.along_the_belt(&names));
        panels.push(self.steps());
        let check = self.largest_difference().map_or(String::new(), |most| {
            format!(
                "\nLargest difference between sines (dots) and finite differences (lines): {:.1} % and {:.1}°",
                100.0 * most.gain_share, most.phase_deg
            )
        });
        Chart {
            title: "The sampled loop, opened at each command".into(),
            subtitle: format!("Places zₜ along the belt{check}"),
            panels,
            columns: 2,
            one_legend: true,
            ..Chart::default()
        }
        .svg()
    }
}

impl LoopOutcome {
    /// Returns the colour of a place.
    fn colour(&self, tip_m: f64) -> Colour {
        let mut places: Vec<f64> = self.rows.iter().map(|row| row.tip_m).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        let place = places
            .iter()
            .position(|place| *place == tip_m)
            .unwrap_or_default();
        COLOURS[place * (COLOURS.len() - 1) / places.len().saturating_sub(1).max(1)]
    }

    fn bode(
        &self,
        title: &str,
        loops: &[(&Row, &Loop)],
        level: f64,
        values: fn(&Point) -> [f64; 2],
    ) -> Panel {
        let mut marks = vec![Mark::Level {
            value: level,
            colour: painleve_chart::style::GREY,
        }];
        for (row, one) in loops {
            let colour = self.colour(row.tip_m);
            let at = |which: usize| {
                let points = one
                    .points
                    .iter()
                    .map(move |point| (point.frequency_hz.log10(), values(point)[which]));
                points.collect::<Vec<_>>()
            };
            marks.push(Mark::line(&place(row), colour, at(0)));
            marks.push(Mark::Dots {
                name: String::new(),
                colour,
                size: 10,
                points: at(1),
            });
        }
        let ends = loops
            .iter()
            .flat_map(|(_, one)| &one.points)
            .map(|point| point.frequency_hz.log10());
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (at.min(low), at.max(high))
        });
        let ends = low..high.max(low + 0.1);
        Panel {
            title: title.into(),
            x_labels: Some(logarithmic(&ends)),
            x: Some(("Frequency (Hz)".into(), ends)),
            height: HEIGHT,
            marks,
            ..Panel::default()
        }
    }

    fn along_the_belt(&self, names: &[(String, &'static str)]) -> Panel {
        let marks = names
            .iter()
            .enumerate()
            .map(|(number, (controller, name))| {
                let points = self
                    .rows
                    .iter()
                    .filter(|row| row.controller.to_string() == *controller);
                let points = points.filter_map(|row| {
                    let one = row.loops.iter().find(|one| one.name == *name)?;
                    Some((row.tip_m, one.margins.modulus))
                });
                Mark::Line {
                    name: format!("{controller}, {name}"),
                    colour: [BLUE_INK, ORANGE, GREEN, PURPLE][number % 4],
                    width: 5,
                    dashed: true,
                    points: points.collect(),
                }
            });
        let mut marks: Vec<Mark> = marks.collect();
        let mut ratio: Vec<(f64, f64)> = self
            .rows
            .iter()
            .map(|row| (row.tip_m, row.p_ratio))
            .collect();
        ratio.sort_by(|one, other| one.0.total_cmp(&other.0));
        ratio.dedup();
        let ends = ratio
            .first()
            .zip(ratio.last())
            .map_or(0.0..1.0, |(first, last)| {
                first.0..last.0.max(first.0 + 0.01)
            });
        marks.push(Mark::Line {
            name: "p/Q₂₂".into(),
            colour: VERMILLION,
            width: 4,
            dashed: false,
            points: ratio,
        });
        Panel {
            title: "1/max|S| and p/Q₂₂".into(),
            x: Some(("zₜ (m)".into(), ends)),
            height: HEIGHT,
            marks,
            ..Panel::default()
        }
    }

    fn steps(&self) -> Panel {
        let marks = self.rows.iter().flat_map(|row| {
            row.steps.iter().map(|step| Mark::Line {
                name: String::new(),
                colour: self.colour(row.tip_m),
                width: 3,
                dashed: step.name == "force",
                points: step
                    .curve
                    .iter()
                    .map(|(time_s, value)| (1e3 * time_s, *value))
                    .collect(),
            })
        });
        Panel {
            title: "Steps: 1 mm; dashed: 1 N load".into(),
            x: Some(("Time (ms)".into(), 0.0..400.0)),
            height: HEIGHT,
            marks: marks.collect(),
            ..Panel::default()
        }
    }
}

fn place(row: &Row) -> String {
    format!("{:.2} m", row.tip_m).replace('-', "−")
}
