//! Studies of closed loops with a plant other than the built-in one.

use std::collections::BTreeMap;

use painleve_plant::Plant;
use painleve_plant::scenario::Scenario;
use painleve_shared::range::OutOfRange;
use serde::Serialize;

use crate::tabular::Tabular;
use crate::{Study, StudyError};

/// Makes the plants of a study. A function from a scenario to a plant does.
pub trait MakePlant: Sync {
    /// The plant.
    type Plant: Plant;

    /// Returns the plant of a scenario in its initial state.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    fn make(&self, scenario: &Scenario) -> Result<Self::Plant, OutOfRange>;
}

impl<P, F> MakePlant for F
where
    P: Plant,
    F: Fn(&Scenario) -> Result<P, OutOfRange> + Sync,
{
    type Plant = P;

    fn make(&self, scenario: &Scenario) -> Result<P, OutOfRange> {
        self(scenario)
    }
}

/// A study whose rows are closed loops: the plant can be replaced.
pub trait LoopStudy: Study {
    /// Computes row `index` with plants of `plants`.
    ///
    /// # Errors
    /// [`StudyError`] if the row cannot be computed.
    fn row_on(&self, index: usize, plants: &impl MakePlant) -> Result<Self::Row, StudyError>;
}

/// A closed-loop study with a user-defined plant. The documentation of `painleve_study_quality` has an example.
#[derive(Clone, Debug)]
pub struct OnPlant<S, M> {
    /// The study.
    pub study: S,
    /// Makes its plants.
    pub plants: M,
}

impl<S: LoopStudy, M: MakePlant> Study for OnPlant<S, M> {
    type Row = S::Row;

    fn len(&self) -> usize {
        self.study.len()
    }

    fn row(&self, index: usize) -> Result<S::Row, StudyError> {
        self.study.row_on(index, &self.plants)
    }
}

impl<S: LoopStudy + Tabular, M: MakePlant> Tabular for OnPlant<S, M> {
    fn lines(row: &S::Row) -> impl IntoIterator<Item: Serialize> {
        S::lines(row)
    }

    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        self.study.seeds()
    }
}
