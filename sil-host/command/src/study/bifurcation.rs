//! `painleve study bifurcation`: Fig. 4.

use clap::Args;
use painleve_study::bifurcation::{Bifurcation, Diagram};
use painleve_study::{Grid, StudyError};

use super::cells::CellOptions;
use super::options::OutcomeOptions;
use crate::CommandError;

/// Options of `painleve study bifurcation`.
#[derive(Debug, Args)]
pub struct BifurcationArguments {
    /// Friction coefficients μ, FROM:TO:STEP or a list; with one, a section is drawn.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "0.1:1:0.1",
        allow_hyphen_values = true
    )]
    mu: Grid,
    /// Belt speeds, m/s.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-1:-0.1:0.005",
        allow_hyphen_values = true
    )]
    v_belt: Grid,
    #[command(flatten)]
    cells: CellOptions,
    #[command(flatten)]
    outcome: OutcomeOptions,
}

impl BifurcationArguments {
    /// The study that is asked for, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    pub fn study(&self) -> Result<Bifurcation, StudyError> {
        let cells = self.cells.cells(&self.mu, &self.v_belt)?;
        Ok(Bifurcation { cells })
    }

    /// The scenario that it starts from.
    pub fn scenarios(&self) -> Vec<&str> {
        vec![self.cells.scenario()]
    }
}

/// Computes the diagram and writes it.
pub fn run(arguments: &BifurcationArguments) -> Result<(), CommandError> {
    let study = arguments.study()?;
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&Diagram::new(&study, rows))
}
