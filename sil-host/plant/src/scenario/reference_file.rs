//! The reference of the tip from a CSV file: `controller.reference = "PATH"`.
//!
//! The file has the columns `time_s,target_m`. The reference moves to each target at constant speed and
//! reaches it at the row's time, counted from the start of tracking. A loaded scenario contains the
//! segments, not the path, because the controller has no files.

use painleve_firmware::refer::reference::MAXIMUM_SEGMENTS;
use toml::{Table, Value};

use crate::mechanics::series::{self, Columns};

/// The columns; targets are limited as in the segments.
const COLUMNS: [Columns; 1] = [Columns {
    place: "time_s",
    value: "target_m",
    largest: 20.0,
}];

/// Replaces the path of a file by its segments, if the scenario's reference is a path.
///
/// # Errors
/// One sentence with the path and the invalid line.
pub(super) fn expand(scenario: &mut Table) -> Result<(), String> {
    let reference = scenario
        .get_mut("controller")
        .and_then(|controller| controller.get_mut("reference"));
    if let Some(reference) = reference
        && let Value::String(path) = reference
    {
        *reference = Value::Array(segments(path)?);
    }
    Ok(())
}

fn segments(path: &str) -> Result<Vec<Value>, String> {
    let (_, rows) = series::read(path, &COLUMNS, 1)?;
    if rows.len() > MAXIMUM_SEGMENTS {
        let count = rows.len();
        return Err(format!(
            "{path}: it has {count} rows; a reference has at most {MAXIMUM_SEGMENTS} segments"
        ));
    }
    if rows[0].0 < 0.0 {
        return Err(format!("{path}: the first time is negative"));
    }
    if rows.len() == 1 && rows[0].0 == 0.0 {
        // It would be nothing but a jump.
        return Err(format!("{path}: the time of its only row is not above 0"));
    }
    let mut before_s = 0.0;
    let segments = rows.into_iter().map(|(time_s, target_m)| {
        let duration_s = time_s - before_s;
        before_s = time_s;
        // A ramp without duration would be a jump.
        let kind = if duration_s == 0.0 { "step" } else { "ramp" };
        let settings = [("target_m", target_m), ("duration_s", duration_s)];
        let settings = settings.map(|(key, value)| (key.into(), Value::Float(value)));
        Value::Table(Table::from_iter([(
            kind.into(),
            Value::Table(Table::from_iter(settings)),
        )]))
    });
    Ok(segments.collect())
}

#[cfg(test)]
mod tests {
    use crate::scenario::Scenario;

    /// Loads a scenario whose reference comes from a file with this text.
    fn load(text: &str) -> Result<String, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("reference.csv");
        std::fs::write(&path, text).unwrap();
        let set = format!("controller.reference={}", path.display());
        let scenario = Scenario::load("hybrid-elbow-down", &[set]);
        let scenario = scenario.map_err(|error| error.to_string())?;
        Ok(format!("{:?}", scenario.controller.reference.segments))
    }

    #[test]
    fn rows_become_segments() {
        let segments = load("time_s,target_m\n0,-0.1\n1.5,0.05\n2,0.05\n").unwrap();
        let expected = "[Step { target_m: -0.1, duration_s: 0.0 }, \
             Ramp { target_m: 0.05, duration_s: 1.5 }, Ramp { target_m: 0.05, duration_s: 0.5 }]";
        assert_eq!(segments, expected);
        let one = load("time_s,target_m\n2,0.05\n").unwrap();
        assert_eq!(one, "[Ramp { target_m: 0.05, duration_s: 2.0 }]");
    }

    #[test]
    fn mistakes_are_named_with_file_and_line() {
        let rows = |count| {
            (0..count)
                .map(|row| format!("{row},0\n"))
                .collect::<String>()
        };
        for (text, part) in [
            ("time_s,target_m\n0,0\n1,x\n".to_owned(), "line 3 is '1,x'"),
            (
                "time_s,target_m\n0,0\n1,21\n".into(),
                "line 3: target_m = 21 is outside the allowed range -20 to 20",
            ),
            ("time_s,target_m\n-1,0\n1,0\n".into(), "negative"),
            (
                "time_s,target_m\n0,0.05\n".into(),
                "only row is not above 0",
            ),
            ("time_s,target_m\n".into(), "at least one row"),
            ("time_s,target\n0,0\n1,0\n".into(), "time_s,target_m"),
            (
                format!("time_s,target_m\n{}", rows(17)),
                "it has 17 rows; a reference has at most 16 segments",
            ),
            // The reach of the arm is checked as usual.
            (
                "time_s,target_m\n0,0\n1,0.5\n".into(),
                "controller.reference.1.ramp.target_m",
            ),
        ] {
            let message = load(&text).unwrap_err();
            let is_named = message.contains("controller.reference");
            assert!(is_named && message.contains(part), "{message}");
        }
    }
}
