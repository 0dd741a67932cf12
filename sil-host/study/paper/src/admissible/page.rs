//! Table II on the page of figures.

use painleve_plant::mechanics::PlantParameters;
use painleve_shared::Slip;
use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section};
use painleve_study_core::figures::page_maker::{PageMaker, section};
use painleve_study_core::{Study, StudyError};

use super::{Admissible, AdmissibleStudy, Intervals};
use crate::printed;

/// Table II with the paper's arm.
///
/// # Errors
/// [`StudyError`] if it cannot be drawn.
pub fn sections(_: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let study = AdmissibleStudy {
        arm: PlantParameters::default().arm,
        mu: printed::FRICTION,
        slip: Slip::Positive,
    };
    let outcome = study.row(0)?;
    Ok(vec![(table_2(&outcome), Box::new(outcome))])
}

/// Table II.
fn table_2(outcome: &Admissible) -> Section {
    let command = format!("painleve study admissible --mu {}", outcome.mu);
    let mut section = section(
        "admissible",
        "Table II: admissible configurations",
        vec![command],
        outcome,
    );
    for (name, intervals) in [
        ("elbow up", &outcome.elbow_up),
        ("elbow down", &outcome.elbow_down),
    ] {
        let ours: Vec<String> = intervals
            .intervals_m
            .iter()
            .map(|[from, to]| format!("{from:.5} … {to:.5} m"))
            .collect();
        let Some([from, to]) = intervals.paper_m else {
            section
                .comparisons
                .push(Comparison::beyond(name, ours.join(", ")));
            continue;
        };
        section.comparisons.push(Comparison::new(
            &format!("p > 0, {name}"),
            format!("{from} … {to} m"),
            ours.join(", "),
            // Compares to the digits that the paper prints.
            intervals
                .difference_m
                .is_some_and(|metres| metres.abs() <= 5e-4),
        ));
        section
            .reasons
            .extend(slip_of_the_pen(name, outcome.mu, intervals));
    }
    section.comparisons.push(Comparison::new(
        "least friction with the paradox",
        "0.4, in steps of 0.1",
        format!("{:.6}", outcome.critical_friction),
        ((outcome.critical_friction * 10.0).ceil() / 10.0 - 0.4).abs() < 1e-9,
    ));
    section.reasons.push(
        "p depends on the posture alone; its zeros are bisected to rounding along a curve on which \
         it is analytic."
            .into(),
    );
    section
}

fn slip_of_the_pen(name: &str, mu: f64, intervals: &Intervals) -> Option<String> {
    let fits = intervals.paper_fits.filter(|fits| fits.mu != mu)?;
    let [_, paper] = intervals.paper_m?;
    Some(format!(
        "{name}: the paper prints {paper} m. That is its value at μ = {}, where the interval ends at \
         {:.5} m, not at μ = {mu}.",
        fits.mu, fits.to_m
    ))
}
