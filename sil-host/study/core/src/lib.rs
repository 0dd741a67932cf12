//! What a study is: a numbered list of independent rows, its options, and the outcome of its rows.
//!
//! - [`grid`]: the values of a parameter, `FROM:TO:STEP` or a list
//! - [`options`]: options that several studies share; [`initial`]: initial conditions
//! - [`catalogue`]: what command line, sweeps and the page of figures need of a study, whatever its type
//! - [`outcome`]: the outcome of a study as JSON, CSV, table and figure; [`tabular`]: rows as lines of a table, one row
//!   at a time
//! - [`case`], [`trial`]: closed loops to study, and their execution in this process;
//!   [`loop_study`]: the same with a user-defined plant
//! - [`figures`]: the page that compares the studies with the paper
//!
//! The rows of a [`Study`] can be computed in any order, on any number of threads, or in shards.

pub mod case;
pub mod catalogue;
pub mod figures;
pub mod grid;
pub mod initial;
pub mod loop_study;
pub mod options;
pub mod outcome;
pub mod tabular;
pub mod trial;

use painleve_plant::PlantError;
use painleve_plant::closed_loop::LoopError;
use painleve_plant::scenario::ScenarioError;
use painleve_shared::range::OutOfRange;
use rayon::prelude::*;

pub use grid::Grid;
pub use outcome::Outcome;

/// Why a study has no outcome.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The scenario of the study is invalid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The text of a grid is invalid.
    #[error("{0}")]
    Grid(String),
    /// An override sets a key that the study sets or does not use, or an option names what it cannot compute.
    #[error("{key} has no effect here; {instead}")]
    Taken {
        /// The key or option.
        key: String,
        /// What to do instead, or what sets the key.
        instead: String,
    },
    /// An override sets a key of the law in a study that compares laws.
    #[error(
        "{key} cannot be set here: the study sets the law itself; choose it with --controller, by name or as a scenario file"
    )]
    Law {
        /// The key.
        key: String,
    },
    /// The scenario has something that the study does not compute.
    #[error(
        "scenario {scenario}: {setting} has no effect here: this study computes the arm without it"
    )]
    Ignored {
        /// The scenario.
        scenario: String,
        /// Its setting.
        setting: &'static str,
    },
    /// The scenarios have several friction coefficients.
    #[error(
        "the controllers' scenarios differ in belt.friction ({mu:?}); say with --mu which to study"
    )]
    SeveralFrictions {
        /// Those of successive scenarios.
        mu: Vec<f64>,
    },
    /// Levels without exactly one effect whose levels they are.
    #[error("--level needs exactly one effect other than none in --effect")]
    LevelsOfSeveralEffects,
    /// A key to search has values that are not fractional.
    #[error("{0}; only keys with fractional values can be searched")]
    NotFractional(ScenarioError),
    /// A position is out of reach.
    #[error(
        "z_t = {tip_t_m} m is out of reach: the tip reaches the belt from −{reach_m:.4} to {reach_m:.4} m"
    )]
    OutOfReach {
        /// Position along the belt, m.
        tip_t_m: f64,
        /// Farthest position on either side, m.
        reach_m: f64,
    },
    /// No θ1 of a grid puts the tip on the belt.
    #[error(
        "no θ1 of the grid puts the tip on the belt; |θ1| must be below {below_deg:.2} degrees"
    )]
    OffTheBelt {
        /// Limit of |θ1|, degrees.
        below_deg: f64,
    },
    /// p is not positive anywhere within reach.
    #[error("the arm has no admissible tip position")]
    NothingAdmissible,
    /// A row cannot be written as a line of a table.
    #[error("row {index} cannot be written: {source}")]
    Unwritable {
        /// Number of the row.
        index: usize,
        /// The reason.
        source: csv::Error,
    },
    /// The values of the options have more combinations than can be computed.
    #[error("{0} rows: at most {MOST_ROWS} can be computed; give coarser grids or fewer runs")]
    TooManyRows(usize),
    /// A parameter is out of range.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// The plant of one row cannot continue.
    #[error("{row}: {source}")]
    Plant {
        /// The row's parameters.
        row: String,
        /// The reason.
        source: PlantError,
    },
    /// The closed loop of one row cannot continue.
    #[error("{row}: {source}")]
    Loop {
        /// The row's parameters.
        row: String,
        /// The reason.
        source: LoopError,
    },
}

/// A numbered list of rows, each of which depends only on its number.
pub trait Study: Sync {
    /// One row of the outcome.
    type Row: Send;

    /// Returns the number of rows.
    fn len(&self) -> usize;

    /// Whether there are no rows.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Computes row `index`, less than [`len`](Study::len).
    ///
    /// # Errors
    /// [`StudyError`] if the row cannot be computed.
    fn row(&self, index: usize) -> Result<Self::Row, StudyError>;
}

/// Largest number of rows of a study: more than a machine computes in a year.
pub const MOST_ROWS: usize = 10_000_000;

/// Returns the number of combinations of these numbers of values; [`usize::MAX`] on
/// overflow.
pub fn combinations(counts: &[usize]) -> usize {
    counts
        .iter()
        .fold(1, |product: usize, &count| product.saturating_mul(count))
}

/// Returns the place of a combination among the values of each option, of which there are `counts`; the first option's value
/// changes fastest.
pub fn places<const N: usize>(index: usize, counts: [usize; N]) -> [usize; N] {
    let mut rest = index;
    counts.map(|count| {
        let place = rest % count;
        rest /= count;
        place
    })
}

/// Checks that a study has no more rows than can be computed.
///
/// # Errors
/// [`StudyError::TooManyRows`].
pub fn check_rows<S: Study>(study: &S) -> Result<(), StudyError> {
    match study.len() {
        ..=MOST_ROWS => Ok(()),
        rows => Err(StudyError::TooManyRows(rows)),
    }
}

/// Computes all rows in order on the threads of the current rayon pool; `done` is
/// called after each row, and no further row begins once it has panicked.
///
/// # Errors
/// [`StudyError::TooManyRows`], or the error of the first row that fails, whatever the number of threads.
pub fn rows<S: Study>(study: &S, done: impl Fn() + Sync) -> Result<Vec<S::Row>, StudyError> {
    check_rows(study)?;
    let rows: Vec<Result<S::Row, StudyError>> = (0..study.len())
        .into_par_iter()
        // The cost of rows varies widely.
        .with_max_len(1)
        .panic_fuse()
        .map(|index| {
            let row = study.row(index);
            done();
            row
        })
        .collect();
    rows.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_has_its_index() {
        let counts = [2, 1, 3];
        let all: Vec<_> = (0..combinations(&counts))
            .map(|index| places(index, counts))
            .collect();
        assert_eq!(all[1], [1, 0, 0]);
        assert_eq!(all[5], [1, 0, 2]);
        assert!((0..6).all(|index| all[..index].iter().all(|it| *it != all[index])));
    }

    struct Squares;

    impl Study for Squares {
        type Row = usize;

        fn len(&self) -> usize {
            100
        }

        fn row(&self, index: usize) -> Result<usize, StudyError> {
            match index {
                70 | 30 => Err(StudyError::OutOfReach {
                    tip_t_m: index as f64,
                    reach_m: 0.2,
                }),
                _ => Ok(index * index),
            }
        }
    }

    struct First(usize);

    impl Study for First {
        type Row = usize;

        fn len(&self) -> usize {
            self.0
        }

        fn row(&self, index: usize) -> Result<usize, StudyError> {
            Squares.row(index)
        }
    }

    #[test]
    fn rows_and_errors_do_not_depend_on_the_number_of_threads() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let done = std::sync::atomic::AtomicUsize::new(0);
            let count = || {
                done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            };
            let expected: Vec<usize> = (0..30).map(|i| i * i).collect();
            assert_eq!(pool.install(|| rows(&First(30), count)).unwrap(), expected);
            assert_eq!(done.into_inner(), 30);
            let error = pool.install(|| rows(&Squares, || ())).unwrap_err();
            assert!(error.to_string().contains("z_t = 30 m"), "{error}");
        }
    }

    #[test]
    fn no_row_begins_after_a_panic_of_the_progress() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let interrupt = || {
            done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            std::panic::resume_unwind(Box::new("interrupted"));
        };
        let study = || pool.unwrap().install(|| rows(&First(30), interrupt));
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(study));
        assert!(outcome.is_err());
        // Each of the two threads may have begun one.
        assert!(done.into_inner() <= 2);
    }
}
