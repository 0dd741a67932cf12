//! `painleve study poincare`: Fig. 5.

use clap::Args;
use painleve_study::poincare::{Diagram, Poincare};
use painleve_study::{Grid, StudyError};

use super::cells::CellOptions;
use super::options::OutcomeOptions;
use crate::CommandError;

/// Options of `painleve study poincare`.
#[derive(Debug, Args)]
pub struct PoincareArguments {
    /// Friction coefficients μ, FROM:TO:STEP or a list; the figure shows the first.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "0.6",
        allow_hyphen_values = true
    )]
    mu: Grid,
    /// Belt speeds, m/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-0.6:-0.28:0.001",
        allow_hyphen_values = true
    )]
    v_belt: Grid,
    #[command(flatten)]
    cells: CellOptions,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

impl PoincareArguments {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    pub fn study(&self) -> Result<Poincare, StudyError> {
        let cells = self.cells.cells(&self.mu, &self.v_belt)?;
        Ok(Poincare { cells })
    }

    /// The scenario that it starts from.
    pub fn scenarios(&self) -> Vec<&str> {
        vec![self.cells.scenario()]
    }
}

/// Computes the diagram and writes it.
pub fn run(arguments: &PoincareArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&Diagram::new(&study, rows))
}
