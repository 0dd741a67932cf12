//! Changes of friction from a CSV file, over time or along the belt.

use std::path::Path;
use std::sync::Arc;

use painleve_shared::OutOfRange;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape};
use painleve_system::input_file;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Largest number of rows.
const MOST_ROWS: usize = 1_000_000;
/// Largest change of friction.
const LARGEST_CHANGE: f64 = 2.0;

/// A CSV file with two columns, loaded together with its scenario. Scenarios contain its path.
///
/// The first line names the columns: `time_s,change` or `along_belt_m,change`. The first column
/// must increase. Between the rows the change of μ is interpolated linearly. Before the first time
/// and after the last one it is constant; along the belt the rows repeat, with the distance from
/// the first to the last position as the length of the belt.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionFile {
    path: String,
    rows: Arc<Rows>,
}

#[derive(Clone, Debug, PartialEq)]
struct Rows {
    over: Over,
    /// Time (s) or position (m), and change of μ.
    points: Vec<(f64, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    Time,
    Belt,
}

impl FrictionFile {
    /// Reads a file.
    ///
    /// # Errors
    /// One sentence with the path and the invalid line.
    pub fn read(path: &str) -> Result<Self, String> {
        let text = input_file::read(Path::new(path))
            .map_err(|error| format!("cannot read {path}: {error}"))?;
        let rows = parse(&text).map_err(|reason| format!("{path}: {reason}"))?;
        Ok(Self {
            path: path.into(),
            rows: Arc::new(rows),
        })
    }

    /// Returns the change of μ at time `t_s` and position `along_belt_m` on the belt.
    pub fn at(&self, t_s: f64, along_belt_m: f64) -> f64 {
        let points = &self.rows.points;
        let (Some(&(first, _)), Some(&(last, _))) = (points.first(), points.last()) else {
            return 0.0;
        };
        let place = match self.rows.over {
            Over::Time => t_s.clamp(first, last),
            Over::Belt => first + (along_belt_m - first).rem_euclid(last - first),
        };
        let after = points.partition_point(|&(at, _)| at <= place);
        match (points.get(after.wrapping_sub(1)), points.get(after)) {
            (Some(&(from, one)), Some(&(to, other))) => {
                one + (other - one) * ((place - from) / (to - from))
            }
            (Some(&(_, value)), None) | (None, Some(&(_, value))) => value,
            (None, None) => 0.0,
        }
    }
}

fn parse(text: &str) -> Result<Rows, String> {
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()));
    let columns = lines.next().map_or("", |(_, line)| line);
    let over = match columns.split(',').map(str::trim).collect::<Vec<_>>()[..] {
        ["time_s", "change"] => Over::Time,
        ["along_belt_m", "change"] => Over::Belt,
        _ => {
            return Err(format!(
                "line 1 is '{columns}'; it must be time_s,change or along_belt_m,change"
            ));
        }
    };
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let mut values = line
            .split(',')
            .map(|value| value.trim().parse::<f64>().ok());
        let (Some(Some(place)), Some(Some(change)), None) =
            (values.next(), values.next(), values.next())
        else {
            return Err(format!("line {number} is '{line}'; it must be two numbers"));
        };
        if !place.is_finite() || place.abs() > 1e7 {
            return Err(format!(
                "line {number}: {place} is outside the allowed range -1e7 to 1e7"
            ));
        }
        if !(-LARGEST_CHANGE..=LARGEST_CHANGE).contains(&change) {
            return Err(format!(
                "line {number}: change = {change} is outside the allowed range -{LARGEST_CHANGE} to {LARGEST_CHANGE}"
            ));
        }
        if points.last().is_some_and(|&(before, _)| place <= before) {
            return Err(format!("line {number}: the first column must rise"));
        }
        if points.len() == MOST_ROWS {
            return Err(format!("it has more than {MOST_ROWS} rows"));
        }
        points.push((place, change));
    }
    if points.len() < 2 {
        return Err("it needs at least two rows of numbers".into());
    }
    Ok(Rows { over, points })
}

impl SettingValue for FrictionFile {
    const SHAPE: Shape = Shape::Text;

    /// The file was checked when it was read.
    fn check(&self, _: &Bounds, _: &mut OutOfRange) -> Result<(), Refused> {
        Ok(())
    }
}

impl Serialize for FrictionFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.path)
    }
}

impl<'de> Deserialize<'de> for FrictionFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let path = String::deserialize(deserializer)?;
        Self::read(&path).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Result<FrictionFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("friction.csv");
        std::fs::write(&path, text).unwrap();
        FrictionFile::read(path.to_str().unwrap())
    }

    #[test]
    fn changes_over_time_are_interpolated_and_stay_at_the_ends() {
        let changes = file("time_s,change\n1,0\n2,0.1\n4,-0.1\n").unwrap();
        for (t_s, expected) in [(0.0, 0.0), (1.5, 0.05), (2.0, 0.1), (3.0, 0.0), (9.0, -0.1)] {
            assert!((changes.at(t_s, 77.0) - expected).abs() < 1e-12, "{t_s}");
        }
    }

    #[test]
    fn changes_along_the_belt_repeat_with_its_length() {
        let changes = file("along_belt_m, change\n-0.5, 0\n0, 0.2\n0.5, 0\n").unwrap();
        for (along_m, expected) in [
            (0.0, 0.2),
            (0.25, 0.1),
            (1.0, 0.2),
            (-0.75, 0.1),
            (7.5, 0.0),
        ] {
            assert!(
                (changes.at(3.0, along_m) - expected).abs() < 1e-12,
                "{along_m}"
            );
        }
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (text, part) in [
            ("", "line 1 is ''"),
            (
                "time,mu\n0,0\n1,0\n",
                "time_s,change or along_belt_m,change",
            ),
            ("time_s,change\n0,0\n", "two rows"),
            ("time_s,change\n0,0\n1,x\n", "line 3 is '1,x'"),
            (
                "time_s,change\n0,0\n1,3\n",
                "line 3: change = 3 is outside the allowed range -2 to 2",
            ),
            ("time_s,change\n0,0\nnan,0\n", "line 3: NaN"),
            (
                "time_s,change\n0,0\n0,0.1\n",
                "line 3: the first column must rise",
            ),
            ("time_s,change\n0,0,0\n1,0\n", "line 2"),
        ] {
            let message = file(text).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
        let set = [
            "contact.kind=compliant".to_owned(),
            "effects.friction={ kind = 'file', path = 'no.csv' }".to_owned(),
        ];
        let message = crate::scenario::Scenario::load("edge", &set)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("effects.friction") && message.contains("no.csv"),
            "{message}"
        );
    }
}
