//! Fig. 5 on the page of figures.

use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section};
use painleve_study_core::figures::page_maker::{PageMaker, section};
use painleve_study_core::initial::Initial;
use painleve_study_core::{StudyError, outcome};

use super::{Poincare, PoincareDiagram};
use crate::page_cells::{cell_options, page_cells};

/// Fig. 5 at the paper's friction.
///
/// # Errors
/// [`StudyError`] if the figure cannot be computed.
pub fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let cells = page_cells(page, "0.6", page.fineness.poincare_v_belt, &[Initial::A])?;
    let study = Poincare { cells };
    let outcome = PoincareDiagram::new(&study, page.rows("Fig. 5: Poincaré", &study)?);
    let options = cell_options(
        "0.6",
        page.fineness.poincare_v_belt,
        "a",
        page.fineness.open_loop_s,
    );
    let command = format!("painleve study poincare {options}");
    Ok(vec![(figure_5(&outcome, command), Box::new(outcome))])
}

/// Fig. 5.
fn figure_5(outcome: &PoincareDiagram, command: String) -> Section {
    let mut section = section(
        "poincare",
        "Fig. 5: periodic and chaotic bouncing",
        vec![command],
        outcome,
    );
    let mut counts: Vec<(String, usize)> = Vec::new();
    for stretch in &outcome.stretches {
        let name = outcome::name(&stretch.regime);
        match counts.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += stretch.cells,
            None => counts.push((name, stretch.cells)),
        }
    }
    let words: Vec<String> = counts
        .iter()
        .map(|(name, count)| format!("{name} at {count}"))
        .collect();
    let has = |name: &str| {
        counts
            .iter()
            .any(|(known, count)| known == name && *count > 0)
    };
    section.comparisons.push(Comparison::new(
        "motion within the window",
        "periodic at some belt speeds, chaotic at others",
        format!("{} belt speeds", words.join(", ")),
        has("periodic") && has("chaotic"),
    ));
    section.reasons.push(
        "The paper does not state its criterion for chaos; here it is the sign of the largest Lyapunov exponent \
         across the flow, through the saltation matrices of the impacts."
            .into(),
    );
    section
}
