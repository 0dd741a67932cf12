//! Options of the studies that run the arm without control over a grid of cells.

use clap::Args;
use painleve_study_core::StudyError;
use painleve_study_core::options::{
    BaseOptions, BeltSpeedGrid, FrictionGrid, InitialOptions, RecordingOptions,
};

use crate::cells::{Cells, RELATIVE_TOLERANCE};

/// Options shared by the studies of a grid of cells.
#[derive(Debug, Args)]
pub struct CellOptions {
    #[command(flatten)]
    friction: FrictionGrid,
    #[command(flatten)]
    belt: BeltSpeedGrid,
    #[command(flatten)]
    initial: InitialOptions,
    #[command(flatten)]
    recording: RecordingOptions,
    /// Relative error tolerance of one step of the plant; the absolute tolerance is a tenth of it
    /// [default: 1e-11].
    #[arg(long, value_name = "ERROR")]
    relative_tolerance: Option<f64>,
    #[command(flatten)]
    base: BaseOptions,
}

impl CellOptions {
    /// Returns the cells, checked.
    ///
    /// # Errors
    /// [`StudyError`] naming the option or key that is wrong.
    pub fn cells(&self) -> Result<Cells, StudyError> {
        let taken = [
            ("belt.friction", "--mu"),
            ("belt.profile", "--v-belt"),
            ("initial", "--initial"),
            ("run.seed", "--seed"),
            ("run.duration_s", "--transient-s and --record-s"),
            ("solver.relative_tolerance", "--relative-tolerance"),
            ("solver.absolute_tolerance", "--relative-tolerance"),
        ];
        let scenario = self.base.load_rigid(&taken, &["arm", "impact", "solver"])?;
        let cells = Cells {
            plant: scenario.plant_parameters(),
            relative_tolerance: self.relative_tolerance.unwrap_or(RELATIVE_TOLERANCE),
            mu: self.friction.of(&scenario),
            v_belt_m_s: self.belt.v_belt.values().to_vec(),
            initial: self.initial.initial.list().to_vec(),
            seed: self.initial.seed,
            transient_s: self.recording.transient_s,
            record_s: self.recording.record_s,
        };
        cells.check()?;
        Ok(cells)
    }
}
