//! The outcome of all cells: sections over the belt speed, as a table and as a figure.

use comfy_table::Table;
use painleve_study_core::case::{ControllerChoice, ConverterChoice};
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::Row;

/// The whole diagram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClosedLoopDiagram {
    /// All cells, in the order of their numbers.
    pub rows: Vec<Row>,
    /// One section per controller, converter set, friction coefficient and initial condition.
    pub sections: Vec<BeltSpeedSection>,
}

/// One controller over all belt speeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeltSpeedSection {
    /// Controller.
    pub controller: ControllerChoice,
    /// Converter set.
    pub converters: ConverterChoice,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Initial condition.
    pub initial: String,
    /// Number of belt speeds.
    pub cells: usize,
    /// Belt speeds at which the arm keeps bouncing, m/s.
    pub bouncing_m_s: Vec<f64>,
    /// Belt speeds at which the tip ever left the belt, m/s.
    pub lifted_m_s: Vec<f64>,
    /// Number of cells that end with a fault.
    pub faults: usize,
    /// Largest θ̇1 during the recording, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// Largest final distance of the tip from its target, m.
    pub max_error_m: f64,
    /// The paper's result, if it has one.
    #[serde(skip)]
    pub paper: Option<&'static str>,
}

impl BeltSpeedSection {
    pub(super) fn is_of(&self, row: &Row) -> bool {
        (&self.controller, self.converters, self.mu, &self.initial)
            == (&row.controller, row.converters, row.mu, &row.initial)
    }
}

impl ClosedLoopDiagram {
    /// Collects the rows of a study.
    pub fn new(rows: Vec<Row>) -> Self {
        let mut sections: Vec<BeltSpeedSection> = Vec::new();
        for row in &rows {
            let place = sections.iter().position(|section| section.is_of(row));
            let place = place.unwrap_or_else(|| {
                sections.push(BeltSpeedSection {
                    controller: row.controller.clone(),
                    converters: row.converters,
                    mu: row.mu,
                    initial: row.initial.clone(),
                    cells: 0,
                    bouncing_m_s: Vec::new(),
                    lifted_m_s: Vec::new(),
                    faults: 0,
                    max_theta1_dot_rad_s: f64::NEG_INFINITY,
                    max_error_m: 0.0,
                    paper: row.paper,
                });
                sections.len() - 1
            });
            let section = &mut sections[place];
            section.cells += 1;
            if row.bouncing {
                section.bouncing_m_s.push(row.v_belt_m_s);
            }
            if row.lift_offs > 0 {
                section.lifted_m_s.push(row.v_belt_m_s);
            }
            section.faults += usize::from(row.fault.is_some());
            section.max_theta1_dot_rad_s =
                section.max_theta1_dot_rad_s.max(row.max_theta1_dot_rad_s);
            section.max_error_m = section.max_error_m.max((row.tip_t_m - row.target_m).abs());
        }
        Self { rows, sections }
    }
}

impl Outcome for ClosedLoopDiagram {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            "converters",
            "μ",
            "from",
            "keeps bouncing",
            "left the belt at all",
            "faults",
            "largest θ̇₁ (rad/s)",
            "farthest from target (mm)",
            "the paper",
        ]);
        for section in &self.sections {
            let of_cells = |speeds: &[f64]| {
                let count = format!("{} of {}", speeds.len(), section.cells);
                let least = speeds.iter().copied().reduce(f64::min);
                let most = speeds.iter().copied().reduce(f64::max);
                match least.zip(most) {
                    Some((least, most)) => format!("{count} ({least} … {most} m/s)"),
                    None => count,
                }
            };
            table.add_row([
                section.controller.to_string(),
                outcome::name(&section.converters),
                section.mu.to_string(),
                section.initial.clone(),
                of_cells(&section.bouncing_m_s),
                of_cells(&section.lifted_m_s),
                section.faults.to_string(),
                format!("{:.3}", section.max_theta1_dot_rad_s),
                format!("{:.2}", 1e3 * section.max_error_m),
                section.paper.unwrap_or("–").into(),
            ]);
        }
        table
    }
}
