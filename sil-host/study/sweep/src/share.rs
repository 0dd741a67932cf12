//! The rows of a shard, and the shard of this process.
//!
//! Neighbouring rows cost about the same, but some regions of a study cost a hundred times
//! as much as others. Rows are therefore assigned round-robin, one to each shard in turn, and each
//! round begins one shard later. An inner loop of the study whose length divides the number of
//! shards does not put all its expensive rows into the same shard.

use std::str::FromStr;

use painleve_study_core::tabular::{Records, Table};
use painleve_study_core::{Study, StudyError};

use super::ShardError;

/// Largest number of shards: more than the job array of any scheduler takes.
pub const MOST_SHARDS: usize = 1_000_000;

/// Environment variables in which schedulers give the array index, in order of priority.
pub const VARIABLES: [&str; 4] = [
    "SLURM_ARRAY_TASK_ID",
    "HQ_TASK_ID",
    "JOB_COMPLETION_INDEX",
    "OMPI_COMM_WORLD_RANK",
];

/// Returns the rows of a shard in ascending order.
pub fn rows_of(shard: usize, shards: usize, rows: usize) -> impl Iterator<Item = usize> {
    (0..rows.div_ceil(shards))
        .map(move |round| round * shards + (shard + shards - round % shards) % shards)
        .filter(move |&row| row < rows)
}

/// A shard on the command line: `K/N` or `K`, with K from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShardOption {
    shard: usize,
    shards: Option<usize>,
}

impl FromStr for ShardOption {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| {
            let wrong = || {
                format!("'{text}' is not a shard; give K/N with K from 0 to N - 1, for example 0/5")
            };
            part.parse::<usize>().map_err(|_| wrong())
        };
        let (shard, shards) = match text.split_once('/') {
            Some((shard, shards)) => (number(shard)?, Some(number(shards)?)),
            None => (number(text)?, None),
        };
        Ok(Self { shard, shards })
    }
}

/// Returns the shard to compute out of `shards`: the requested one, or the scheduler's.
///
/// # Errors
/// [`ShardError`] if neither gives a shard, or if the shard does not exist.
pub fn shard(
    asked: Option<ShardOption>,
    shards: usize,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<usize, ShardError> {
    let (shard, origin) = match asked {
        Some(ShardOption {
            shards: Some(given),
            ..
        }) if given != shards => {
            return Err(ShardError::OtherCount { shards, given });
        }
        Some(option) => (option.shard, "--shard".to_owned()),
        None => from_environment(variable)?,
    };
    if shard >= shards {
        return Err(ShardError::Beyond {
            origin,
            shard,
            shards,
        });
    }
    Ok(shard)
}

fn from_environment(
    variable: impl Fn(&str) -> Option<String>,
) -> Result<(usize, String), ShardError> {
    let set = |name| variable(name).map(|value| (name, value));
    let Some((name, value)) = VARIABLES.into_iter().find_map(set) else {
        return Err(ShardError::NotGiven {
            variables: &VARIABLES,
        });
    };
    match value.parse() {
        Ok(shard) => Ok((shard, format!("{name}={value}"))),
        Err(_) => Err(ShardError::NotANumber { name, value }),
    }
}

/// The rows of one shard as a study.
pub struct Share<'a> {
    table: &'a dyn Table,
    rows: Vec<usize>,
}

impl<'a> Share<'a> {
    /// Creates the study of shard `shard` of `shards`.
    pub fn new(table: &'a dyn Table, shard: usize, shards: usize) -> Self {
        let rows = rows_of(shard, shards, table.len()).collect();
        Self { table, rows }
    }

    /// Returns the numbers of its rows in the whole study.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }
}

impl Study for Share<'_> {
    type Row = Records;

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn row(&self, index: usize) -> Result<Records, StudyError> {
        self.table.records(self.rows[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_row_is_in_one_shard_and_shards_are_equal(rows in 1_usize..500, shards in 1_usize..40) {
            let mut seen = vec![0; rows];
            for shard in 0..shards {
                let mine: Vec<usize> = rows_of(shard, shards, rows).collect();
                prop_assert!(mine.is_sorted());
                prop_assert!(mine.len().abs_diff(rows / shards) <= 1);
                for row in mine {
                    // Each round begins one shard later.
                    prop_assert_eq!((row + row / shards) % shards, shard);
                    seen[row] += 1;
                }
            }
            prop_assert!(seen.iter().all(|&times| times == 1));
        }
    }

    #[test]
    fn an_inner_loop_is_distributed_over_the_shards() {
        // Every second row is expensive, for example with `--initial a,d` and two shards.
        let expensive = |shard| rows_of(shard, 2, 100).filter(|row| row % 2 == 0).count();
        assert_eq!((expensive(0), expensive(1)), (25, 25));
    }

    #[test]
    fn the_command_line_takes_precedence_over_schedulers_in_their_order() {
        let all = |name: &str| VARIABLES.iter().position(|&one| one == name);
        let of = |asked: Option<&str>, from: usize| {
            let asked = asked.map(|text| text.parse().unwrap());
            shard(asked, 5, |name| {
                all(name)
                    .filter(|&place| place >= from)
                    .map(|place| place.to_string())
            })
            .map_err(|error| error.to_string())
        };
        assert_eq!(of(Some("4/5"), 0), Ok(4));
        assert_eq!(of(Some("4"), 0), Ok(4));
        for place in 0..4 {
            assert_eq!(of(None, place), Ok(place));
        }
        assert!(of(None, 4).unwrap_err().contains("OMPI_COMM_WORLD_RANK"));
        assert!(of(Some("5/5"), 0).unwrap_err().contains("0 to 4"));
        assert!(of(Some("1/4"), 0).unwrap_err().contains("has 5 shards"));
    }

    #[test]
    fn mistakes_are_named() {
        for text in ["", "/", "1/", "/5", "-1/5", "a/5", "1/5/5", "1.0/5"] {
            let message = text.parse::<ShardOption>().unwrap_err();
            assert!(message.contains("K/N"), "{message}");
        }
        for value in ["", "x", "-1", "9"] {
            let message = shard(None, 5, |_| Some(value.to_owned())).unwrap_err();
            let message = message.to_string();
            assert!(
                message.contains(&format!("SLURM_ARRAY_TASK_ID={value}")),
                "{message}"
            );
        }
    }
}
