//! Searches for one end of the admissible stretch, one point of the belt at a time.

use painleve_shared::Real;

/// Number of points from one end of the reach to the other in the outward search.
const STEPS_OVER_REACH: f32 = 32.0;
/// Largest number of inadmissible points that the search tries beside the tip, on both sides together. A stretch farther
/// off is not for this tip: on the way there it would be thrown off.
const MOST_REFUSED: u32 = STEPS_OVER_REACH as u32 / 4;
/// Halvings of the last step: 12 mm / 2¹⁰ is 11 µm. The interval's width would not end every search: the calibration may put the
/// reach below a point already found.
const HALVINGS: u32 = 10;

/// Phase of the search.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// Searches from the tip to either side for an admissible point.
    Entering {
        /// Number of points found inadmissible.
        refused: u32,
        /// The best of them, m, and the excess of p there, 1/kg.
        best_m: f32,
        most_per_kg: f32,
    },
    /// Searches outwards for an inadmissible point.
    Marching,
    /// Bisects between an admissible and an inadmissible point.
    Halving { beyond_m: f32, times: u32 },
}

/// The search for one end of the admissible stretch, with its progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// +1 for the upper edge, −1 for the lower one.
    pub(super) direction: f32,
    /// Last point on the tip's side of the edge, m.
    inside_m: f32,
    stage: Stage,
}

impl Search {
    /// Starts a search for the upper edge (`direction` +1) or the lower one (−1), from a tip at
    /// `tip_t_m`.
    pub(super) fn start(direction: f32, tip_t_m: f32) -> Self {
        Self {
            direction,
            inside_m: tip_t_m,
            stage: Stage::Entering {
                refused: 0,
                best_m: tip_t_m,
                most_per_kg: f32::MIN,
            },
        }
    }

    /// Returns the next point to evaluate, m.
    pub(super) fn point(&self, reach_m: f32) -> f32 {
        let step_m = 2.0 * reach_m / STEPS_OVER_REACH;
        let point = match self.stage {
            Stage::Entering { refused: 0, .. } => self.inside_m,
            // Places a whole number of steps from the middle, which do not move with the tip: where none is admissible, the best
            // one stays the best. In turn outwards and inwards.
            Stage::Entering { refused, .. } => {
                let steps = (self.inside_m / step_m).truncate_to_i32();
                let away = (refused / 2).cast_signed() * if self.inside_m < 0.0 { -1 } else { 1 };
                let inwards = refused % 2 == 1;
                step_m * (steps + if inwards { -away } else { away }) as f32
            }
            Stage::Marching => self.inside_m + self.direction * step_m,
            Stage::Halving { beyond_m, .. } => 0.5 * (self.inside_m + beyond_m),
        };
        point.within(reach_m)
    }

    /// Takes in how much p exceeds its least value at the point; returns the edge (m) once it is found.
    pub(super) fn next(&mut self, point_m: f32, excess_per_kg: f32, reach_m: f32) -> Option<f32> {
        let is_inside = excess_per_kg >= 0.0;
        match &mut self.stage {
            Stage::Marching if is_inside && point_m.abs() >= reach_m => return Some(point_m),
            Stage::Entering { .. } | Stage::Marching if is_inside => {
                self.inside_m = point_m;
                self.stage = Stage::Marching;
            }
            Stage::Entering {
                refused,
                best_m,
                most_per_kg,
            } => {
                if excess_per_kg > *most_per_kg {
                    *best_m = point_m;
                }
                if *refused >= MOST_REFUSED {
                    // No point is admissible: the best one.
                    return Some(*best_m);
                }
                *refused += 1;
                *most_per_kg = excess_per_kg.at_least(*most_per_kg);
            }
            Stage::Marching => {
                self.stage = Stage::Halving {
                    beyond_m: point_m,
                    times: 0,
                };
            }
            Stage::Halving { beyond_m, times } => {
                if is_inside {
                    self.inside_m = point_m;
                } else {
                    *beyond_m = point_m;
                }
                *times += 1;
                if *times >= HALVINGS {
                    return Some(self.inside_m);
                }
            }
        }
        None
    }
}
