//! Keeps the reference where sliding has a solution.
//!
//! p = Q22 (1 − μ s Q12/Q22) depends on the posture only. From the estimated friction and a margin
//! for its uncertainty, the governor computes how far along the belt p stays above a given fraction
//! of Q22 with a given distance to spare: the edges of the admissible stretch
//! around the tip. If the reference could not stop before an edge, the governor decelerates it within
//! a bound and holds it at the edge.
//!
//! The search for the edges goes outwards from the tip, one point at a time. The time of a tick is
//! therefore bounded, and the edges follow the friction estimate within about a third of a second at 1 kHz.

mod search;

use painleve_shared::contact::ScaledRow;
use painleve_shared::{Arm, Posture, Real, settings};

use self::search::Search;
use crate::estimate::RESOLVED_M;
use crate::estimate::friction::FrictionEstimate;
use crate::refer::reference::TipReference;

/// Fraction of the reach in use: beyond it the arm is almost straight. With 0.999 more runs were lost (lab book, *Factors on
/// constants*).
pub const USABLE_REACH: f32 = 0.995;

/// Distance within which two places count as the same, m. A reference that moves farther in a tick is a jump, with which the
/// governor catches up; a thrown tip is lowered within it of its landing point.
pub const NEAR_M: f32 = 2e-3;
/// Lack of p at a place from which the kept distance is out of reach, 1/(kg·m), times 1 m and its distance from the middle: more
/// than anywhere else, so that of such places the innermost counts as the best.
const OUT_OF_REACH_PER_KG_M: f32 = 1e9;
/// Rate at which the remaining distance to a target decays, 1/s. All of it in one tick lost more runs (lab book, *Constants that
/// are not needed*).
const APPROACH_PER_S: f32 = 20.0;

settings! {
    /// Settings of the edge governor.
    #[derive(Copy)]
    pub struct GovernorSettings {
        /// Whether the governor is active; if not, the reference must be within reach.
        enabled: bool = true;
        /// Least p/Q22.
        p_ratio: f32 = 0.08, 0.0..=0.9;
        /// Least p. A belt surface that accelerates by a towards or away from the arm changes the normal force by a/p, and
        /// must not use all of it up; p falls as the arm straightens, whatever p/Q22 is.
        p_per_kg: f32 = 0.0, 0.0..=1e3, "1/kg";
        /// Number of standard deviations by which friction and the tip's place are taken to be worse than estimated.
        deviations: f32 = 2.0, 0.0..=10.0;
        /// Distance kept from the point where p/Q22 has its least value, at 1 kHz; it grows with the square of the control
        /// period, in which a disturbance moves the tip before the controller reacts. The deviations of the tip's place
        /// are added in squares.
        distance_m: f32 = 0.5e-3, 0.0..=0.1, "m";
        /// Deceleration at which the reference stops before an edge.
        braking_m_s2: f32 = 1.0, 1e-3..=1e3, "m/s²";
        /// Largest speed of the approach to a reference that is away from the tip, in addition to its own. A tip that overtakes
        /// a slow belt slips in the other direction, for which nothing has been kept free.
        catch_up_m_s: f32 = 0.06, 1e-3..=10.0, "m/s";
    }
}

/// A stretch of the belt between two places, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The lower end, m.
    pub lower_m: f32,
    /// The upper end, m.
    pub upper_m: f32,
}

/// The governor of one arm: the edges that it has found, and the reference that it follows.
// In this order: see the fields of the controller.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct EdgeGovernor {
    /// The admissible stretch around the tip, as far as it has been found.
    pub stretch: Stretch,
    search: Search,
    /// Posture for which it looks, and the least ratio p/Q22 that it requires beyond the setting; `None` before the first.
    searched_for: Option<(Posture, f32)>,
    /// Whether both edges have been found for it.
    found: bool,
    /// The last reference followed.
    pub(super) last: TipReference,
    /// Whether it was equal to the given reference.
    follows: bool,
    /// Whether the given reference is beyond an edge, which holds it back.
    pub at_edge: bool,
    settings: GovernorSettings,
    tick_s: f32,
    distance_m: f32,
}

impl EdgeGovernor {
    /// Makes a governor that is called every `tick_s` (s) and keeps `distance_m` from the edges, which are unknown except
    /// for the arm's reach (m).
    pub fn new(settings: &GovernorSettings, tick_s: f32, distance_m: f32, reach_m: f32) -> Self {
        Self {
            stretch: Stretch {
                lower_m: -USABLE_REACH * reach_m,
                upper_m: USABLE_REACH * reach_m,
            },
            search: Search::start(1.0, 0.0),
            searched_for: None,
            found: false,
            last: TipReference::default(),
            follows: false,
            at_edge: false,
            settings: *settings,
            tick_s,
            distance_m,
        }
    }

    /// Restarts from a tip at rest at `tip_t_m`, from where it catches up with the reference.
    pub fn restart(&mut self, tip_t_m: f32) {
        self.last = TipReference::at_rest(tip_t_m);
        self.follows = false;
    }

    /// Returns whether both edges have been found for this posture and least p/Q22.
    pub fn has_edges_for(&self, posture: Posture, landing_p_ratio: f32) -> bool {
        self.found && self.searched_for == Some((posture, landing_p_ratio))
    }

    /// Returns whether both edges of a tip on the belt have been found for this posture, or are not to be kept.
    pub fn knows_edges(&self, posture: Posture) -> bool {
        self.has_edges_for(posture, 0.0) || !self.settings.enabled
    }

    /// Continues the search for the edges around a tip at `tip_t_m` (m). Where a thrown tip may land,
    /// p/Q22 is to be `landing_p_ratio` at least; a change of it, or of the posture, makes the edges unknown.
    pub fn search(
        &mut self,
        arm: &Arm<f32>,
        posture: Posture,
        tip_t_m: f32,
        friction: &FrictionEstimate,
        landing_p_ratio: f32,
    ) {
        let reach = USABLE_REACH * arm.reach_on_belt_m();
        if self.searched_for != Some((posture, landing_p_ratio)) {
            let before = self.searched_for.map(|(before, _)| before);
            if before != Some(posture) {
                // Farther from the tip nothing is known: a reference that went there might not stop at the edge.
                self.stretch = Stretch {
                    lower_m: tip_t_m - NEAR_M,
                    upper_m: tip_t_m + NEAR_M,
                };
            }
            self.searched_for = Some((posture, landing_p_ratio));
            self.search = Search::start(1.0, tip_t_m);
            self.found = false;
        }
        let direction = self.search.direction;
        let point_m = self.search.point(reach);
        let worst_friction = friction.coefficient + self.settings.deviations * friction.deviation();
        let least_p_ratio = self.settings.p_ratio.at_least(landing_p_ratio);
        let there_m = point_m + direction * self.distance_m;
        let row = arm.inverse_inertia_row_on_belt(there_m, posture);
        // How much p exceeds its least value, 1/kg. Where it does, sliding has a solution with the margin.
        let excess_per_kg = row.map_or(
            -OUT_OF_REACH_PER_KG_M * (1.0 + point_m.abs()),
            |ScaledRow { q12, q22, factor }| {
                let against = if friction.slip_seen {
                    friction.slip.sign::<f32>() * q12
                } else {
                    // Both directions must be admissible.
                    q12.abs()
                };
                let least = (least_p_ratio * q22).at_least(self.settings.p_per_kg * factor);
                (q22 - worst_friction * against - least) / factor
            },
        );
        let Some(edge_m) = self.search.next(point_m, excess_per_kg, reach) else {
            return;
        };
        if direction > 0.0 {
            // Until the lower one is found, the edges stay in order.
            self.stretch.lower_m = self.stretch.lower_m.at_most(edge_m);
            self.stretch.upper_m = edge_m;
        } else {
            // A stretch shorter than both margins shrinks to a point.
            self.stretch.lower_m = edge_m.at_most(self.stretch.upper_m);
            self.found = true;
        }
        self.search = Search::start(-direction, tip_t_m);
    }

    /// Returns the reference to follow instead of `wanted`, one tick after the last one.
    pub fn govern(&mut self, wanted: &TipReference) -> TipReference {
        let (before, tick_s) = (self.last, self.tick_s);
        let braking_m_s2 = self.settings.braking_m_s2;
        let (lower, upper) = (self.stretch.lower_m, self.stretch.upper_m);
        let outside = |position: f32| position > upper || position < lower;
        let speed = wanted.velocity_m_s;
        let stop_m = wanted.position_m + 0.5 * speed * speed.abs() / braking_m_s2;
        let enabled = self.settings.enabled;
        self.at_edge = enabled && outside(wanted.position_m);
        // A reference that moves or is about to is on its way of one tick, or this far from it.
        let half_way_m = 0.5 * speed * tick_s;
        let away_m = (wanted.position_m - before.position_m - half_way_m).abs() - half_way_m.abs();
        let near_m = if self.follows { NEAR_M } else { RESOLVED_M };
        self.follows = !enabled || (!self.at_edge && !outside(stop_m) && away_m < near_m);
        if self.follows {
            self.last = *wanted;
            return *wanted;
        }
        // The highest speed from which the reference still stops within a distance.
        let stopping_speed = |distance: f32| {
            (2.0 * braking_m_s2 * distance)
                .square_root()
                .at_most(APPROACH_PER_S * distance)
        };
        let target = wanted.position_m.limited(lower, upper);
        let away = target - before.position_m;
        let approach = stopping_speed(away.abs()).at_most(self.settings.catch_up_m_s);
        let moves_along = if self.at_edge { 0.0 } else { speed };
        let velocity = (moves_along + approach.copysign(away)).limited(
            -stopping_speed((before.position_m - lower).at_least(0.0)),
            stopping_speed((upper - before.position_m).at_least(0.0)),
        );
        // Beyond an edge that has moved inwards, the limit above only forbids going further out. Twice the braking, so that
        // the velocity follows a stopping speed, which falls by one in a tick, with a margin.
        let step = 2.0 * braking_m_s2 * tick_s;
        let change = (velocity - before.velocity_m_s).within(step);
        let velocity = before.velocity_m_s + change;
        self.last = TipReference {
            position_m: before.position_m + velocity * tick_s,
            velocity_m_s: velocity,
            acceleration_m_s2: change / tick_s,
        };
        self.last
    }
}

#[cfg(test)]
mod tests;
