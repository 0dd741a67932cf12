//! Fig. 4: friction and belt speeds at which the arm keeps bouncing, by brute force.
//!
//! Every cell runs through a transient and is then recorded. The arm bounces if its tip leaves the belt
//! during the recording; the paper's measure, the largest θ̇1, is then above zero,
//! and otherwise zero up to rounding.

mod figure;
mod options;
mod outcome;
mod page;

use std::collections::BTreeMap;

use painleve_plant::PlantError;
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Study, StudyError};
use serde::Serialize;

use crate::attractor::Attractor;
use crate::cells::Cells;

pub use options::Options;
pub use outcome::{BifurcationDiagram, Window};

/// The diagram, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// Cells of the diagram.
    pub cells: Cells,
}

/// Motion of the arm in one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Initial condition: `a`, `d`, `u` or `random:K`.
    pub initial: String,
    /// Largest θ̇1, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// Whether the tip keeps leaving the belt.
    pub bouncing: bool,
    /// Fraction of the time in contact.
    pub contact_fraction: f64,
    /// Largest tip height over the belt, m.
    pub apex_m: f64,
    /// Impacts with the belt per second.
    pub impacts_per_s: f64,
    /// Initial angle θ1, degrees.
    pub start_theta1_deg: f64,
    /// Initial angle θ2, degrees.
    pub start_theta2_deg: f64,
    /// Initial rate θ̇1, rad/s.
    pub start_theta1_dot_rad_s: f64,
    /// Initial rate θ̇2, rad/s.
    pub start_theta2_dot_rad_s: f64,
}

impl Study for Bifurcation {
    type Row = Row;

    fn len(&self) -> usize {
        self.cells.len()
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let Cells {
            transient_s,
            record_s,
            ..
        } = self.cells;
        let cell = self.cells.cell(index)?;
        let mut plant = self.cells.plant_of(&cell)?;
        let attractor = Attractor::of(&mut plant, transient_s, record_s).map_err(|source| {
            StudyError::Plant {
                row: cell.to_string(),
                source: PlantError::new(source),
            }
        })?;
        Ok(Row {
            mu: cell.mu,
            v_belt_m_s: cell.v_belt_m_s,
            initial: cell.initial.to_string(),
            max_theta1_dot_rad_s: attractor.max_theta1_dot_rad_s,
            bouncing: attractor.is_bouncing(),
            contact_fraction: attractor.contact_fraction(),
            apex_m: attractor.apex_m,
            impacts_per_s: attractor.impacts as f64 / record_s,
            start_theta1_deg: cell.start[0].to_degrees(),
            start_theta2_deg: cell.start[1].to_degrees(),
            start_theta1_dot_rad_s: cell.start[2],
            start_theta2_dot_rad_s: cell.start[3],
        })
    }
}

impl Tabular for Bifurcation {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(self.cells.seeds())
    }
}
