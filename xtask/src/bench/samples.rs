//! Criterion's samples of one benchmark.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::command::{ChoreError, workspace};

/// Times of one iteration, s, in increasing order; each is the mean of a sample's iterations.
pub struct Samples(Vec<f64>);

impl Samples {
    /// Reads the newest samples of the benchmark with this identifier.
    ///
    /// # Errors
    /// If there are none.
    pub fn of(identifier: &str) -> Result<Self, ChoreError> {
        let folder = workspace().join("target/criterion");
        let found = find(&folder, identifier, 4).and_then(|text| times_s(&text));
        found.ok_or_else(|| ChoreError(format!("criterion has no samples of \"{identifier}\"")))
    }

    /// Returns the time that this fraction of the samples does not exceed, s.
    pub fn quantile_s(&self, fraction: f64) -> f64 {
        let last = self.0.len() - 1;
        self.0[((last as f64 * fraction).round() as usize).min(last)]
    }

    /// Returns the median, s.
    pub fn median_s(&self) -> f64 {
        self.quantile_s(0.5)
    }

    /// Returns the 95th percentile and the maximum relative to the median, in words.
    pub fn spread(&self) -> String {
        format!(
            "p95 +{:.0} %, max +{:.0} %",
            100.0 * (self.quantile_s(0.95) / self.median_s() - 1.0),
            100.0 * (self.quantile_s(1.0) / self.median_s() - 1.0),
        )
    }
}

/// Returns the samples' file of the benchmark, at most `depth` folders deep.
fn find(folder: &Path, identifier: &str, depth: u32) -> Option<String> {
    let newest = folder.join("new");
    let about = fs::read_to_string(newest.join("benchmark.json")).unwrap_or_default();
    let about: Value = serde_json::from_str(&about).unwrap_or_default();
    if about["full_id"] == identifier {
        return fs::read_to_string(newest.join("sample.json")).ok();
    }
    let mut folders = fs::read_dir(folder).ok()?.flatten();
    (depth > 0)
        .then(|| folders.find_map(|it| find(&it.path(), identifier, depth - 1)))
        .flatten()
}

fn times_s(text: &str) -> Option<Samples> {
    let sample: Value = serde_json::from_str(text).ok()?;
    let list = |key: &str| -> Option<Vec<f64>> {
        sample[key].as_array()?.iter().map(Value::as_f64).collect()
    };
    let pairs = list("times")?.into_iter().zip(list("iters")?);
    let mut times_s: Vec<f64> = pairs
        .map(|(time_ns, count)| 1e-9 * time_ns / count)
        .collect();
    times_s.sort_by(f64::total_cmp);
    (!times_s.is_empty()).then_some(Samples(times_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_times_of_one_iteration() {
        let text =
            r#"{"sampling_mode":"Linear","iters":[1.0,2.0,4.0],"times":[300.0,200.0,800.0]}"#;
        let samples = times_s(text).unwrap();
        assert!((samples.median_s() - 200e-9).abs() < 1e-15);
        assert!((samples.quantile_s(1.0) - 300e-9).abs() < 1e-15);
        assert_eq!(samples.spread(), "p95 +50 %, max +50 %");
        assert!(times_s("{}").is_none());
    }
}
