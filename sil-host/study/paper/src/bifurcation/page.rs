//! Fig. 4 and the map over friction on the page of figures.

use painleve_study_core::StudyError;
use painleve_study_core::catalogue::PageSection;
use painleve_study_core::figures::page::{Comparison, Section};
use painleve_study_core::figures::page_maker::{PageMaker, section};
use painleve_study_core::initial::Initial;

use super::{Bifurcation, BifurcationDiagram, Window};
use crate::page_cells::{cell_options, page_cells};
use crate::printed;

/// A section at the paper's friction, and a map over friction and belt speed.
///
/// # Errors
/// [`StudyError`] if a diagram cannot be computed.
pub fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
    let fineness = page.fineness;
    let cells = page_cells(
        page,
        "0.6",
        fineness.section_v_belt,
        &[Initial::A, Initial::D],
    )?;
    let study = Bifurcation { cells };
    let section = BifurcationDiagram::new(&study, page.rows("Fig. 4: section", &study)?);
    let cells = page_cells(page, fineness.map_mu, fineness.map_v_belt, &[Initial::A])?;
    let study = Bifurcation { cells };
    let map = BifurcationDiagram::new(&study, page.rows("Friction and belt speed", &study)?);
    let command = |mu, v_belt, initial| {
        let options = cell_options(mu, v_belt, initial, fineness.open_loop_s);
        format!("painleve study bifurcation {options}")
    };
    let section_command = command("0.6", fineness.section_v_belt, "a,d");
    let map_command = command(fineness.map_mu, fineness.map_v_belt, "a");
    Ok(vec![
        (
            bifurcation_section(&section, section_command),
            Box::new(section),
        ),
        (bifurcation_map(&map, map_command), Box::new(map)),
    ])
}

/// Fig. 4.
fn bifurcation_section(outcome: &BifurcationDiagram, command: String) -> Section {
    let mut section = section(
        "bifurcation-section",
        "Fig. 4: bouncing over belt speed",
        vec![command],
        outcome,
    );
    for window in &outcome.windows {
        let speeds = stretches(&window.v_belt_m_s);
        match (window.initial.as_str(), window.paper_m_s) {
            ("a", Some([from, to])) => section.comparisons.push(Comparison::new(
                &format!("bounces from x₀,a at μ = {}", window.mu),
                format!("{from} … {to} m/s"),
                speeds,
                within(&window.v_belt_m_s, [from, to], 0.01),
            )),
            ("d", _) => section.comparisons.push(Comparison::new(
                &format!("bounces from x₀,d at μ = {}", window.mu),
                "none",
                speeds,
                window.v_belt_m_s.is_empty(),
            )),
            (initial, _) => section.comparisons.push(Comparison::beyond(
                &format!("bounces from {initial} at μ = {}", window.mu),
                speeds,
            )),
        }
    }
    section.reasons.push(
        "The paper does not name its impact law, and the edges of the window depend on it: Routh's impulse \
         process with Poisson restitution 0.10 reproduces the paper's window to within a step or two of 0.005 m/s."
            .into(),
    );
    section
}

/// The paper's two-dimensional diagram.
fn bifurcation_map(outcome: &BifurcationDiagram, command: String) -> Section {
    let mut section = section(
        "bifurcation",
        "Bouncing over friction and belt speed",
        vec![command],
        outcome,
    );
    let (bouncing, quiet): (Vec<&Window>, Vec<&Window>) = outcome
        .windows
        .iter()
        .partition(|window| !window.v_belt_m_s.is_empty());
    let least = bouncing.iter().map(|window| window.mu).reduce(f64::min);
    section.comparisons.push(Comparison::new(
        "least μ of the grid with bounces",
        "0.4",
        least.map_or("none".into(), |mu| mu.to_string()),
        least == Some(0.4) && quiet.iter().all(|window| window.mu < 0.4),
    ));
    // The main window, without belt speeds at which the arm bounces in isolation.
    let widest = |window: &&Window| {
        let width = |stretch: &[f64; 2]| stretch[1] - stretch[0];
        let stretches = window.v_belt_m_s.iter().copied();
        stretches.max_by(|one, other| width(one).total_cmp(&width(other)))
    };
    let windows: Vec<[f64; 2]> = bouncing.iter().filter_map(widest).collect();
    let ends = |end: usize| {
        let ends = windows.iter().map(|window| window[end]);
        ends.clone().reduce(f64::min).zip(ends.reduce(f64::max))
    };
    if let (Some(from), Some(to)) = (ends(0), ends(1)) {
        let [paper_from, paper_to] = printed::BOUNCING_M_S;
        let spread = (from.1 - from.0).max(to.1 - to.0);
        section.comparisons.push(Comparison::new(
            "window at every μ with bounces",
            format!("{paper_from} … {paper_to} m/s, the same for all"),
            format!(
                "{} … {} m/s, differing by at most {spread:.3} m/s",
                from.0, to.1
            ),
            spread <= 0.015 + 1e-9 && within(&[[from.0, to.1]], printed::BOUNCING_M_S, 0.015),
        ));
    }
    for window in &bouncing {
        let lonely: Vec<[f64; 2]> = window
            .v_belt_m_s
            .iter()
            .copied()
            .filter(|stretch| Some(*stretch) != widest(window))
            .collect();
        if !lonely.is_empty() {
            section.comparisons.push(Comparison::beyond(
                &format!("bounces outside the window at μ = {}", window.mu),
                stretches(&lonely),
            ));
        }
    }
    section
}

fn stretches(speeds: &[[f64; 2]]) -> String {
    if speeds.is_empty() {
        return "none".into();
    }
    let words: Vec<String> = speeds
        .iter()
        .map(|[from, to]| format!("{from} … {to} m/s"))
        .collect();
    words.join(", ")
}

/// Whether the outer ends of several intervals agree within a tolerance.
fn within(speeds: &[[f64; 2]], [from, to]: [f64; 2], tolerance: f64) -> bool {
    match (speeds.first(), speeds.last()) {
        // Slightly more than the tolerance, for the rounding of both.
        (Some(first), Some(last)) => {
            (first[0] - from).abs() <= tolerance + 1e-9 && (last[1] - to).abs() <= tolerance + 1e-9
        }
        _ => false,
    }
}
