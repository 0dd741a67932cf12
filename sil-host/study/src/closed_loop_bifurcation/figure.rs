//! Sections over the belt's speed.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel, PlotError};

use super::outcome::{BeltSpeedSection, ClosedLoopDiagram};
use crate::outcome;
use crate::outcome::Figure;

impl Figure for ClosedLoopDiagram {
    fn svg(&self) -> Result<String, PlotError> {
        const COLOURS: [plotters::style::RGBColor; 5] =
            [BLUE_INK, VERMILLION, GREEN, ORANGE, BLACK_INK];
        let mut panels: Vec<Panel> = Vec::new();
        let together = |one: &BeltSpeedSection, other: &BeltSpeedSection| {
            (&one.controller, one.converters) == (&other.controller, other.converters)
        };
        for sections in self.sections.chunk_by(together) {
            let marks = sections.iter().zip(COLOURS.iter().cycle());
            let marks = marks.map(|(section, colour)| {
                let rows = self.rows.iter().filter(|row| section.is_of(row));
                let mut points: Vec<(f64, f64)> = rows
                    .map(|row| (row.v_belt_m_s, row.max_theta1_dot_rad_s))
                    .collect();
                points.sort_by(|one, other| one.0.total_cmp(&other.0));
                let bouncing = section.bouncing_m_s.len();
                let name = format!(
                    "μ = {} from x₀,{}: bounces at {bouncing} of {}",
                    section.mu, section.initial, section.cells
                );
                Mark::line(&name, *colour, points)
            });
            let first = &sections[0];
            let highest = sections.iter().fold(1.0, |high: f64, section| {
                high.max(section.max_theta1_dot_rad_s)
            });
            panels.push(Panel {
                title: format!(
                    "Largest θ̇₁ (rad/s): {}, {} converters",
                    first.controller,
                    outcome::name(&first.converters)
                ),
                y: Some(-0.1 * highest..1.1 * highest),
                height: 360,
                marks: marks.collect(),
                ..Panel::default()
            });
        }
        Chart {
            title: "Belt speed with the controller in the loop (Fig. 12)".into(),
            subtitle: "the firmware's controller in this process, with the converters of the bench"
                .into(),
            x_title: "Belt speed v_belt (m/s)".into(),
            x: None,
            panels,
        }
        .svg()
    }
}
