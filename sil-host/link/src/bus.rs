//! Names of buses, which keep simultaneous runs apart, and pairs, which keep strangers out of them.

use std::fmt;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Name of a bus: 1 to 64 characters of `A-Z a-z 0-9 _ -`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct BusName(String);

impl BusName {
    /// Longest name, in characters.
    pub const MAX_LENGTH: usize = 64;

    /// Returns a name that no other run on this machine uses, made of the process id and 64
    /// random bits. The time would repeat after a step of the clock, and other PID namespaces
    /// have the same ids.
    pub fn unique() -> Self {
        Self(format!("run-{}-{}", std::process::id(), Pair::unique()))
    }

    /// Returns the name as a string.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A string is not a valid bus name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("bus name {name:?} is not allowed: use 1 to 64 characters of A-Z, a-z, 0-9, '_' and '-'")]
pub struct InvalidBusName {
    /// The rejected name.
    pub name: String,
}

impl FromStr for BusName {
    type Err = InvalidBusName;

    fn from_str(name: &str) -> Result<Self, InvalidBusName> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if (1..=Self::MAX_LENGTH).contains(&name.len()) && name.chars().all(allowed) {
            Ok(Self(name.to_owned()))
        } else {
            Err(InvalidBusName {
                name: name.to_owned(),
            })
        }
    }
}

impl TryFrom<String> for BusName {
    type Error = InvalidBusName;

    fn try_from(name: String) -> Result<Self, InvalidBusName> {
        name.parse()
    }
}

impl fmt::Display for BusName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Mark of a plant and a controller that were started for each other: 64 random bits.
///
/// A plant with a mark admits the controller with the same mark only, and that controller joins no
/// other plant, whatever else starts on their bus at the same moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair(u64);

impl Pair {
    /// Draws a mark.
    pub fn unique() -> Self {
        Self(RandomState::new().build_hasher().finish())
    }
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked() {
        let longest = "x".repeat(BusName::MAX_LENGTH);
        for name in ["a", "run-7", "Bench_2", longest.as_str()] {
            assert_eq!(name.parse::<BusName>().unwrap().as_str(), name);
        }
        let too_long = "x".repeat(BusName::MAX_LENGTH + 1);
        for name in ["", "a b", "a/b", "é", "a\n", too_long.as_str()] {
            assert!(name.parse::<BusName>().is_err(), "{name:?}");
        }
    }

    #[test]
    fn unique_names_are_valid_and_differ() {
        let (a, b) = (BusName::unique(), BusName::unique());
        assert_ne!(a, b);
        assert_eq!(a.as_str().parse::<BusName>().unwrap(), a);
    }
}
