//! The belt's speed from a CSV file.

use super::from_file::{Content, FromFile};
use super::series::{self, Columns};

/// The columns; the speed is limited as in the other profiles.
const COLUMNS: [Columns; 1] = [Columns {
    place: "time_s",
    value: "speed_m_s",
    largest: 100.0,
}];

/// A CSV file with the columns `time_s,speed_m_s`.
pub type BeltFile = FromFile<BeltRows>;

/// The rows of a [`BeltFile`].
///
/// Between the rows the speed is interpolated linearly; before the first and after the last one it is
/// constant.
#[derive(Clone, Debug, PartialEq)]
pub struct BeltRows {
    /// Time, s, and speed, m/s.
    points: Vec<(f64, f64)>,
    /// Distance that the belt has moved at each row since the first one, m.
    positions_m: Vec<f64>,
}

impl Content for BeltRows {
    fn read(path: &str) -> Result<Self, String> {
        let (_, points) = series::read(path, &COLUMNS, 2)?;
        let mut positions_m = vec![0.0];
        let mut position_m = 0.0;
        for pair in points.windows(2) {
            let [(from_s, from_m_s), (to_s, to_m_s)] = [pair[0], pair[1]];
            position_m += 0.5 * (from_m_s + to_m_s) * (to_s - from_s);
            positions_m.push(position_m);
        }
        Ok(Self {
            points,
            positions_m,
        })
    }

    fn unread() -> Self {
        Self {
            points: vec![(0.0, 0.0)],
            positions_m: vec![0.0],
        }
    }
}

impl BeltRows {
    /// Returns the speed at time `t_s`, m/s.
    pub fn speed_m_s(&self, t_s: f64) -> f64 {
        series::interpolated(&self.points, t_s)
    }

    /// Returns the acceleration at time `t_s`, m/s²; at a row, the acceleration just after it.
    pub fn acceleration_m_s2(&self, t_s: f64) -> f64 {
        let points = &self.points;
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
        let (from_s, from_m_s) = self.points[row];
        let mean_m_s = 0.5 * (from_m_s + self.speed_m_s(t_s));
        self.positions_m[row] + mean_m_s * (t_s - from_s)
    }

    /// Returns the time of the next row after `t_s`, s; infinite if there is none.
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        let next = self.points.get(self.next_row(t_s));
        next.map_or(f64::INFINITY, |&(at_s, _)| at_s)
    }

    /// Returns the index of the first row after `t_s`.
    fn next_row(&self, t_s: f64) -> usize {
        self.points.partition_point(|&(at_s, _)| at_s <= t_s)
    }
}
