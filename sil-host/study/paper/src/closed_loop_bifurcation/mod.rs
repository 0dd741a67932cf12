//! Fig. 12: the bifurcation diagram with the controller in the loop.
//!
//! Every cell is a closed loop that moves the tip to a target, and then runs
//! through a transient before it is recorded, as in the open loop. Encoders of finite
//! resolution keep the joints trembling, so the largest θ̇1 is never exactly zero: the
//! arm bounces if its tip leaves the belt during the recording.

mod figure;
mod options;
mod outcome;
mod page;

use std::collections::BTreeMap;

use painleve_plant::State;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::mechanics::printed_reach_m;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_plant::statistics::Statistics;
use painleve_shared::{Arm, Posture, range};
use painleve_study_core::case::{self, ControllerChoice, ConverterChoice, Reference};
use painleve_study_core::initial::Initial;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::trial::Trial;
use painleve_study_core::{Study, StudyError, check_rows, combinations, places};
use serde::Serialize;

use crate::attractor::Attractor;
use crate::printed;

pub use options::Options;
pub use outcome::{BeltSpeedSection, ClosedLoopDiagram};

/// Settings of the study: all combinations, the last varying fastest.
#[derive(Clone, Debug)]
pub struct ClosedLoopBifurcation {
    /// Controllers.
    pub controllers: Vec<ControllerChoice>,
    /// Converter sets.
    pub converters: Vec<ConverterChoice>,
    /// Friction coefficients μ.
    pub mu: Vec<f64>,
    /// Belt speeds, m/s.
    pub v_belt_m_s: Vec<f64>,
    /// Initial conditions.
    pub initial: Vec<Initial>,
    /// Seed of the random initial conditions.
    pub seed: u64,
    /// Shape of the reference.
    pub reference: Reference,
    /// Target, m; by default that of the controller's scenario, or the paper's Z_t,sliding for the law and posture.
    pub target_m: Option<f64>,
    /// Transient of a cell before recording starts, s.
    pub transient_s: f64,
    /// Recording time of a cell, s.
    pub record_s: f64,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// Motion of the closed loop in one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Controller.
    pub controller: ControllerChoice,
    /// Converter set.
    pub converters: ConverterChoice,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Initial condition: `a`, `d`, `u` or `random:K`.
    pub initial: String,
    /// Largest θ̇1 during the recording, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// Whether the tip left the belt during the recording.
    pub bouncing: bool,
    /// Fraction of the recording in contact.
    pub contact_fraction: f64,
    /// Number of lift-offs in the whole run.
    pub lift_offs: u64,
    /// Time of the first lift-off, s.
    pub first_lift_off_s: Option<f64>,
    /// Number of the fault latched at the end.
    pub fault: Option<u8>,
    /// Target of the reference, m.
    pub target_m: f64,
    /// Final tip position, m.
    pub tip_t_m: f64,
    /// The paper's result for this law, initial condition, arm, friction and target, if it has one.
    #[serde(skip)]
    pub paper: Option<&'static str>,
}

impl ClosedLoopBifurcation {
    /// Builds every cell once, so that an error is reported before any cell runs.
    ///
    /// # Errors
    /// [`StudyError`] of the first invalid cell.
    pub fn check(&self) -> Result<(), StudyError> {
        check_rows(self)?;
        for index in 0..self.len() {
            Trial::new(&self.scenario(index)?.1)?;
        }
        Ok(())
    }

    /// Returns the numbers of values, of which the first changes fastest from row to row.
    fn counts(&self) -> [usize; 5] {
        [
            self.initial.len(),
            self.v_belt_m_s.len(),
            self.mu.len(),
            self.converters.len(),
            self.controllers.len(),
        ]
    }

    /// Returns the parameters of a row, and its scenario.
    fn scenario(&self, index: usize) -> Result<(LoopCell<'_>, Scenario), StudyError> {
        let [initial, v_belt, mu, converters, controller] = places(index, self.counts());
        let (initial, v_belt_m_s, mu) =
            (self.initial[initial], self.v_belt_m_s[v_belt], self.mu[mu]);
        let (converters, controller) = (self.converters[converters], &self.controllers[controller]);

        let mut overrides = self.overrides.clone();
        overrides.push(format!("belt.friction={mu}"));
        overrides.push(format!(
            "belt.profile={{ kind = \"constant\", speed_m_s = {v_belt_m_s:?} }}"
        ));
        let posture = |state: &State| Posture::of(&theta(state));
        let of_letter = match initial {
            Initial::D => Some(Posture::ElbowDown),
            Initial::U => Some(Posture::ElbowUp),
            Initial::A | Initial::Random(_) => None,
        };
        let guess = of_letter.unwrap_or(Posture::ElbowDown);
        let mut scenario = case::scenario(controller, guess, converters, &overrides)?;
        let mut start_posture = guess;
        if of_letter.is_none() {
            let arm = Arm::new(scenario.arm)?;
            let state = initial.state(&arm, self.seed, index as u64);
            start_posture = posture(&state);
            if start_posture != guess {
                scenario = case::scenario(controller, start_posture, converters, &overrides)?;
            }
            scenario.initial = InitialState::from(&state);
        }
        let own_target_m = match controller {
            ControllerChoice::Scenario(_) => controller.load_unplaced()?.target_m(),
            _ => None,
        };
        let target_m = self.target_m.or(own_target_m).unwrap_or_else(|| {
            let against_belt: f64 = scenario.slip_at_rest().sign();
            against_belt * printed::target_m(controller, start_posture)
        });
        let reach_m = printed_reach_m(&Arm::new(scenario.arm)?);
        range::check("--target-m", target_m, -reach_m, reach_m)?;
        scenario.controller.reference = self.reference.to(target_m);
        let cell = LoopCell {
            controller,
            converters,
            mu,
            v_belt_m_s,
            initial,
            target_m,
        };
        Ok((cell, scenario))
    }
}

struct LoopCell<'a> {
    controller: &'a ControllerChoice,
    converters: ConverterChoice,
    mu: f64,
    v_belt_m_s: f64,
    initial: Initial,
    target_m: f64,
}

impl Study for ClosedLoopBifurcation {
    type Row = Row;

    fn len(&self) -> usize {
        combinations(&self.counts())
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for ClosedLoopBifurcation {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let (cell, scenario) = self.scenario(index)?;
        let failed = |source| StudyError::Plant {
            row: format!(
                "{} at mu = {}, v_belt = {} m/s from {}",
                cell.controller, cell.mu, cell.v_belt_m_s, cell.initial
            ),
            source,
        };
        let mut trial = Trial::on(plants.make(&scenario)?, &scenario)?;
        let ticks = |seconds: f64| (seconds * f64::from(scenario.run.tick_hz)).round() as u64;
        let (mut statistics, mut attractor) = (Statistics::new(0.0), Attractor::default());
        for _ in 0..ticks(self.transient_s) {
            trial.tick(&mut statistics).map_err(failed)?;
        }
        for _ in 0..ticks(self.record_s) {
            let mut both = (&mut statistics, &mut attractor);
            trial.tick(&mut both).map_err(failed)?;
        }
        Ok(Row {
            controller: cell.controller.clone(),
            converters: cell.converters,
            mu: cell.mu,
            v_belt_m_s: cell.v_belt_m_s,
            initial: cell.initial.to_string(),
            max_theta1_dot_rad_s: attractor.max_theta1_dot_rad_s,
            bouncing: attractor.is_bouncing(),
            contact_fraction: attractor.contact_fraction(),
            lift_offs: statistics.lift_offs,
            first_lift_off_s: statistics.first_lift_off_s,
            fault: trial.fault().map(|fault| fault as u8),
            target_m: cell.target_m,
            tip_t_m: trial.tip_t_m(),
            paper: printed::closed_loop_bounces(
                &scenario,
                cell.controller,
                cell.initial,
                cell.target_m,
            ),
        })
    }
}

impl Tabular for ClosedLoopBifurcation {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        let mut seeds = case::noise_seeds(&self.controllers, &self.overrides)?;
        seeds.insert("initial".into(), self.seed);
        Ok(seeds)
    }
}

#[cfg(test)]
mod tests;
