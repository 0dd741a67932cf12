//! Names of buses, which keep simultaneous runs apart.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use super::LinkError;

/// Name of a bus: 1 to 64 characters of `A-Z a-z 0-9 _ -`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct BusName(String);

impl BusName {
    /// Longest name, in characters.
    pub const MAX_LENGTH: usize = 64;

    /// Returns a name that no other run on this machine uses, made of process
    /// id, time and a counter.
    pub fn unique() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let since_epoch = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        Self(format!(
            "run-{}-{:x}-{}",
            std::process::id(),
            since_epoch.as_nanos(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        ))
    }

    /// Returns the name as a string.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for BusName {
    type Err = LinkError;

    fn from_str(name: &str) -> Result<Self, LinkError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if (1..=Self::MAX_LENGTH).contains(&name.len()) && name.chars().all(allowed) {
            Ok(Self(name.to_owned()))
        } else {
            Err(LinkError::InvalidBusName {
                name: name.to_owned(),
            })
        }
    }
}

impl fmt::Display for BusName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
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
