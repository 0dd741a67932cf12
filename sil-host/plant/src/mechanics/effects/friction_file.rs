//! Changes of friction from a CSV file, over time or along the belt.

use crate::mechanics::from_file::{Content, FromFile};
use crate::mechanics::series::{self, Columns};

/// The columns of a file over time, or of one along the belt.
const COLUMNS: [Columns; 2] = [
    Columns {
        place: "time_s",
        value: "change",
        largest: 2.0,
    },
    Columns {
        place: "along_belt_m",
        value: "change",
        largest: 2.0,
    },
];

/// A CSV file with two columns.
pub type FrictionFile = FromFile<FrictionRows>;

/// The rows of a [`FrictionFile`].
///
/// The first line names the columns: `time_s,change` or `along_belt_m,change`. The first column
/// must increase. Between the rows the change of μ is interpolated linearly. Before the first time
/// and after the last one it is constant; along the belt the rows repeat, with the distance from
/// the first to the last position as the length of the belt.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionRows {
    /// Whether the first column is a position on the belt instead of a time.
    along_belt: bool,
    /// Time (s) or position (m), and change of μ.
    points: Vec<(f64, f64)>,
}

impl Content for FrictionRows {
    fn read(path: &str) -> Result<Self, String> {
        let (columns, points) = series::read(path, &COLUMNS, 2)?;
        Ok(Self {
            along_belt: columns == 1,
            points,
        })
    }

    fn unread() -> Self {
        Self {
            along_belt: false,
            points: Vec::new(),
        }
    }
}

impl FrictionRows {
    /// Returns the change of μ at time `t_s` and position `along_belt_m` on the belt.
    pub fn at(&self, t_s: f64, along_belt_m: f64) -> f64 {
        let points = &self.points;
        let (Some(&(first, _)), Some(&(last, _))) = (points.first(), points.last()) else {
            return 0.0;
        };
        let place = if self.along_belt {
            first + (along_belt_m - first).rem_euclid(last - first)
        } else {
            t_s
        };
        series::interpolated(points, place)
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
            ("", "it is empty"),
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
            ("time_s,change\n0,0\nnan,0\n", "line 3: time_s = NaN"),
            (
                "time_s,change\n0,0\n0,0.1\n",
                "line 3: time_s = 0 is not larger than in the row before",
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
