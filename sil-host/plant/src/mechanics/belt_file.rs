//! The belt's speed from a CSV file.

use std::sync::Arc;

use painleve_shared::OutOfRange;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::series::{self, Columns};

/// The columns; the speed is limited as in the other profiles.
const COLUMNS: [Columns; 1] = [Columns {
    place: "time_s",
    value: "speed_m_s",
    largest: 100.0,
}];

/// A CSV file with the columns `time_s,speed_m_s`, loaded together with its scenario. Scenarios contain
/// its path.
///
/// Between the rows the speed is interpolated linearly; before the first and after the last one it is
/// constant.
#[derive(Clone, Debug, PartialEq)]
pub struct BeltFile {
    path: String,
    rows: Arc<Rows>,
}

#[derive(Clone, Debug, PartialEq)]
struct Rows {
    /// Time, s, and speed, m/s.
    points: Vec<(f64, f64)>,
    /// Distance that the belt has moved at each row since the first one, m.
    positions_m: Vec<f64>,
}

impl BeltFile {
    /// Reads a file.
    ///
    /// # Errors
    /// One sentence with the path and the invalid line.
    pub fn read(path: &str) -> Result<Self, String> {
        let (_, points) = series::read(path, &COLUMNS)?;
        let mut positions_m = vec![0.0];
        let mut position_m = 0.0;
        for pair in points.windows(2) {
            let [(from_s, from_m_s), (to_s, to_m_s)] = [pair[0], pair[1]];
            position_m += 0.5 * (from_m_s + to_m_s) * (to_s - from_s);
            positions_m.push(position_m);
        }
        Ok(Self {
            path: path.into(),
            rows: Arc::new(Rows {
                points,
                positions_m,
            }),
        })
    }

    /// Returns the speed at time `t_s`, m/s.
    pub fn speed_m_s(&self, t_s: f64) -> f64 {
        series::interpolated(&self.rows.points, t_s)
    }

    /// Returns the acceleration at time `t_s`, m/s²; at a row, the acceleration just after it.
    pub fn acceleration_m_s2(&self, t_s: f64) -> f64 {
        let points = &self.rows.points;
        let after = self.next_row(t_s);
        match (points.get(after.wrapping_sub(1)), points.get(after)) {
            (Some(&(from_s, from_m_s)), Some(&(to_s, to_m_s))) => {
                (to_m_s - from_m_s) / (to_s - from_s)
            }
            _ => 0.0,
        }
    }

    /// Returns the integral of the speed from the first row's time, m.
    pub fn position_m(&self, t_s: f64) -> f64 {
        // The row before, or the first one.
        let row = self.next_row(t_s).saturating_sub(1);
        let (from_s, from_m_s) = self.rows.points[row];
        let mean_m_s = 0.5 * (from_m_s + self.speed_m_s(t_s));
        self.rows.positions_m[row] + mean_m_s * (t_s - from_s)
    }

    /// Returns the time of the next row after `t_s`, s; infinite if there is none.
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        let next = self.rows.points.get(self.next_row(t_s));
        next.map_or(f64::INFINITY, |&(at_s, _)| at_s)
    }

    /// Returns the index of the first row after `t_s`.
    fn next_row(&self, t_s: f64) -> usize {
        self.rows.points.partition_point(|&(at_s, _)| at_s <= t_s)
    }
}

impl SettingValue for BeltFile {
    const SHAPE: Shape = Shape::Text;

    /// The file was checked when it was read.
    fn check(&self, _: &Bounds, _: &mut OutOfRange) -> Result<(), Refused> {
        Ok(())
    }
}

impl Serialize for BeltFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.path)
    }
}

impl<'de> Deserialize<'de> for BeltFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let path = String::deserialize(deserializer)?;
        Self::read(&path).map_err(serde::de::Error::custom)
    }
}
