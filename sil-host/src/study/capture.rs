//! Capture: the arm bounces without control, and the controller is switched on at a random phase.

use comfy_table::Table;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

use super::contact_watch::ContactWatch;
use super::distribution::{Percentiles, histogram};
use super::outcome::{self, Outcome};
use super::proportion::Proportion;
use super::trial::Trial;
use super::{Study, StudyError};
use crate::plot::PlotError;
use crate::plot::chart::Chart;
use crate::plot::style::BLUE_INK;
use crate::scenario::Scenario;

/// Time for which the arm bounces at least before it is caught, s.
const BOUNCES_S: f64 = 5.0;
/// Stretch of time within which the controller is switched on, s; many bounces.
const PHASES_S: f64 = 2.0;
/// How long a run goes on from then, s.
const CAUGHT_S: f64 = 2.0;
/// By then the tip must have left the belt for the last time, s.
const LIMIT_S: f64 = 0.5;
/// Time at the end in which the tip must be at its reference, s, and how near, m.
const WATCHED_S: f64 = 0.1;
const WITHIN_M: f64 = 1e-3;

/// What to study.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Seed of all runs.
    pub seed: u64,
    /// Number of runs.
    pub runs: usize,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its number.
    pub index: usize,
    /// When the controller was switched on, s.
    pub enabled_s: f64,
    /// Seed of its noise.
    pub noise_seed: u64,
    /// Time from there to the end of the last flight, s.
    pub capture_s: f64,
    /// Largest distance from the reference at the end, m.
    pub error_m: f64,
    /// Number of the fault that the controller has latched.
    pub fault: Option<u8>,
    /// Where the tip ended, m.
    pub tip_t_m: f64,
    /// Whether the tip was caught in time and held its reference.
    pub success: bool,
    /// Whether the plant could be solved to the end; what else is here is as far as it could.
    pub solved: bool,
}

impl Capture {
    /// The scenario of a run: x0,a, 0.5 % noise of the force cell, no reference but the
    /// place where the tip is caught.
    ///
    /// # Errors
    /// [`StudyError`] if an override is wrong.
    pub fn scenario(&self, index: usize) -> Result<Scenario, StudyError> {
        let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
        generator.set_stream(index as u64);
        let mut scenario = Scenario::load_unplaced("hybrid-elbow-down", &[])?;
        scenario.initial.theta1_deg = 32.0;
        scenario.initial.theta2_deg = 18.27;
        scenario.converters.force.noise_n = 0.1;
        scenario.controller.reference.segments.clear();
        let enable_at_s = BOUNCES_S + generator.random_range(0.0..PHASES_S);
        scenario.controller.enable_at_s = enable_at_s;
        scenario.run.duration_s = enable_at_s + CAUGHT_S;
        scenario.run.seed = generator.random::<u64>() >> 1;
        Ok(scenario.with_overrides("capture", &self.overrides)?)
    }

    /// Makes the first run, so that a wrong override is told before anything runs.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be made.
    pub fn check(&self) -> Result<(), StudyError> {
        Trial::new(&self.scenario(0)?)?;
        Ok(())
    }
}

impl Study for Capture {
    type Row = Row;

    fn len(&self) -> usize {
        self.runs
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let scenario = self.scenario(index)?;
        let enabled_s = scenario.controller.enable_at_s;
        let end_s = scenario.run.duration_s;
        let mut trial = Trial::new(&scenario)?;
        let mut watch = ContactWatch::new(enabled_s, 0.0);
        let mut error_m = 0.0_f64;
        let mut solved = true;
        for _ in 0..scenario.run.ticks() {
            if trial.tick(&mut watch).is_err() {
                solved = false;
                break;
            }
            if trial.time_s() > end_s - WATCHED_S {
                let reference_m = trial.answer().reference_tip.to_metres();
                error_m = error_m.max((trial.tip_t_m() - reference_m).abs());
            }
        }
        let capture_s = watch.last_flight_end_s - enabled_s;
        let fault = trial.fault().map(|fault| fault as u8);
        Ok(Row {
            index,
            enabled_s,
            noise_seed: scenario.run.seed,
            capture_s,
            error_m,
            fault,
            tip_t_m: trial.tip_t_m(),
            success: solved && capture_s <= LIMIT_S && error_m <= WITHIN_M && fault.is_none(),
            solved,
        })
    }
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Captures {
    /// Runs that succeeded.
    pub success: Proportion,
    /// Runs whose plant could not be solved; the distributions are of the others.
    pub unsolved: usize,
    /// Times to capture, s.
    pub capture_s: Option<Percentiles>,
    /// Distances from the reference at the end, m.
    pub error_m: Option<Percentiles>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl Captures {
    /// Of all rows.
    pub fn new(rows: Vec<Row>) -> Self {
        let solved: Vec<&Row> = rows.iter().filter(|row| row.solved).collect();
        let of = |value: fn(&Row) -> f64| {
            let values = solved.iter().map(|row| value(row));
            Percentiles::of(values.collect())
        };
        let successes = rows.iter().filter(|row| row.success).count();
        Self {
            success: Proportion::new(successes, rows.len()),
            unsolved: rows.len() - solved.len(),
            capture_s: of(|row| row.capture_s),
            error_m: of(|row| row.error_m),
            rows,
        }
    }
}

impl Outcome for Captures {
    type Line = Row;

    fn lines(&self) -> Vec<Row> {
        self.rows.clone()
    }

    fn table(&self) -> Table {
        let mut table = outcome::table(["what", "median", "90 %", "99 %", "max"]);
        table.add_row(["success (95 %)", &self.success.to_string(), "", "", ""]);
        if self.unsolved > 0 {
            table.add_row(["unsolved", &self.unsolved.to_string(), "", "", ""]);
        }
        let lines = [
            ("time to capture (ms)", self.capture_s),
            ("error at the end (mm)", self.error_m),
        ];
        for (what, values) in lines {
            if let Some(values) = values {
                let of = [values.median, values.p90, values.p99, values.max];
                let mut line = vec![what.to_string()];
                line.extend(of.map(|value| format!("{:.3}", 1e3 * value)));
                table.add_row(line);
            }
        }
        for row in self.rows.iter().filter(|row| !row.success) {
            let ending = if row.solved { "failed" } else { "unsolved" };
            table.add_row([
                format!("run {} {ending}", row.index),
                format!("on at {} s", row.enabled_s),
                format!("noise {}", row.noise_seed),
                format!("{:.0} ms", 1e3 * row.capture_s),
                format!("{:.2} mm", 1e3 * row.error_m),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        let solved = self.rows.iter().filter(|row| row.solved);
        let times: Vec<f64> = solved.map(|row| row.capture_s).collect();
        let note = "last bar: that long or longer".to_string();
        Chart {
            title: "Capture of the bouncing arm".into(),
            subtitle: format!("caught within 0.5 s and held (95 %): {}", self.success),
            x_title: "Time from enabling to the last landing (s)".into(),
            x: Some(0.0..0.6),
            panels: vec![histogram("Runs", note, BLUE_INK, 0.6, &times)],
        }
        .svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bouncing_arms_are_caught_alike_on_any_number_of_threads() {
        let study = Capture {
            seed: 1,
            runs: 6,
            overrides: Vec::new(),
        };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap()
                .install(|| super::super::rows(&study, || ()).unwrap())
        };
        let found = on(1);
        assert_eq!(found, on(2));
        let captures = Captures::new(found);
        assert!(captures.success.successes >= 5, "{}", captures.table());
        assert!(captures.rows.iter().any(|row| row.capture_s > 0.0));
    }

    #[test]
    fn an_arm_without_torque_is_not_caught() {
        let study = Capture {
            seed: 1,
            runs: 1,
            overrides: vec!["controller.torque_limit_nm=0".into()],
        };
        let row = study.row(0).unwrap();
        assert!(!row.success && row.capture_s > LIMIT_S, "{row:?}");
    }

    #[test]
    fn a_run_that_cannot_be_solved_is_counted_and_none_of_the_others_is_lost() {
        let unsolvable = [
            "belt.friction=10",
            "arm.stiffness_nm_rad=189.7",
            "arm.damping_nms_rad=10",
            "initial.theta1_deg=28.0864",
            "initial.theta2_deg=-24.0783",
            "solver.chatter_speed_m_s=1e-8",
        ];
        let study = Capture {
            seed: 1,
            runs: 1,
            overrides: unsolvable.map(String::from).into(),
        };
        let mut rows = super::super::rows(&study, || ()).unwrap();
        assert!(!rows[0].solved && !rows[0].success, "{rows:?}");
        let caught = Row {
            solved: true,
            success: true,
            capture_s: 0.2,
            ..rows[0].clone()
        };
        rows.push(caught);
        let captures = Captures::new(rows);
        assert_eq!((captures.unsolved, captures.success.successes), (1, 1));
        assert_eq!(captures.capture_s.map(|times| times.count), Some(1));
    }
}
