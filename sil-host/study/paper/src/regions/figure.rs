//! Fig. 3: the maps with the lines p = 0 and b = 0.

use std::ops::Range;

use painleve_chart::style::{
    BLACK_INK, BLUE_INK, Colour, GREY, ORANGE, SKY, VERMILLION, over_white,
};
use painleve_chart::{Chart, Mark, Panel};
use painleve_shared::{Arm, Slip, SolutionMode};
use painleve_study_core::initial::Initial;
use painleve_study_core::outcome::Figure;

use super::lines::RegionColumn;
use super::{Map, Regions, Theta2};

/// The paper's colour of the line p = 0.
const RED: Colour = Colour(0xB0, 0x00, 0x20);

/// Number of cells of a map in the figure.
const FINE_COLUMNS: usize = 445;
const FINE_ROWS: usize = 260;

impl Figure for Regions {
    fn svg(&self) -> String {
        let columns = self.maps.first().map_or(&[][..], |map| &map.grid.0);
        // The arm was checked before.
        let arm = Arm::new(self.arm).ok();
        let maps = self.maps.iter();
        Chart {
            title: "Solution modes with the tip on the belt (Fig. 3)".into(),
            subtitle: format!(
                "θ̇₁ (rad/s) over θ₁ (°) at μ = {} and u = 0; θ₂ and its rate keep the tip on the \
                 belt; x0 as on a belt of negative speed",
                self.mu
            ),
            x_title: "θ₁ (°)".into(),
            x: Some(ends_of_cells(columns)),
            panels: arm.map_or_else(Vec::new, |arm| {
                maps.map(|map| map.panel(&arm, self.mu)).collect()
            }),
            columns: self.maps.len().min(2),
            one_legend: true,
            ..Chart::default()
        }
        .svg()
    }
}

impl Map {
    fn title(&self) -> String {
        let side = match self.theta2 {
            Theta2::Positive => "θ₂ > 0",
            Theta2::Negative => "θ₂ < 0",
        };
        let slip = match self.slip {
            Slip::Positive => "slip żᵣ > 0",
            Slip::Negative => "slip żᵣ < 0",
        };
        format!("{side}, {slip}")
    }

    /// Returns θ1 of the paper's initial conditions on this side of the vertical, degrees; at rest on a belt of negative speed,
    /// they slip in the positive direction.
    fn initial_conditions(&self, arm: &Arm<f64>) -> Vec<(&'static str, f64)> {
        if self.slip == Slip::Negative {
            return Vec::new();
        }
        let all = [
            ("x0,a", Initial::A),
            ("x0,d", Initial::D),
            ("x0,u", Initial::U),
        ];
        all.into_iter()
            .filter_map(|(name, initial)| Some((name, initial.angles_deg(arm)?)))
            .filter(|(_, [_, theta2])| theta2 * self.theta2.sign() > 0.0)
            .map(|(name, [theta1, _])| (name, theta1))
            .collect()
    }

    fn panel(&self, arm: &Arm<f64>, mu: f64) -> Panel {
        let (columns, rates) = (&self.grid.0, &self.grid.1);
        let palette = [
            ("sliding", over_white(SKY, 0.45)),
            ("flight", over_white(GREY, 0.15)),
            ("indeterminate", over_white(ORANGE, 0.6)),
            ("inconsistent", over_white(VERMILLION, 0.75)),
        ];
        let place = |mode| match mode {
            SolutionMode::Sliding => 0,
            SolutionMode::Flight => 1,
            SolutionMode::Indeterminate => 2,
            SolutionMode::Inconsistent => 3,
        };
        let (theta1_range, rate_range) = (ends_of_cells(columns), ends_of_cells(rates));
        let middles = |range: &Range<f64>, count: usize| -> Vec<f64> {
            let step = (range.end - range.start) / count as f64;
            let start = range.start;
            (0..count)
                .map(|index| start + (index as f64 + 0.5) * step)
                .collect()
        };
        // The figure has its own map with a fine grid, independent of the grid of the numbers.
        let fine: Vec<Option<RegionColumn<'_>>> = middles(&theta1_range, FINE_COLUMNS)
            .into_iter()
            .map(|theta1| RegionColumn::new(arm, theta1.to_radians(), self.theta2))
            .collect();
        let p: Vec<f64> = fine
            .iter()
            .map(|column| {
                column
                    .as_ref()
                    .map_or(f64::NAN, |c| c.p_per_kg(mu, self.slip))
            })
            .collect();
        let mut cells = Vec::with_capacity(FINE_COLUMNS * FINE_ROWS);
        for rate in middles(&rate_range, FINE_ROWS) {
            cells.extend(fine.iter().zip(&p).map(|(column, &p)| match column {
                Some(column) => place(SolutionMode::classify(p, column.b_m_s2(rate))),
                None => u8::MAX,
            }));
        }
        let mut marks = vec![Mark::Cells {
            x: theta1_range,
            y: rate_range.clone(),
            columns: FINE_COLUMNS,
            palette: palette.map(|(name, colour)| (name.into(), colour)).to_vec(),
            cells,
        }];
        for (index, curve) in self.b_zero.iter().enumerate() {
            let inside = |rate: f64| rate_range.contains(&rate);
            let points = curve
                .iter()
                .map(|&[theta1, rate]| (theta1, if inside(rate) { rate } else { f64::NAN }));
            let name = if index == 0 { "b = 0" } else { "" };
            marks.push(Mark::line(name, BLACK_INK, points.collect()));
        }
        for (index, &theta1) in self.p_zero_theta1_deg.iter().enumerate() {
            let name = if index == 0 { "p = 0" } else { "" };
            let points = vec![(theta1, rate_range.start), (theta1, rate_range.end)];
            marks.push(Mark::dashed(name, RED, points));
        }
        for (name, theta1) in self.initial_conditions(arm) {
            marks.push(Mark::Dots {
                name: String::new(),
                colour: BLUE_INK,
                size: 14,
                points: vec![(theta1, 0.0)],
            });
            marks.push(Mark::Label {
                // Towards the middle of the map.
                at: (theta1 + if theta1 > 0.0 { -13.0 } else { 1.5 }, 0.0),
                centred: false,
                text: name.into(),
            });
        }
        Panel {
            title: self.title(),
            y: Some(rate_range),
            height: 420,
            marks,
            ..Panel::default()
        }
    }
}

/// Extends the first and the last value by half a step.
fn ends_of_cells(middles: &[f64]) -> Range<f64> {
    match middles {
        [first, .., last] => {
            let half = 0.5 * (last - first) / (middles.len() - 1) as f64;
            (first - half).min(last + half)..(first - half).max(last + half)
        }
        [only] => only - 0.5..only + 0.5,
        [] => 0.0..1.0,
    }
}
