//! The section of one run over time.

use painleve_plant::closed_loop::LoopResult;
use painleve_plant::scenario::Scenario;

use super::page::{Comparison, Section};

/// Returns the section of one run over time.
pub fn section(scenario: &Scenario, result: &LoopResult, svg: String) -> Section {
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
        match result.final_reference_m {
            Some(reference_m) => format!(
                "{:.4} m, reference {reference_m:.4} m",
                result.final_tip_t_m
            ),
            None => format!("{:.4} m", result.final_tip_t_m),
        },
    );
    Section {
        title: format!("Simulation: {}", scenario.name),
        commands: vec![format!("painleve run {}", scenario.name)],
        comparisons: contact.into_iter().chain([end]).collect(),
        reasons: vec![scenario.description.clone()],
        svg,
        table: None,
        files: vec![format!("{name}.svg")],
        name,
    }
}
