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

/// A closed-loop study with a user-defined plant.
///
/// ```
/// use painleve_plant::mechanics::BuiltInPlant;
/// use painleve_plant::scenario::Scenario;
/// use painleve_plant::{Plant, PlantError, Probe, Snapshot};
/// use painleve_shared::JointTorque;
/// use painleve_shared::range::OutOfRange;
/// use painleve_study::loop_study::OnPlant;
/// use painleve_study::robustness::{Arms, Criterion, Robustness};
///
/// /// The arm with motors that give 2 % less torque than commanded.
/// struct WeakMotors(BuiltInPlant);
///
/// impl WeakMotors {
///     fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
///         BuiltInPlant::new(scenario).map(Self)
///     }
/// }
///
/// impl Plant for WeakMotors {
///     fn snapshot(&self) -> Snapshot {
///         self.0.snapshot()
///     }
///
///     fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
///         self.0.command_torque(target_nm * 0.98, lag_s);
///     }
///
///     fn advance(&mut self, until_s: f64, probe: &mut impl Probe) -> Result<(), PlantError> {
///         self.0.advance(until_s, probe)
///     }
/// }
///
/// let campaign = Robustness {
///     arms: Arms::Paper,
///     seed: 1,
///     criterion: Criterion::Kept,
///     runs: 2,
///     overrides: Vec::new(),
/// };
/// let study = OnPlant { study: campaign, plants: WeakMotors::new };
/// let rows = painleve_study::rows(&study, || ())?;
/// assert!(rows.iter().all(|row| row.ending.is_kept()));
/// # Ok::<(), painleve_study::StudyError>(())
/// ```
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
