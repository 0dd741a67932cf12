//! Description of the machine on which the benchmarks ran.

use std::fs;

use crate::command::{ChoreError, answer};

/// A machine at one time.
pub struct Machine {
    model: String,
    processors: Vec<usize>,
    kernel: String,
    governor: String,
    /// Runnable tasks, averaged over a minute, before the first benchmark.
    load: String,
    commit: String,
    date: String,
}

impl Machine {
    /// Describes this machine.
    ///
    /// # Errors
    /// If it does not tell its processors.
    pub fn here() -> Result<Self, ChoreError> {
        let line = |path: &str| fs::read_to_string(path).map(|text| text.trim().to_owned());
        let after = |path: &str, key: &str| {
            let text = fs::read_to_string(path).unwrap_or_default();
            let found = text.lines().find_map(|line| line.strip_prefix(key));
            found.map(|value| value.trim_start_matches([':', ' ', '\t']).to_owned())
        };
        let allowed = after("/proc/self/status", "Cpus_allowed_list").unwrap_or_default();
        let processors = processors(&allowed)
            .ok_or_else(|| ChoreError(format!("cannot read the processors \"{allowed}\"")))?;
        let known = |program: &str, arguments: &[&str]| {
            answer(program, arguments).unwrap_or_else(|_| "unknown".into())
        };
        Ok(Self {
            model: after("/proc/cpuinfo", "model name").unwrap_or_else(|| "unknown".into()),
            processors,
            kernel: line("/proc/sys/kernel/osrelease").unwrap_or_default(),
            governor: line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
                .unwrap_or_else(|_| "not visible".into()),
            load: load(),
            commit: known("git", &["rev-parse", "--short", "HEAD"]),
            date: known("date", &["--iso-8601=date"]),
        })
    }

    /// Returns the processors that benchmarks use: one, or one for each of two processes.
    pub fn pinned(&self, processes: usize) -> String {
        let last = self.processors.iter().rev().take(processes);
        let names: Vec<_> = last.map(usize::to_string).collect();
        names.join(",")
    }

    /// Returns the number of processors.
    pub fn count(&self) -> usize {
        self.processors.len()
    }

    /// Returns the description in one paragraph, with the load at the end of the benchmarks.
    pub fn described(&self) -> String {
        let Self {
            model,
            kernel,
            governor,
            load: before,
            commit,
            date,
            ..
        } = self;
        format!(
            "Measured by `cargo xtask bench` on {date} at commit {commit}: {model}, {} processors, Linux {kernel}, frequency governor {governor}; \
             load before {before}, after {}. One process is pinned to processor {}, two processes to {}.",
            self.count(),
            load(),
            self.pinned(1),
            self.pinned(2),
        )
    }
}

/// Reads a list such as `0-3,6`.
fn processors(list: &str) -> Option<Vec<usize>> {
    let mut found = Vec::new();
    for part in list.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        found.extend(first.parse().ok()?..=last.parse::<usize>().ok()?);
    }
    Some(found)
}

fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().unwrap_or("unknown").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_processors_are_read() {
        assert_eq!(processors("0-3,6"), Some(vec![0, 1, 2, 3, 6]));
        assert_eq!(processors("2"), Some(vec![2]));
        assert_eq!(processors("all"), None);
    }
}
