//! Options of the studies that run the arm without control over a grid of cells.

use crate::cells::{Cells, RELATIVE_TOLERANCE};
use crate::initial::Initials;
use crate::{Grid, StudyError};
use clap::Args;

use crate::options::BaseOptions;

/// Options shared by the studies of a grid of cells.
#[derive(Debug, Args)]
pub struct CellOptions {
    /// Initial conditions: the paper's a, d and u, and random ones as random:N, for example a,d,random:8.
    #[arg(long, value_name = "LIST", default_value = "a")]
    initial: Initials,
    /// Seed of the random initial conditions.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Transient of each cell before recording starts, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 250.0,
        allow_negative_numbers = true
    )]
    transient_s: f64,
    /// Recording time of each cell, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 50.0,
        allow_negative_numbers = true
    )]
    record_s: f64,
    /// Relative error tolerance of one step of the plant; the absolute tolerance is a tenth of it
    /// [default: 1e-11].
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true)]
    relative_tolerance: Option<f64>,
    #[command(flatten)]
    base: BaseOptions,
}

impl CellOptions {
    /// Name of the scenario that the cells start from.
    pub fn scenario(&self) -> &str {
        self.base.name()
    }

    /// Returns the cells over grids of friction and belt speed, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    pub fn cells(&self, mu: &Grid, v_belt: &Grid) -> Result<Cells, StudyError> {
        let scenario = self.base.load(&[
            ("belt.friction", "--mu"),
            ("belt.profile", "--v-belt"),
            ("initial", "--initial"),
            ("run.seed", "--seed"),
            ("run.duration_s", "--transient-s and --record-s"),
            ("solver.relative_tolerance", "--relative-tolerance"),
            ("solver.absolute_tolerance", "--relative-tolerance"),
        ])?;
        let cells = Cells {
            plant: scenario.plant_parameters(),
            relative_tolerance: self.relative_tolerance.unwrap_or(RELATIVE_TOLERANCE),
            mu: mu.values().to_vec(),
            v_belt_m_s: v_belt.values().to_vec(),
            initial: self.initial.list().to_vec(),
            seed: self.seed,
            transient_s: self.transient_s,
            record_s: self.record_s,
        };
        cells.check()?;
        Ok(cells)
    }
}
