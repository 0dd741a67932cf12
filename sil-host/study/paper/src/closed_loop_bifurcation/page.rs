//! Fig. 12 on the page of figures.

use painleve_study_core::case::{ControllerChoice, ConverterChoice, Reference};
use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section};
use painleve_study_core::figures::page_maker::{PageMaker, section};
use painleve_study_core::initial::Initial;
use painleve_study_core::{StudyError, outcome};

use super::{ClosedLoopBifurcation, ClosedLoopDiagram};
use crate::page_cells::cell_options;
use crate::printed;
use crate::printed::SAMPLED_FRICTION;

/// The hybrid laws over belt speed, with both sets of converters.
///
/// # Errors
/// [`StudyError`] if the study cannot be computed.
pub fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let fineness = page.fineness;
    let [transient_s, record_s] = fineness.closed_loop_s;
    let hardware = ClosedLoopBifurcation {
        controllers: vec![
            ControllerChoice::HybridPaper,
            ControllerChoice::HybridPaperModel,
            ControllerChoice::Hybrid,
        ],
        converters: vec![ConverterChoice::Hardware],
        mu: vec![printed::FRICTION],
        v_belt_m_s: page.values(fineness.closed_loop_v_belt)?,
        initial: vec![Initial::D, Initial::U],
        seed: 1,
        reference: Reference::MinimumJerk(3.0),
        target_m: None,
        transient_s,
        record_s,
        overrides: Vec::new(),
    };
    // As close to the paper as sampling permits; ten times the ticks, so fewer speeds.
    let ideal = ClosedLoopBifurcation {
        controllers: vec![ControllerChoice::HybridPaper],
        converters: vec![ConverterChoice::Ideal],
        v_belt_m_s: page.values(fineness.ideal_v_belt)?,
        initial: vec![Initial::D],
        ..hardware.clone()
    };
    let mut rows = page.rows("Fig. 12: ideal", &ideal)?;
    rows.extend(page.rows("Fig. 12: hardware", &hardware)?);
    let outcome = ClosedLoopDiagram::new(rows);
    let command = |controllers, converters, v_belt, initial| {
        let options = cell_options("0.6", v_belt, initial, fineness.closed_loop_s);
        format!(
            "painleve study closed-loop-bifurcation --controller {controllers} \
             --converters {converters} {options}"
        )
    };
    let commands = vec![
        command("hybrid-paper", "ideal", fineness.ideal_v_belt, "d"),
        command(
            "hybrid-paper,hybrid-paper-model,hybrid",
            "hardware",
            fineness.closed_loop_v_belt,
            "d,u",
        ),
    ];
    Ok(vec![(figure_12(&outcome, commands), Box::new(outcome))])
}

/// Fig. 12.
fn figure_12(outcome: &ClosedLoopDiagram, commands: Vec<String>) -> Section {
    let mut section = section(
        "closed-loop-bifurcation",
        "Fig. 12: belt speed with the controller in the loop",
        commands,
        outcome,
    );
    for cells in &outcome.sections {
        let what = format!(
            "{}, {} converters, from x₀,{}",
            cells.controller,
            outcome::name(&cells.converters),
            cells.initial
        );
        let here = format!(
            "bounces at {} of {} belt speeds, has left the belt at {}",
            cells.bouncing_m_s.len(),
            cells.cells,
            cells.lifted_m_s.len()
        );
        section.comparisons.push(match cells.paper {
            Some(paper) => Comparison::new(&what, paper, here, cells.bouncing_m_s.is_empty()),
            None => Comparison::beyond(&what, here),
        });
    }
    section.reasons.push(SAMPLED_FRICTION.into());
    section
}
