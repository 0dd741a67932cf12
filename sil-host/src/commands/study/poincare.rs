//! `painleve study poincare`: Fig. 5.

use clap::Args;

use super::cells::CellOptions;
use super::options::OutcomeOptions;
use crate::commands::CommandError;
use crate::study::Grid;
use crate::study::poincare::{Diagram, Poincare};

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

/// Computes the diagram and writes it.
pub fn run(arguments: &PoincareArguments) -> Result<(), CommandError> {
    let study = Poincare {
        cells: arguments.cells.cells(&arguments.mu, &arguments.v_belt)?,
    };
    let rows = arguments.outcome.compute(&study)?;
    arguments.outcome.write(&Diagram::new(&study, rows))
}
