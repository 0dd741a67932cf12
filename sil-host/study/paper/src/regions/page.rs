//! Fig. 3 on the page of figures.

use painleve_plant::mechanics::PlantParameters;
use painleve_shared::Slip;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section};
use painleve_study_core::figures::page_maker::{PageMaker, section};

use super::{Map, Regions, RegionsStudy, Theta2, half_degrees};
use crate::printed;

/// Fig. 3 with the paper's arm.
///
/// # Errors
/// [`StudyError`] if the study cannot be computed.
pub fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let arm = PlantParameters::default().arm;
    let settings = RegionsStudy {
        arm,
        mu: printed::FRICTION,
        theta1_deg: half_degrees(&arm)?,
        theta1_dot_rad_s: "-8:8:0.2".parse().map_err(StudyError::Grid)?,
        theta2: vec![Theta2::Positive, Theta2::Negative],
        slips: vec![Slip::Positive, Slip::Negative],
    };
    let maps = page.rows("Fig. 3: regions", &settings)?;
    let outcome = Regions::new(&settings, maps);
    Ok(vec![(figure_3(&outcome), Box::new(outcome))])
}

/// Fig. 3.
fn figure_3(outcome: &Regions) -> Section {
    let command = format!("painleve study regions --mu {}", outcome.mu);
    let mut section = section("regions", "Fig. 3: solution modes", vec![command], outcome);
    let has_all = |map: &&Map| {
        let parts = [map.sliding, map.flight, map.indeterminate, map.inconsistent];
        parts.iter().all(|part| *part > 0.0)
    };
    let percent = |part: f64| format!("{:.1} %", 100.0 * part);
    if let Some(map) = outcome.maps.iter().find(has_all) {
        section.comparisons.push(Comparison::new(
            "modes on one map",
            "sliding, flight, indeterminate, inconsistent",
            format!(
                "sliding {}, flight {}, indeterminate {}, inconsistent {}",
                percent(map.sliding),
                percent(map.flight),
                percent(map.indeterminate),
                percent(map.inconsistent)
            ),
            true,
        ));
    }
    let zeros = |map: &Map| -> Vec<f64> { map.p_zero_theta1_deg.clone() };
    let with_paradox: Vec<&Map> = outcome
        .maps
        .iter()
        .filter(|map| !map.p_zero_theta1_deg.is_empty())
        .collect();
    if let [one, other] = with_paradox[..] {
        let mirrored: Vec<f64> = zeros(other).iter().rev().map(|zero| -zero).collect();
        let words = |zeros: &[f64]| {
            let words: Vec<String> = zeros.iter().map(|zero| format!("{zero:.3}°")).collect();
            words.join(" and ")
        };
        let agrees = zeros(one).len() == mirrored.len()
            && zeros(one)
                .iter()
                .zip(&mirrored)
                .all(|(zero, mirrored)| (zero - mirrored).abs() < 1e-9);
        section.comparisons.push(Comparison::new(
            "p = 0 in the two directions of slip",
            "mirror images of each other",
            format!("θ₁ = {}; θ₁ = {}", words(&zeros(one)), words(&zeros(other))),
            agrees,
        ));
        section.reasons.push(format!(
            "b is not a mirror image, because the spring between the links is at rest {:.2}° off the \
             straight arm: {} of one map is inconsistent, {} of the mirrored one. The paper's text gives \
             no numbers for this figure.",
            outcome.arm.spring_rest_rad[1].to_degrees().abs(),
            percent(one.inconsistent),
            percent(other.inconsistent),
        ));
    }
    section
}
