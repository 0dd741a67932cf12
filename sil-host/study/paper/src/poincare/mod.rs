//! Fig. 5: θ1 at each upward zero of θ̇1, and whether the bouncing is
//! periodic or chaotic, by the criterion of [`verdict`](crate::chaos::verdict).

mod figure;
mod options;
mod outcome;
mod page;

use std::collections::BTreeMap;

use painleve_plant::PlantError;
use painleve_plant::mechanics::MotionError;
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Study, StudyError};
use serde::Serialize;

use crate::attractor::advance_or_settle;
use crate::cells::Cells;
use crate::chaos::section::Returns;
use crate::chaos::{Regime, RegimeVerdict};

pub use options::Options;
pub use outcome::{PoincareDiagram, RegimeInterval};

/// The diagram, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Poincare {
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
    /// Regime: quiet, periodic, chaotic or undecided.
    pub regime: Regime,
    /// Returns per period, if the motion is periodic and its period was found.
    pub period: Option<usize>,
    /// Largest Lyapunov exponent across the flow, 1/s; null with too few
    /// returns, and for a periodic motion whose deviations vanish (minus infinity).
    pub exponent_per_s: Option<f64>,
    /// Standard error of the exponent, 1/s.
    pub standard_error_per_s: Option<f64>,
    /// θ1 at each return, rad.
    pub theta1_rad: Vec<f64>,
}

/// One return in the CSV file; a cell without returns has one line without θ1.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct ReturnLine {
    mu: f64,
    v_belt_m_s: f64,
    initial: String,
    regime: Regime,
    period: Option<usize>,
    exponent_per_s: Option<f64>,
    standard_error_per_s: Option<f64>,
    theta1_rad: Option<f64>,
}

impl Study for Poincare {
    type Row = Row;

    fn len(&self) -> usize {
        self.cells.len()
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let cell = self.cells.cell(index)?;
        let mut plant = self.cells.plant_of(&cell)?;
        let failed = |source: MotionError| StudyError::Plant {
            row: cell.to_string(),
            source: PlantError::new(source),
        };
        let mut returns = Returns::new(self.cells.plant.impact);
        if !advance_or_settle(&mut plant, self.cells.transient_s).map_err(failed)? {
            let until_s = plant.time_s() + self.cells.record_s;
            plant.advance(until_s, &mut returns).map_err(failed)?;
        }
        let verdict = RegimeVerdict::of(returns.returns());
        Ok(Row {
            mu: cell.mu,
            v_belt_m_s: cell.v_belt_m_s,
            initial: cell.initial.to_string(),
            regime: verdict.regime,
            period: verdict.period,
            exponent_per_s: verdict.exponent_per_s.filter(|value| value.is_finite()),
            standard_error_per_s: verdict.standard_error_per_s,
            theta1_rad: returns.returns().iter().map(|one| one.state[0]).collect(),
        })
    }
}

impl Row {
    /// Returns one line for each return, or one without θ1.
    fn lines(&self) -> Vec<ReturnLine> {
        let line = |theta1_rad| ReturnLine {
            mu: self.mu,
            v_belt_m_s: self.v_belt_m_s,
            initial: self.initial.clone(),
            regime: self.regime,
            period: self.period,
            exponent_per_s: self.exponent_per_s,
            standard_error_per_s: self.standard_error_per_s,
            theta1_rad,
        };
        if self.theta1_rad.is_empty() {
            return vec![line(None)];
        }
        self.theta1_rad
            .iter()
            .copied()
            .map(Some)
            .map(line)
            .collect()
    }
}

impl Tabular for Poincare {
    fn lines(row: &Row) -> impl IntoIterator<Item: Serialize> {
        row.lines()
    }

    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(self.cells.seeds())
    }
}
