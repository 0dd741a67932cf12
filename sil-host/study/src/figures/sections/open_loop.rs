//! The arm on its own: Table II and Fig. 3 to 5.

use painleve_chart::PlotError;

use super::section;
use crate::admissible::{Admissible, Intervals};
use crate::figures::page::{Comparison, Section};
use crate::outcome;
use crate::regions::{Map, Regions};
use crate::{bifurcation, paper, poincare};

/// Table II.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn admissible(outcome: &Admissible) -> Result<Section, PlotError> {
    let command = format!("painleve study admissible --mu {}", outcome.mu);
    let mut section = section(
        "admissible",
        "Table II: admissible configurations",
        command,
        outcome,
    )?;
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
            // To the digits that the paper prints.
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
    Ok(section)
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

/// Fig. 3.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn regions(outcome: &Regions) -> Result<Section, PlotError> {
    let command = format!("painleve study regions --mu {}", outcome.mu);
    let mut section = section("regions", "Fig. 3: solution modes", command, outcome)?;
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
            "b is no mirror image, because the spring between the links is at rest {:.2}° off the \
             straight arm: {} of one map is inconsistent, {} of the mirrored one. The paper's text gives \
             no numbers for this figure.",
            outcome.spring_rest_deg(),
            percent(one.inconsistent),
            percent(other.inconsistent),
        ));
    }
    Ok(section)
}

/// Fig. 4.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn bifurcation_section(outcome: &bifurcation::Diagram) -> Result<Section, PlotError> {
    let settings = outcome.settings();
    let command = format!(
        "painleve study bifurcation --mu {} --initial a,d --transient-s {} --record-s {}",
        list(&settings.mu),
        settings.transient_s,
        settings.record_s
    );
    let mut section = section(
        "bifurcation-section",
        "Fig. 4: bouncing over belt speed",
        command,
        outcome,
    )?;
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
        "The paper names no impact law, and the edges of the window depend on it: Routh's impulse \
         process with Poisson restitution 0.10 has the paper's window to within a step or two of 0.005 m/s."
            .into(),
    );
    Ok(section)
}

/// The paper's two-dimensional diagram.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn bifurcation_map(outcome: &bifurcation::Diagram) -> Result<Section, PlotError> {
    let settings = outcome.settings();
    let command = format!(
        "painleve study bifurcation --mu {} --initial a",
        list(&settings.mu)
    );
    let mut section = section(
        "bifurcation",
        "Bouncing over friction and belt speed",
        command,
        outcome,
    )?;
    let (bouncing, quiet): (Vec<&bifurcation::Window>, Vec<&bifurcation::Window>) = outcome
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
    // The window proper, without belt speeds at which the arm bounces all by itself.
    let widest = |window: &&bifurcation::Window| {
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
        let [paper_from, paper_to] = paper::BOUNCING_M_S;
        let spread = (from.1 - from.0).max(to.1 - to.0);
        section.comparisons.push(Comparison::new(
            "window at every μ with bounces",
            format!("{paper_from} … {paper_to} m/s, the same for all"),
            format!(
                "{} … {} m/s, differing by at most {spread:.3} m/s",
                from.0, to.1
            ),
            spread <= 0.015 + 1e-9 && within(&[[from.0, to.1]], paper::BOUNCING_M_S, 0.015),
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
                &format!("bounces outside of the window at μ = {}", window.mu),
                stretches(&lonely),
            ));
        }
    }
    Ok(section)
}

/// Fig. 5.
///
/// # Errors
/// [`PlotError`] if the figure cannot be drawn.
pub fn poincare(outcome: &poincare::Diagram) -> Result<Section, PlotError> {
    let settings = outcome.settings();
    let command = format!("painleve study poincare --mu {}", list(&settings.mu));
    let mut section = section(
        "poincare",
        "Fig. 5: periodic and chaotic bouncing",
        command,
        outcome,
    )?;
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
        "The paper does not say how it tells chaos; here it is the sign of the largest Lyapunov exponent \
         across the flow, through the saltation matrices of the impacts."
            .into(),
    );
    Ok(section)
}

fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(ToString::to_string).collect();
    words.join(",")
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

/// Whether the outer ends of some stretches are those of one interval, within a tolerance.
fn within(speeds: &[[f64; 2]], [from, to]: [f64; 2], tolerance: f64) -> bool {
    match (speeds.first(), speeds.last()) {
        // A little more than the tolerance, for the rounding of both.
        (Some(first), Some(last)) => {
            (first[0] - from).abs() <= tolerance + 1e-9 && (last[1] - to).abs() <= tolerance + 1e-9
        }
        _ => false,
    }
}
