//! Sections over the belt's speed, all on one logarithmic axis.

use painleve_chart::style::{BLACK_INK, BLUE_INK, Colour, GREEN, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome;
use painleve_study_core::outcome::Figure;

use super::Row;
use super::outcome::{BeltSpeedSection, ClosedLoopDiagram};

const COLOURS: [Colour; 5] = [BLUE_INK, VERMILLION, GREEN, ORANGE, BLACK_INK];

/// Smaller rates are drawn at the lower end of the axis, rad/s.
const LEAST_RAD_S: f64 = 1e-3;

impl Figure for ClosedLoopDiagram {
    fn svg(&self) -> String {
        let fastest = self.rows.iter().map(|row| row.max_theta1_dot_rad_s);
        let decades = place(fastest.fold(1.0, f64::max)).ceil();
        let together = |one: &BeltSpeedSection, other: &BeltSpeedSection| {
            (&one.controller, one.converters) == (&other.controller, other.converters)
        };
        let panels = self
            .sections
            .chunk_by(together)
            .map(|sections| panel(sections, &self.rows, decades));
        Chart {
            title: "Belt speed with the controller in the loop (Fig. 12)".into(),
            subtitle:
                "largest θ̇₁ in rad/s on a logarithmic axis, with the firmware's controller and \
                       simulated converters"
                    .into(),
            x_title: "Belt speed v_belt (m/s)".into(),
            panels: panels.collect(),
            ..Chart::default()
        }
        .svg()
    }
}

/// Returns the place of a rate on the logarithmic axis.
fn place(rate_rad_s: f64) -> f64 {
    rate_rad_s.max(LEAST_RAD_S).log10()
}

/// The sections of one controller with one set of converters.
fn panel(sections: &[BeltSpeedSection], rows: &[Row], decades: f64) -> Panel {
    let least = place(0.0);
    let marks = sections.iter().zip(COLOURS.iter().cycle());
    let marks = marks.map(|(section, colour)| {
        let rows = rows.iter().filter(|row| section.is_of(row));
        let points = rows.map(|row| (row.v_belt_m_s, place(row.max_theta1_dot_rad_s)));
        let name = format!(
            "μ = {}, x0,{}: bounces at {} of {} speeds",
            section.mu,
            section.initial,
            section.bouncing_m_s.len(),
            section.cells
        );
        Mark::Dots {
            name,
            colour: *colour,
            size: 8,
            points: points.collect(),
        }
    });
    let labels = (least as i32..=decades as i32).map(|decade| {
        let at = f64::from(decade);
        let name = match decade {
            0.. => format!("{:.0}", 10_f64.powi(decade)),
            _ => 10_f64.powi(decade).to_string(),
        };
        let prefix = if at == least { "≤ " } else { "" };
        (at, format!("{prefix}{name}"))
    });
    let first = &sections[0];
    Panel {
        title: format!(
            "{}, {} converters",
            first.controller,
            outcome::name(&first.converters)
        ),
        y: Some(least - 0.2..decades),
        y_labels: Some(labels.collect()),
        height: 300,
        marks: marks.collect(),
        ..Panel::default()
    }
}
