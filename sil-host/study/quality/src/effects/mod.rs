//! How often the tip is kept on the belt, and where it ends, against the level of each effect of a real rig that the paper's arm lacks.
//!
//! Every cell (controller, contact, effect, level) runs the same random closed loops: an exactly known
//! arm, friction 0.3 … 0.9, belt 0.1 … 1 m/s, either posture, 1 kHz, encoders of 14 bits, force and
//! torque of 12 bits, one sample of delay, half of the targets up to 20 mm beyond the edge. Each run is
//! judged as in the [`robustness`](crate::robustness) campaign.

mod draw;
mod effect;
mod figure;
mod list;
mod options;
mod outcome;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use painleve_plant::mechanics::BuiltInPlant;
use painleve_shared::Posture;
use painleve_study_core::case::ControllerChoice;
use painleve_study_core::loop_study::{LoopStudy, MakePlant};
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Study, StudyError};
use serde::Serialize;

use crate::robustness::{Criterion, Ending, judge};

pub use effect::{Contact, RigEffect};
pub use list::{EFFECTS, find};
pub use options::Options;
pub use outcome::{EffectsOutcome, LevelSuccess};

/// The keys that the study draws for every run.
pub const FIXED: [&str; 3] = ["initial", "controller.reference", "run.duration_s"];

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct EffectsStudy {
    /// The controllers.
    pub controllers: Vec<ControllerChoice>,
    /// The contacts.
    pub contacts: Vec<Contact>,
    /// The names of the effects; no effect at all comes first.
    pub effects: Vec<&'static str>,
    /// Levels of the effects after the first, in place of their own; empty for their own.
    pub levels: Vec<f64>,
    /// Seed of all runs.
    pub seed: u64,
    /// What counts as a success.
    pub criterion: Criterion,
    /// Runs of each cell.
    pub runs: usize,
    /// Overrides applied to every scenario after those of the effect.
    pub overrides: Vec<String>,
}

/// Controller, contact, effect and level of one cell.
#[derive(Clone, Copy)]
pub struct EffectCell<'a> {
    /// The controller.
    pub controller: &'a ControllerChoice,
    /// The contact.
    pub contact: Contact,
    /// The effect.
    pub effect: &'static RigEffect,
    /// Its level.
    pub level: f64,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The controller.
    pub controller: String,
    /// The contact.
    pub contact: Contact,
    /// The effect.
    pub effect: &'static str,
    /// Its level, in the effect's unit.
    pub level: f64,
    /// Number of the run in its cell; runs of equal numbers have equal arms, belts and references.
    pub run: usize,
    /// Ending of the run.
    pub ending: Ending,
    /// Number of the latched fault.
    pub fault: Option<u8>,
    /// Number of lift-offs after the capture.
    pub lift_offs: u64,
    /// Largest final distance from the governed reference, m.
    pub error_m: f64,
    /// How far the tip is before the edge p = 0 towards the target, m; negative beyond it, null unless such an edge, and
    /// not the end of the reach or another limit of the governor, holds the reference back.
    pub to_edge_m: Option<f64>,
    /// p in the arm's final posture as a fraction of Q22.
    pub p_ratio: f64,
    /// Final tip position, m.
    pub tip_t_m: f64,
    /// Target of the reference, m; null without one.
    pub target_m: Option<f64>,
    /// Initial posture.
    pub posture: Posture,
    /// Friction coefficient μ of the belt.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
}

impl EffectsStudy {
    /// Returns every cell, in the order of the rows.
    pub fn cells(&self) -> Vec<EffectCell<'_>> {
        let mut cells = Vec::new();
        for controller in &self.controllers {
            for &contact in &self.contacts {
                for effect in self.effects.iter().filter_map(|name| find(name)) {
                    let levels = self.levels_of(effect).into_iter();
                    let levels = levels.filter(|_| effect.acts_on(contact));
                    cells.extend(levels.map(|level| EffectCell {
                        controller,
                        contact,
                        effect,
                        level,
                    }));
                }
            }
        }
        cells
    }

    /// Returns the levels of an effect, from harmless to harmful.
    fn levels_of(&self, effect: &RigEffect) -> Vec<f64> {
        if self.levels.is_empty() || effect.name == EFFECTS[0].name {
            return effect.levels.to_vec();
        }
        let mut levels = self.levels.clone();
        levels.sort_by(|one, other| effect.severity(*one).total_cmp(&effect.severity(*other)));
        levels
    }

    /// Builds the first run of every cell, so that an invalid override is reported before any run starts.
    ///
    /// # Errors
    /// [`StudyError`] if one cannot be built.
    pub fn check(&self) -> Result<(), StudyError> {
        for place in self.cells() {
            painleve_study_core::trial::Trial::new(&self.scenario(place, 0)?)?;
        }
        Ok(())
    }
}

impl Study for EffectsStudy {
    type Row = Row;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.cells().len(), self.runs])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        self.row_on(index, &BuiltInPlant::new)
    }
}

impl LoopStudy for EffectsStudy {
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Row, StudyError> {
        let cells = self.cells();
        let (cell, run) = (index / self.runs, index % self.runs);
        let place = cells[cell];
        let scenario = self.scenario(place, run)?;
        let judged = judge::run(
            plants.make(&scenario)?,
            &scenario,
            run,
            place.effect.lift_offs,
        )?;
        Ok(Row {
            controller: place.controller.to_string(),
            contact: place.contact,
            effect: place.effect.name,
            level: place.level,
            run,
            ending: judged.ending,
            fault: judged.fault,
            lift_offs: judged.lift_offs,
            error_m: judged.error_m,
            to_edge_m: judged.to_edge_m,
            p_ratio: judged.p_ratio,
            tip_t_m: judged.tip_t_m,
            target_m: judged.target_m,
            posture: judged.posture,
            mu: judged.mu,
            v_belt_m_s: judged.v_belt_m_s,
        })
    }
}

impl Tabular for EffectsStudy {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::from([("runs".into(), self.seed)]))
    }
}
