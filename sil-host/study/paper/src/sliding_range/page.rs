//! How far the tip slides under each controller, on the page of figures.

use painleve_shared::Posture;
use painleve_study_core::case::{ControllerChoice, ConverterChoice, Reference};
use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section, Verdict};
use painleve_study_core::figures::page_maker::{PageMaker, section};
use painleve_study_core::{StudyError, outcome};

use super::{Criterion, Row, SlidingRange, SlidingRanges};
use crate::printed;
use crate::printed::SAMPLED_FRICTION;

/// Returns the section on every controller, and on a ramp as reference.
///
/// # Errors
/// [`StudyError`] if the study cannot be computed.
pub fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let [scan_step_m, resolution_m] = page.fineness.sliding_range_m;
    let study = SlidingRange {
        controllers: ControllerChoice::ALL.to_vec(),
        converters: vec![ConverterChoice::Ideal, ConverterChoice::Hardware],
        postures: vec![Posture::ElbowDown, Posture::ElbowUp],
        mu: vec![printed::FRICTION],
        references: vec![Reference::MinimumJerk(3.0)],
        overrides: Vec::new(),
        criterion: Criterion {
            scan_step_m,
            resolution_m,
            ..Criterion::default()
        },
    };
    let ramps = SlidingRange {
        controllers: vec![ControllerChoice::Pid, ControllerChoice::Hybrid],
        converters: vec![ConverterChoice::Ideal],
        postures: vec![Posture::ElbowDown],
        references: vec![Reference::Ramp(2.0), Reference::Ramp(3.0)],
        ..study.clone()
    };
    let mut rows = page.rows("Sliding range", &study)?;
    rows.extend(page.rows("Sliding range, ramps", &ramps)?);
    let outcome = SlidingRanges { rows };
    let commands = [
        "",
        " --controller pid,hybrid --converters ideal --posture elbow-down --reference ramp:2,ramp:3",
    ]
    .map(|cases| {
        format!(
            "painleve study sliding-range{cases} --scan-step-m {scan_step_m} --resolution-m {resolution_m}"
        )
    });
    let commands = commands.to_vec();
    Ok(vec![(ranges(&outcome, commands), Box::new(outcome))])
}

/// Z_t,sliding.
fn ranges(outcome: &SlidingRanges, commands: Vec<String>) -> Section {
    let mut section = section(
        "sliding-range",
        "Section III: how far the tip slides under each controller",
        commands,
        outcome,
    );
    for row in &outcome.rows {
        section.comparisons.push(compared(row));
    }
    section.reasons.push(
        "The position that a controller reaches depends on the reference, which the paper does not give for these numbers: \
         a ramp throws the tip off by the jump of speed at its start, a minimum jerk does not; \
         here it is given in each row, and a target counts as reached when the tip stays within 1 mm of it \
         for 2 s without ever having left the belt."
            .into(),
    );
    section.reasons.push(SAMPLED_FRICTION.into());
    section
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
    let pid_elbow_up = row.controller == ControllerChoice::Pid && row.paper_m.is_none();
    match row.paper_m {
        Some(paper) => Comparison {
            verdict: row.z_sliding_m.map_or(Verdict::FallsShort, |metres| {
                // Compares to the digits that the paper prints.
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
