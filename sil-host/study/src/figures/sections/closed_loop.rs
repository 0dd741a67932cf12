//! The arm with its controllers: Fig. 12, the sliding range, runs over time.

use painleve_chart::PlotError;
use painleve_plant::closed_loop::LoopResult;
use painleve_plant::scenario::Scenario;

use super::section;
use crate::case::Controller;
use crate::figures::page::{Comparison, Section, Verdict};
use crate::outcome;
use crate::sliding_range::{Row, SlidingRanges};
use crate::{closed_loop_bifurcation, paper};

/// Fig. 12.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn diagram(outcome: &closed_loop_bifurcation::Diagram) -> Result<Section, PlotError> {
    let command = "painleve study closed-loop-bifurcation \
                   --controller hybrid-paper,hybrid-paper-model,hybrid --initial d,u"
        .to_owned();
    let mut section = section(
        "closed-loop-bifurcation",
        "Fig. 12: belt speed with the controller in the loop",
        command,
        outcome,
    )?;
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
        section.comparisons.push(
            match paper::closed_loop_bounces(&cells.controller, &cells.initial) {
                Some(paper) => Comparison::new(&what, paper, here, cells.bouncing_m_s.is_empty()),
                None => Comparison::beyond(&what, here),
            },
        );
    }
    section.reasons.push(SAMPLED_FRICTION.into());
    Ok(section)
}

const SAMPLED_FRICTION: &str = "hybrid-paper is the paper's law as it is written, sampled: the friction \
    that it feeds forward is the last sample's, which makes a loop of gain −μ Q₁₂/p per sample. It \
    diverges at any rate of sampling where |μ Q₁₂| > p: elbow down near the edge, elbow up over much of the \
    way. hybrid-paper-model takes the friction of a known belt instead, which is what the continuous law is \
    where its algebraic loop is solved at every instant; hybrid is the law as built in here.";

/// Z_t,sliding.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn sliding_range(outcome: &SlidingRanges) -> Result<Section, PlotError> {
    let mut section = section(
        "sliding-range",
        "Section III: how far each controller slides",
        "painleve study sliding-range".into(),
        outcome,
    )?;
    for row in &outcome.rows {
        section.comparisons.push(compared(row));
    }
    section.reasons.push(
        "What a controller reaches depends on the reference, which the paper does not give for these numbers: \
         a ramp throws the tip off by the jump of speed at its start, a minimum jerk does not; \
         here it is the one of each row, and a target counts as reached when the tip stays within 1 mm of it \
         for 2 s without ever having left the belt."
            .into(),
    );
    section.reasons.push(SAMPLED_FRICTION.into());
    Ok(section)
}

fn compared(row: &Row) -> Comparison {
    let what = format!(
        "{}, {} converters, {}, {}",
        row.controller,
        outcome::name(&row.converters),
        outcome::name(&row.posture),
        row.reference
    );
    let here = row.z_sliding_m.map_or("none".into(), |metres| {
        format!("{metres:.4} m of {:.4} m", row.limit_m)
    });
    let pid_elbow_up = row.controller == Controller::Pid && row.paper_m.is_none();
    match row.paper_m {
        Some(paper) => Comparison {
            verdict: row.z_sliding_m.map_or(Verdict::FallsShort, |metres| {
                // To the digits that the paper prints.
                match metres - paper {
                    difference if difference.abs() <= 5e-4 => Verdict::Agrees,
                    difference if difference > 0.0 => Verdict::Farther,
                    _ => Verdict::FallsShort,
                }
            }),
            paper: format!("{paper} m"),
            what,
            here,
        },
        None if pid_elbow_up => Comparison::new(&what, "none", here, row.z_sliding_m.is_none()),
        None => Comparison::beyond(&what, here),
    }
}

/// One run over time.
pub fn run(scenario: &Scenario, result: &LoopResult, svg: String) -> Section {
    let name = format!("run-{}", scenario.name);
    let paper = match scenario.name.as_str() {
        "pid-elbow-up" => Some(("the tip leaves the belt", result.statistics.lift_offs > 0)),
        "pid-elbow-down" | "hybrid-elbow-down" | "hybrid-elbow-up" => Some((
            "the tip stays on the belt",
            result.statistics.lift_offs == 0,
        )),
        _ => None,
    };
    let here = match result.statistics.first_lift_off_s {
        Some(first_s) => format!(
            "{} lift-offs, the first after {:.0} ms",
            result.statistics.lift_offs,
            1e3 * first_s
        ),
        None => "no lift-off".into(),
    };
    let contact = paper.map(|(paper, agrees)| Comparison::new("contact", paper, here, agrees));
    let end = Comparison::beyond(
        "tip at the end",
        format!(
            "{:.4} m, reference {:.4} m",
            result.final_tip_t_m, result.final_reference_m
        ),
    );
    Section {
        title: format!("Simulation: {}", scenario.name),
        command: format!("painleve run {}", scenario.name),
        comparisons: contact.into_iter().chain([end]).collect(),
        reasons: vec![scenario.description.clone()],
        svg,
        table: None,
        files: vec![format!("{name}.svg")],
        name,
    }
}
