//! Limits the number of rows of a run of any length.
//!
//! In a short run every tick is a row. When the limit is reached, blocks of rows are replaced by
//! the two with the smallest and the largest normal force. Lift-offs and impacts stay visible, and
//! every remaining row is an actual state of the run.

use crate::row::Row;

/// Largest number of rows: 1 MB.
pub const MOST_ROWS: usize = 12_000;

/// Rows of a run, thinned.
#[derive(Clone, Debug)]
pub struct Thinned {
    rows: Vec<Row>,
    /// Ticks for each row.
    stride: usize,
    block: Block,
    ends: Option<[Row; 2]>,
}

/// The extremes of consecutive rows.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    length: usize,
    extremes: Option<(Row, Row)>,
}

impl Block {
    fn push(&mut self, row: &Row) {
        self.length += 1;
        let (low, high) = self.extremes.get_or_insert((*row, *row));
        if row.normal_force_n() < low.normal_force_n() {
            *low = *row;
        } else if row.normal_force_n() >= high.normal_force_n() {
            *high = *row;
        }
    }

    /// Adds the extremes in order of time, and empties the block.
    fn drain_to(&mut self, rows: &mut Vec<Row>) {
        if let Some((low, high)) = self.extremes.take() {
            let (first, second) = if low.time_s <= high.time_s {
                (low, high)
            } else {
                (high, low)
            };
            rows.push(first);
            if second.time_s > first.time_s {
                rows.push(second);
            }
        }
        self.length = 0;
    }
}

impl Default for Thinned {
    fn default() -> Self {
        Self {
            rows: Vec::with_capacity(MOST_ROWS + 2),
            stride: 1,
            block: Block::default(),
            ends: None,
        }
    }
}

impl Thinned {
    /// Adds the row of a tick.
    pub fn push(&mut self, row: &Row) {
        self.ends.get_or_insert([*row; 2])[1] = *row;
        if self.stride == 1 {
            self.rows.push(*row);
        } else {
            self.block.push(row);
            if self.block.length >= 2 * self.stride {
                self.block.drain_to(&mut self.rows);
            }
        }
        if self.rows.len() >= MOST_ROWS {
            self.halve();
        }
    }

    fn halve(&mut self) {
        let rows = std::mem::take(&mut self.rows);
        let mut block = Block::default();
        for four in rows.chunks(4) {
            four.iter().for_each(|row| block.push(row));
            block.drain_to(&mut self.rows);
        }
        self.stride *= 2;
    }

    /// Returns the rows in order of time; the first and the last are those of the first and the last
    /// tick.
    pub fn finish(mut self) -> Vec<Row> {
        self.block.drain_to(&mut self.rows);
        let Some([first, last]) = self.ends else {
            return self.rows;
        };
        if self
            .rows
            .first()
            .is_none_or(|row| row.time_s > first.time_s)
        {
            self.rows.insert(0, first);
        }
        if self.rows.last().is_none_or(|row| row.time_s < last.time_s) {
            self.rows.push(last);
        }
        self.rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::{BYTE_COLUMNS, COLUMNS};

    fn row(tick: u32, force_n: f32) -> Row {
        let mut numbers = [0.0; COLUMNS.len()];
        numbers[Row::NORMAL_FORCE] = force_n;
        Row {
            time_s: f64::from(tick) * 1e-3,
            numbers,
            bytes: [0; BYTE_COLUMNS.len()],
        }
    }

    #[test]
    fn a_long_run_keeps_its_shortest_flight_and_its_greatest_force() {
        for ticks in [10, 11_999, 12_000, 60_000, 1_000_003] {
            let mut thinned = Thinned::default();
            for tick in 0..ticks {
                let force_n = match tick {
                    7 => 0.0,
                    5 => 99.0,
                    other => 10.0 + (other % 3) as f32,
                };
                thinned.push(&row(tick, force_n));
            }
            let rows = thinned.finish();
            assert!(rows.len() <= MOST_ROWS + 2, "{ticks}");
            assert!(ticks < 12_000 || rows.len() >= MOST_ROWS / 2 - 2, "{ticks}");
            assert!(rows.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
            assert_eq!(rows[0].time_s, 0.0);
            assert_eq!(rows.last().unwrap().time_s, f64::from(ticks - 1) * 1e-3);
            for kept in [0.0, 99.0] {
                let of_force = |row: &&Row| row.normal_force_n() == kept;
                assert_eq!(rows.iter().filter(of_force).count(), 1, "{ticks} {kept}");
            }
        }
    }
}
