//! Shared by the sections of the page: resolution, and computation with progress.

use super::page::Section;
use crate::outcome::{Figure, Outcome};
use crate::{Grid, Study, StudyError, rows};

/// Resolution of the page: grids of friction and belt speed, transients and recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Friction coefficients of the map.
    pub map_mu: &'static str,
    /// Belt speeds of the map, m/s.
    pub map_v_belt: &'static str,
    /// Belt speeds of the section, m/s.
    pub section_v_belt: &'static str,
    /// Belt speeds of the Poincaré section, m/s.
    pub poincare_v_belt: &'static str,
    /// Belt speeds with the controller in the loop, m/s.
    pub closed_loop_v_belt: &'static str,
    /// Belt speeds with the controller in the loop and ideal converters, m/s.
    pub ideal_v_belt: &'static str,
    /// Transient and recording time without control, s.
    pub open_loop_s: [f64; 2],
    /// Transient and recording time with control, s.
    pub closed_loop_s: [f64; 2],
    /// Spacing of the targets tried first, and accuracy of the sliding range, m.
    pub sliding_range_m: [f64; 2],
}

impl Fineness {
    /// The paper's steps, and its durations in the open loop.
    pub const FULL: Self = Self {
        map_mu: "0.1:1:0.1",
        map_v_belt: "-1:-0.1:0.005",
        section_v_belt: "-1:-0.1:0.005",
        poincare_v_belt: "-0.6:-0.28:0.001",
        closed_loop_v_belt: "-1:-0.1:0.005",
        ideal_v_belt: "-1:-0.1:0.025",
        open_loop_s: [250.0, 50.0],
        closed_loop_s: [20.0, 10.0],
        sliding_range_m: [5e-3, 1e-4],
    };

    /// Coarse grids and short runs, for a preview.
    pub const DRAFT: Self = Self {
        map_mu: "0.2:1:0.2",
        map_v_belt: "-1:-0.1:0.1",
        section_v_belt: "-1:-0.1:0.05",
        poincare_v_belt: "-0.6:-0.28:0.04",
        closed_loop_v_belt: "-1:-0.1:0.3",
        ideal_v_belt: "-0.4",
        open_loop_s: [60.0, 10.0],
        closed_loop_s: [5.0, 1.0],
        sliding_range_m: [5e-2, 5e-3],
    };
}

/// Called after every row.
pub type RowDone = Box<dyn Fn() + Sync>;

/// Computes the rows of the page's sections.
pub struct PageMaker<'a> {
    /// Resolution of the page.
    pub fineness: &'a Fineness,
    /// Starts a progress display with the title of a study and its number of rows.
    pub progress: &'a (dyn Fn(&str, usize) -> RowDone + Sync),
}

impl PageMaker<'_> {
    /// Returns all rows of a study, computed on the threads of the current rayon pool.
    ///
    /// # Errors
    /// The error of the first row that fails.
    pub fn rows<S: Study>(&self, title: &str, study: &S) -> Result<Vec<S::Row>, StudyError> {
        rows(study, (self.progress)(title, study.len()))
    }

    /// Returns the values of a grid.
    ///
    /// # Errors
    /// [`StudyError`] if the grid is invalid.
    pub fn values(&self, grid: &str) -> Result<Vec<f64>, StudyError> {
        Ok(grid
            .parse::<Grid>()
            .map_err(StudyError::Grid)?
            .values()
            .to_vec())
    }
}

/// Creates the common part of a section.
pub fn section<O: Outcome + Figure>(
    name: &str,
    title: &str,
    commands: Vec<String>,
    outcome: &O,
) -> Section {
    Section {
        name: name.into(),
        title: title.into(),
        commands,
        svg: outcome.svg(),
        table: Some(outcome.table()),
        files: ["svg", "csv", "json"]
            .map(|ending| format!("{name}.{ending}"))
            .to_vec(),
        ..Section::default()
    }
}
