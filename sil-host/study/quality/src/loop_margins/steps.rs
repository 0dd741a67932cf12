//! Steps of the closed loop: of the reference along the belt, and of a load on the tip.

use painleve_firmware::refer::reference::Segment;
use painleve_plant::scenario::Scenario;
use serde::Serialize;

use super::at_rest::AtRest;
use painleve_study_core::StudyError;
use painleve_study_core::trial::Trial;

/// Height of the step of the reference, m, and of the load, N.
const STEP_M: f64 = 1e-3;
const LOAD_N: f64 = 1.0;
/// Time before the step of the reference, and time that is watched, s.
const BEFORE_S: f64 = 4.0;
const WATCHED_S: f64 = 1.0;
/// Distance from the end of a step within which it has settled, as a part of its height.
const SETTLED: f64 = 0.02;
/// Every which point of a curve is kept.
const STRIDE: usize = 4;

/// A step and what becomes of it.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// `position`: 1 mm of the reference. `force`: the normal force under a load of 1 N on the tip.
    pub name: &'static str,
    /// Time from a tenth to nine tenths of the step, ms; of the reference only.
    pub rise_ms: Option<f64>,
    /// How far the response goes beyond the step, or how large the error by the load becomes, in steps.
    pub overshoot: f64,
    /// Time after which it stays within 2 % of the step, ms; absent if it does not within a second.
    pub settled_ms: Option<f64>,
    /// The response in steps, over time in s.
    pub curve: Curve,
}

/// Points of a curve: time, s, and value.
pub type Curve = Vec<(f64, f64)>;

/// Returns both steps.
pub(super) fn steps(
    scenario: &Scenario,
    at_rest: &AtRest,
    tip_m: f64,
) -> Result<Vec<Step>, StudyError> {
    let mut steps = vec![reference_step(scenario, tip_m)?];
    if at_rest.name(1) == "force" {
        steps.push(load_step(at_rest)?);
    }
    Ok(steps)
}

fn reference_step(scenario: &Scenario, tip_m: f64) -> Result<Step, StudyError> {
    // Away from the nearer edge.
    let to_m = tip_m - STEP_M.copysign(tip_m);
    let mut scenario = scenario.clone();
    let target = |target_m: f64| target_m as f32;
    scenario.controller.reference.segments = [
        Segment::Ramp {
            target_m: target(tip_m),
            duration_s: 1e-3,
        },
        Segment::Hold {
            duration_s: BEFORE_S as f32,
        },
        Segment::Step {
            target_m: target(to_m),
            duration_s: 0.0,
        },
    ]
    .into_iter()
    .collect();
    let mut trial = Trial::new(&scenario)?;
    let (mut from_m, mut step_s, mut values) = (tip_m, None, Vec::new());
    // Arming takes some ticks: the step is where the reference has it.
    while step_s.is_none_or(|step_s| trial.time_s() < step_s + WATCHED_S)
        && trial.time_s() < BEFORE_S + 3.0
    {
        trial.tick(&mut ()).map_err(|source| StudyError::Plant {
            row: format!("a step at {tip_m} m"),
            source,
        })?;
        let reference_m = trial.answer().reference_tip.to_metres();
        // The first motion may start near the end of the step.
        let is_later = trial.time_s() > 0.5 * BEFORE_S;
        if step_s.is_none() && is_later && (reference_m - to_m).abs() < 0.5 * STEP_M {
            step_s = Some(trial.time_s());
            from_m = trial.tip_t_m();
        }
        if step_s.is_some() {
            values.push((trial.tip_t_m() - from_m) / (to_m - from_m));
        }
    }
    let tick_s = 1.0 / f64::from(scenario.run.tick_hz);
    let first = |level: f64| values.iter().position(|value| *value >= level);
    let rise = first(0.1).zip(first(0.9));
    Ok(Step {
        name: "position",
        rise_ms: rise.map(|(from, to)| 1e3 * tick_s * (to - from) as f64),
        overshoot: values.iter().copied().fold(0.0, f64::max) - 1.0,
        settled_ms: settled_ms(&values, 1.0, tick_s),
        curve: curve(&values, tick_s),
    })
}

fn load_step(at_rest: &AtRest) -> Result<Step, StudyError> {
    let ticks = (WATCHED_S * at_rest.tick_hz()) as usize;
    let run = |load_n: f64| {
        let recorded = at_rest.run(1, 0, ticks, |_| load_n);
        recorded.map_err(|source| StudyError::Plant {
            row: "a load on the tip".into(),
            source,
        })
    };
    let (loaded, free) = (run(-LOAD_N)?, run(0.0)?);
    let values = loaded.iter().zip(&free);
    let values: Vec<f64> = values
        .map(|(loaded, free)| (loaded.force_n - free.force_n) / LOAD_N)
        .collect();
    let tick_s = 1.0 / at_rest.tick_hz();
    Ok(Step {
        name: "force",
        rise_ms: None,
        overshoot: values
            .iter()
            .fold(0.0, |most: f64, value| most.max(value.abs())),
        settled_ms: settled_ms(&values, 0.0, tick_s),
        curve: curve(&values, tick_s),
    })
}

fn settled_ms(values: &[f64], end: f64, tick_s: f64) -> Option<f64> {
    let last_outside = values
        .iter()
        .rposition(|value| (value - end).abs() > SETTLED);
    let settled = last_outside.map_or(0, |tick| tick + 1);
    (settled < values.len()).then_some(1e3 * tick_s * settled as f64)
}

fn curve(values: &[f64], tick_s: f64) -> Curve {
    let points = values.iter().enumerate().step_by(STRIDE);
    points
        .map(|(tick, value)| (tick_s * tick as f64, *value))
        .collect()
}
