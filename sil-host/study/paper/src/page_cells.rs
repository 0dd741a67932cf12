//! The cells of the paper's arm that sections of the page compute, and the options that compute them again.

use painleve_plant::mechanics::PlantParameters;
use painleve_study_core::StudyError;
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::initial::Initial;

use crate::cells::{Cells, RELATIVE_TOLERANCE};

/// Returns the cells of the paper's arm over grids of friction and belt speed.
///
/// # Errors
/// [`StudyError`] if a grid is invalid.
pub fn page_cells(
    page: &PageMaker<'_>,
    mu: &str,
    v_belt: &str,
    initial: &[Initial],
) -> Result<Cells, StudyError> {
    let [transient_s, record_s] = page.fineness.open_loop_s;
    Ok(Cells {
        plant: PlantParameters::default(),
        relative_tolerance: RELATIVE_TOLERANCE,
        mu: page.values(mu)?,
        v_belt_m_s: page.values(v_belt)?,
        initial: initial.to_vec(),
        seed: 1,
        transient_s,
        record_s,
    })
}

/// Formats the options of the cells of a study: the grids as they were written, and the durations.
pub fn cell_options(
    mu: &str,
    v_belt: &str,
    initial: &str,
    [transient_s, record_s]: [f64; 2],
) -> String {
    format!(
        "--mu {mu} --v-belt={v_belt} --initial {initial} --transient-s {transient_s} --record-s {record_s}"
    )
}
