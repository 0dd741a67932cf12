//! The cells of a diagram over friction, belt speed and initial condition, by number.

use core::fmt;
use std::collections::BTreeMap;

use painleve_plant::State;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::{ArmOnBelt, PlantParameters, SolverSettings};
use painleve_shared::range::{self, OutOfRange};
use painleve_study_core::StudyError;
use painleve_study_core::initial::Initial;

/// Default relative error tolerance of one step of the plant. It is a hundredth
/// of a scenario's: near the ends of the window the arm bounces chaotically for minutes before
/// it settles, and every second multiplies errors by about 200.
pub const RELATIVE_TOLERANCE: f64 = 1e-11;

/// All combinations of friction, belt speed and initial condition, in this order; the
/// last varies fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// The plant; its friction, belt and tolerances are replaced.
    pub plant: PlantParameters,
    /// Relative error tolerance of one step of the plant; the absolute tolerance is a tenth of it.
    pub relative_tolerance: f64,
    /// Friction coefficients μ.
    pub mu: Vec<f64>,
    /// Belt speeds, m/s.
    pub v_belt_m_s: Vec<f64>,
    /// Initial conditions.
    pub initial: Vec<Initial>,
    /// Seed of the random initial conditions.
    pub seed: u64,
    /// Transient of a cell before recording starts, s.
    pub transient_s: f64,
    /// Recording time of a cell, s.
    pub record_s: f64,
}

/// One combination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Initial condition.
    pub initial: Initial,
    /// Initial state, before the tip is moved onto the belt.
    pub start: State,
}

impl fmt::Display for Cell {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            mu,
            v_belt_m_s,
            initial,
            ..
        } = self;
        write!(
            formatter,
            "mu = {mu}, v_belt = {v_belt_m_s} m/s from {initial}"
        )
    }
}

impl Cells {
    /// Returns the number of cells.
    pub fn len(&self) -> usize {
        painleve_study_core::combinations(&[
            self.mu.len(),
            self.v_belt_m_s.len(),
            self.initial.len(),
        ])
    }

    /// Returns the seed, by its purpose.
    pub fn seeds(&self) -> BTreeMap<String, u64> {
        BTreeMap::from([("initial".to_owned(), self.seed)])
    }

    /// Whether there are no cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks all settings before the computation.
    ///
    /// # Errors
    /// [`StudyError`] naming the first value that is out of range, or an initial
    /// condition that the arm cannot have.
    pub fn check(&self) -> Result<(), StudyError> {
        range::check("--transient-s", self.transient_s, 0.0, 1e6)?;
        range::check("--record-s", self.record_s, 1e-3, 1e6)?;
        range::check("--relative-tolerance", self.relative_tolerance, 1e-13, 1e-3)?;
        for &mu in &self.mu {
            range::check("--mu", mu, 0.0, 10.0)?;
        }
        let (mu, speed) = (self.mu.first(), self.v_belt_m_s.first());
        for &v_belt_m_s in &self.v_belt_m_s {
            range::check("--v-belt", v_belt_m_s, -100.0, 100.0)?;
        }
        for &initial in &self.initial {
            if let (Some(&mu), Some(&v_belt_m_s)) = (mu, speed) {
                let start = self.start(initial, 0)?;
                self.plant_of(&Cell {
                    mu,
                    v_belt_m_s,
                    initial,
                    start,
                })?;
            }
        }
        Ok(())
    }

    /// Returns cell `index`, less than [`len`](Self::len). It depends only on its index.
    ///
    /// # Errors
    /// [`StudyError::Range`] if the arm is invalid.
    pub fn cell(&self, index: usize) -> Result<Cell, StudyError> {
        let (rest, initial) = (index / self.initial.len(), index % self.initial.len());
        let (mu, speed) = (rest / self.v_belt_m_s.len(), rest % self.v_belt_m_s.len());
        let initial = self.initial[initial];
        Ok(Cell {
            mu: self.mu[mu],
            v_belt_m_s: self.v_belt_m_s[speed],
            initial,
            start: self.start(initial, index as u64)?,
        })
    }

    /// Returns the plant of a cell in its initial state.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter that is out of range.
    pub fn plant_of(&self, cell: &Cell) -> Result<ArmOnBelt, OutOfRange> {
        let parameters = PlantParameters {
            friction: cell.mu,
            belt: BeltProfile::Constant {
                speed_m_s: cell.v_belt_m_s,
            },
            solver: SolverSettings {
                relative_tolerance: self.relative_tolerance,
                absolute_tolerance: 0.1 * self.relative_tolerance,
                ..self.plant.solver
            },
            ..self.plant
        };
        ArmOnBelt::new(&parameters, cell.start)
    }

    fn start(&self, initial: Initial, row: u64) -> Result<State, OutOfRange> {
        let arm = painleve_shared::Arm::new(self.plant.arm)?;
        Ok(initial.state(&arm, self.seed, row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells() -> Cells {
        Cells {
            plant: PlantParameters::default(),
            relative_tolerance: RELATIVE_TOLERANCE,
            mu: vec![0.4, 0.6],
            v_belt_m_s: vec![-0.5, -0.4, -0.3],
            initial: vec![Initial::A, Initial::Random(1), Initial::Random(2)],
            seed: 7,
            transient_s: 1.0,
            record_s: 1.0,
        }
    }

    #[test]
    fn cells_are_numbered_with_the_initial_condition_changing_fastest() {
        let cells = cells();
        assert_eq!(cells.len(), 18);
        let names: Vec<String> = [0, 1, 3, 9, 17]
            .map(|index| cells.cell(index).unwrap().to_string())
            .to_vec();
        assert_eq!(
            names,
            [
                "mu = 0.4, v_belt = -0.5 m/s from a",
                "mu = 0.4, v_belt = -0.5 m/s from random:1",
                "mu = 0.4, v_belt = -0.4 m/s from a",
                "mu = 0.6, v_belt = -0.5 m/s from a",
                "mu = 0.6, v_belt = -0.3 m/s from random:2",
            ]
        );
        let random = |index| cells.cell(index).unwrap().start;
        assert!(random(1) != random(2) && random(1) != random(4));
    }

    #[test]
    fn mistakes_are_named() {
        assert!(cells().check().is_ok());
        for (cells, part) in [
            (
                Cells {
                    mu: vec![0.6, -0.1],
                    ..cells()
                },
                "--mu",
            ),
            (
                Cells {
                    v_belt_m_s: vec![-0.4, 1e9],
                    ..cells()
                },
                "--v-belt",
            ),
            (
                Cells {
                    transient_s: -1.0,
                    ..cells()
                },
                "--transient-s",
            ),
            (
                Cells {
                    record_s: f64::NAN,
                    ..cells()
                },
                "--record-s",
            ),
        ] {
            let message = cells.check().unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
