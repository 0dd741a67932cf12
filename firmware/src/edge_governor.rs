//! Keeps the reference where sliding has a solution.
//!
//! p = Q22 (1 − μ s Q12/Q22) depends on the posture only. With the estimated friction and a
//! margin for its uncertainty, the governor knows how far along the belt p stays above a
//! given part of Q22: the edges of the admissible stretch around the tip. A reference that
//! could not stop before an edge is followed with bounded deceleration to the edge
//! and held there.
//!
//! The edges are searched for outwards from the tip, a point or two a tick, so that the time
//! of a tick is bounded and the edges follow the friction estimate, within a tenth of a
//! second at 1 kHz.

use painleve_shared::range::{self, OutOfRange};
use painleve_shared::{Arm, Posture, Real, Slip};
use serde::{Deserialize, Serialize};

use crate::friction_estimator::FrictionEstimate;
use crate::reference::TipReference;

/// Points looked at in one tick while the edges are not known.
const POINTS_IN_A_HURRY: u32 = 2;
/// Points from one end of the reach to the other in the search outwards.
const STEPS_OVER_REACH: f32 = 64.0;
/// Points that reach from one end over the other, to either side of the tip.
const MOST_REFUSED: u32 = 128;
/// Halvings of the last step: 6 mm / 2⁹ is 11 µm.
const HALVINGS: u32 = 9;
/// Part of the reach that is used: beyond it the arm is all but straight.
const USABLE_REACH: f32 = 0.995;

/// A reference this far from the last one jumps, m; it is caught up with.
const JUMP_M: f32 = 2e-3;
/// A reference this near is caught up with, m.
const CAUGHT_M: f32 = 2e-5;
/// Rate at which the last stretch to a target is made, 1/s.
const APPROACH_PER_S: f32 = 20.0;

/// Settings of the edge governor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GovernorSettings {
    /// Whether the reference is governed.
    pub enabled: bool,
    /// Least p as a part of Q22.
    pub minimum_p_ratio: f32,
    /// What is added to that for slow sampling, times the square of the time between ticks, 1/s²:
    /// so far does a disturbance move the tip before anything is done about it.
    pub p_ratio_per_s2: f32,
    /// Deviations of the friction estimate that are added to it.
    pub friction_deviations: f32,
    /// Distance that is kept from where p has its least value, m.
    pub distance_m: f32,
    /// What is added to that for each count of the encoders at the tip: so far is the tip moved
    /// to and fro by their rounding.
    pub distance_counts: f32,
    /// Deceleration with which the reference stops before an edge, m/s².
    pub braking_m_s2: f32,
    /// Fastest approach to a reference that is away from the tip, m/s.
    pub catch_up_m_s: f32,
}

impl Default for GovernorSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            minimum_p_ratio: 0.01,
            p_ratio_per_s2: 1e4,
            friction_deviations: 1.5,
            distance_m: 0.6e-3,
            distance_counts: 4.0,
            braking_m_s2: 1.0,
            catch_up_m_s: 0.3,
        }
    }
}

impl GovernorSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let key = |key, value, minimum, maximum| range::check(key, value, minimum, maximum);
        key(
            "controller.governor.minimum_p_ratio",
            self.minimum_p_ratio,
            0.0,
            0.9,
        )?;
        key(
            "controller.governor.p_ratio_per_s2",
            self.p_ratio_per_s2,
            0.0,
            1e6,
        )?;
        key(
            "controller.governor.distance_counts",
            self.distance_counts,
            0.0,
            1e3,
        )?;
        key(
            "controller.governor.friction_deviations",
            self.friction_deviations,
            0.0,
            10.0,
        )?;
        key("controller.governor.distance_m", self.distance_m, 0.0, 0.1)?;
        key(
            "controller.governor.braking_m_s2",
            self.braking_m_s2,
            1e-3,
            1e3,
        )?;
        key(
            "controller.governor.catch_up_m_s",
            self.catch_up_m_s,
            1e-3,
            10.0,
        )
    }
}

/// Friction with its margin, and where on the belt it is asked about.
#[derive(Clone, Copy, Debug)]
struct Admissibility<'a> {
    arm: &'a Arm<f32>,
    posture: Posture,
    /// μ̂ plus margin.
    friction: f32,
    /// Direction of slip; `None` while it has not been seen.
    slip: Option<Slip>,
    minimum_p_ratio: f32,
}

impl Admissibility<'_> {
    fn at(&self, tip_t_m: f32) -> bool {
        self.arm
            .coupling_on_belt(tip_t_m, self.posture)
            .is_some_and(|coupling| {
                let against = match self.slip {
                    Some(slip) => slip.sign::<f32>() * coupling,
                    // It must do for either.
                    None => coupling.abs(),
                };
                1.0 - self.friction * against >= self.minimum_p_ratio
            })
    }
}

/// What the search is about.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// From the tip to either side for a point that is admissible.
    Entering {
        /// Points that are not.
        refused: u32,
    },
    /// Outwards for one that is not.
    Marching,
    /// Between the two.
    Halving { beyond_m: f32, times: u32 },
    /// Done: the edge is at the inside.
    Found,
}

/// The search for one end of the admissible stretch, and how far it is.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// +1 towards the upper edge, −1 towards the lower one.
    direction: f32,
    /// Last point on the tip's side of the edge, m.
    inside_m: f32,
    stage: Stage,
}

impl Search {
    /// For the upper edge (`direction` +1) or the lower one (−1), from a tip at `tip_t_m`.
    fn start(direction: f32, tip_t_m: f32) -> Self {
        Self {
            direction,
            inside_m: tip_t_m,
            stage: Stage::Entering { refused: 0 },
        }
    }

    /// The point to look at, m.
    fn point(&self, step_m: f32, reach_m: f32) -> f32 {
        let point = match self.stage {
            Stage::Found => self.inside_m,
            // By turns on the side of the middle of the belt and on the other.
            Stage::Entering { refused } => {
                let away_m = step_m * refused.div_ceil(2) as f32;
                let inwards = refused % 2 == 1;
                let outwards_m = away_m.copysign(self.inside_m);
                self.inside_m + if inwards { -outwards_m } else { outwards_m }
            }
            Stage::Marching => self.inside_m + self.direction * step_m,
            Stage::Halving { beyond_m, .. } => 0.5 * (self.inside_m + beyond_m),
        };
        point.within(reach_m)
    }

    /// The search after the point has been looked at.
    fn next(self, point_m: f32, admissible: bool, reach_m: f32) -> Self {
        let (inside_m, stage) = match (self.stage, admissible) {
            (Stage::Entering { .. }, true) => (point_m, Stage::Marching),
            // Nothing is admissible: the middle of the belt is as good as any place.
            (Stage::Entering { refused }, false) if refused >= MOST_REFUSED => (0.0, Stage::Found),
            (Stage::Entering { refused }, false) => {
                let refused = refused + 1;
                (self.inside_m, Stage::Entering { refused })
            }
            (Stage::Marching, true) if point_m.abs() >= reach_m => (point_m, Stage::Found),
            (Stage::Marching, true) => (point_m, Stage::Marching),
            (Stage::Marching, false) => {
                let halving = Stage::Halving {
                    beyond_m: point_m,
                    times: 0,
                };
                (self.inside_m, halving)
            }
            (Stage::Halving { times, .. }, _) if times >= HALVINGS => (self.inside_m, Stage::Found),
            (Stage::Halving { beyond_m, times }, true) => {
                let times = times + 1;
                (point_m, Stage::Halving { beyond_m, times })
            }
            (Stage::Halving { times, .. }, false) => {
                let halving = Stage::Halving {
                    beyond_m: point_m,
                    times: times + 1,
                };
                (self.inside_m, halving)
            }
            (Stage::Found, _) => (self.inside_m, Stage::Found),
        };
        Self {
            inside_m,
            stage,
            ..self
        }
    }
}

/// The governor with its state.
#[derive(Clone, Copy, Debug)]
pub struct EdgeGovernor {
    settings: GovernorSettings,
    /// Least p as a part of Q22, for this rate.
    least_p_ratio: f32,
    /// Distance from where it has that value, for these encoders, m.
    distance_m: f32,
    /// Edges of the admissible stretch around the tip, m.
    lower_m: f32,
    upper_m: f32,
    search: Option<Search>,
    /// What the present search asks for beyond the setting.
    asked_p_ratio: f32,
    /// Whether both edges have been found since it was asked.
    is_fresh: bool,
    /// The reference that was followed last: position (m) and velocity (m/s).
    position_m: f32,
    velocity_m_s: f32,
    /// Whether that was the given one.
    follows: bool,
    /// Whether the given reference is beyond an edge.
    at_edge: bool,
}

impl EdgeGovernor {
    /// A governor that knows no edges but the arm's reach (m).
    pub fn new(settings: &GovernorSettings, reach_m: f32, tick_s: f32, count_m: f32) -> Self {
        Self {
            settings: *settings,
            least_p_ratio: settings.minimum_p_ratio + settings.p_ratio_per_s2 * tick_s * tick_s,
            distance_m: settings.distance_m + settings.distance_counts * count_m,
            lower_m: -USABLE_REACH * reach_m,
            upper_m: USABLE_REACH * reach_m,
            search: None,
            asked_p_ratio: 0.0,
            is_fresh: false,
            position_m: 0.0,
            velocity_m_s: 0.0,
            follows: false,
            at_edge: false,
        }
    }

    /// Starts again from a tip at rest at `tip_t_m`: the reference is caught up with from there.
    pub fn restart(&mut self, tip_t_m: f32) {
        self.position_m = tip_t_m;
        self.velocity_m_s = 0.0;
        self.follows = false;
    }

    /// Edges of the admissible stretch, m.
    pub fn edges_m(&self) -> (f32, f32) {
        (self.lower_m, self.upper_m)
    }

    /// The same once both have been found for what the search was last asked for.
    pub fn fresh_edges_m(&self) -> Option<(f32, f32)> {
        self.is_fresh.then_some((self.lower_m, self.upper_m))
    }

    /// Whether an edge holds the reference back.
    pub fn is_at_edge(&self) -> bool {
        self.at_edge
    }

    /// Goes on searching for the edges around a tip at `tip_t_m`, with p at least
    /// `minimum_p_ratio` of Q22 or the setting, whichever is more.
    pub fn search(
        &mut self,
        arm: &Arm<f32>,
        posture: Posture,
        tip_t_m: f32,
        friction: &FrictionEstimate,
        minimum_p_ratio: f32,
    ) {
        if minimum_p_ratio != self.asked_p_ratio {
            self.asked_p_ratio = minimum_p_ratio;
            self.search = None;
            self.is_fresh = false;
        }
        let margin = self.settings.friction_deviations * friction.deviation;
        let admissibility = Admissibility {
            arm,
            posture,
            friction: friction.coefficient + margin,
            slip: friction.slip_seen.then_some(friction.slip),
            minimum_p_ratio: self.least_p_ratio.at_least(minimum_p_ratio),
        };
        let reach = USABLE_REACH * arm.reach_on_belt_m();
        let step = 2.0 * reach / STEPS_OVER_REACH;
        let mut search = self.search.unwrap_or(Search::start(1.0, tip_t_m));
        let points = if self.is_fresh { 1 } else { POINTS_IN_A_HURRY };
        for _ in 0..points {
            let point = search.point(step, reach);
            search = search.next(point, admissibility.at(point), reach);
            if search.stage == Stage::Found {
                let edge = search.inside_m - search.direction * self.distance_m;
                if search.direction > 0.0 {
                    self.upper_m = edge;
                    search = Search::start(-1.0, tip_t_m);
                } else {
                    // A stretch shorter than both distances is a point.
                    self.lower_m = edge.at_most(self.upper_m);
                    self.is_fresh = true;
                    search = Search::start(1.0, tip_t_m);
                }
            }
        }
        self.search = Some(search);
    }

    /// The reference to follow instead of `wanted`, a tick of `tick_s` after the last one.
    pub fn govern(&mut self, wanted: &TipReference, tick_s: f32) -> TipReference {
        let settings = &self.settings;
        if !settings.enabled {
            return *wanted;
        }
        let (lower, upper) = (self.lower_m, self.upper_m);
        let outside = |position: f32| position > upper || position < lower;
        let speed = wanted.velocity_m_s;
        let stop_m = wanted.position_m + 0.5 * speed * speed.abs() / settings.braking_m_s2;
        let jumps = (wanted.position_m - self.position_m).abs() > JUMP_M;
        self.at_edge = outside(wanted.position_m);
        self.follows = !outside(stop_m)
            && !self.at_edge
            && (if self.follows {
                !jumps
            } else {
                (wanted.position_m - self.position_m).abs() < CAUGHT_M
            });
        if self.follows {
            self.position_m = wanted.position_m;
            self.velocity_m_s = speed;
            return *wanted;
        }
        // The fastest speed from which the reference still stops within a distance.
        let stopping_speed = |distance: f32| {
            (2.0 * settings.braking_m_s2 * distance)
                .square_root()
                .at_most(APPROACH_PER_S * distance)
        };
        let target = wanted.position_m.limited(lower, upper);
        let away = target - self.position_m;
        let approach = stopping_speed(away.abs()).at_most(settings.catch_up_m_s);
        let moves_along = if self.at_edge { 0.0 } else { speed };
        let velocity = (moves_along + approach.copysign(away)).limited(
            -stopping_speed((self.position_m - lower).at_least(0.0)),
            stopping_speed((upper - self.position_m).at_least(0.0)),
        );
        // Beyond an edge that has moved in, the limit above forbids nothing but going further.
        let step = 2.0 * settings.braking_m_s2 * tick_s;
        let change = (velocity - self.velocity_m_s).within(step);
        let velocity = self.velocity_m_s + change;
        let acceleration = change / tick_s;
        self.velocity_m_s = velocity;
        self.position_m += velocity * tick_s;
        TipReference {
            position_m: self.position_m,
            velocity_m_s: velocity,
            acceleration_m_s2: acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;
    use proptest::prelude::*;

    const TICK_S: f32 = 1e-3;

    fn arm() -> Arm<f32> {
        Arm::new(ArmParameters::default()).unwrap()
    }

    fn known(coefficient: f32, slip: Slip) -> FrictionEstimate {
        FrictionEstimate {
            coefficient,
            deviation: 0.0,
            slip,
            slip_seen: true,
            sticks: false,
        }
    }

    fn searched(tip_t_m: f32, posture: Posture, friction: &FrictionEstimate) -> EdgeGovernor {
        let settings = GovernorSettings {
            minimum_p_ratio: 0.0,
            p_ratio_per_s2: 0.0,
            distance_m: 0.0,
            distance_counts: 0.0,
            ..Default::default()
        };
        let mut governor = EdgeGovernor::new(&settings, arm().reach_on_belt_m(), TICK_S, 0.0);
        for _ in 0..300 {
            governor.search(&arm(), posture, tip_t_m, friction, 0.0);
        }
        governor
    }

    #[test]
    fn the_edges_are_those_of_table_ii() {
        let friction = known(0.6, Slip::Positive);
        for (posture, edge) in [(Posture::ElbowUp, 0.182_68), (Posture::ElbowDown, 0.164_71)] {
            let (lower, upper) = searched(-0.1, posture, &friction).edges_m();
            assert!((upper - edge).abs() < 2e-5, "{posture:?}: {upper}");
            assert!(lower < -0.183, "{posture:?}: {lower}");
        }
    }

    #[test]
    fn a_tip_beyond_the_edge_is_led_back_to_the_stretch_next_to_it() {
        let friction = known(0.6, Slip::Positive);
        let (_, upper) = searched(0.18, Posture::ElbowDown, &friction).edges_m();
        assert!((upper - 0.164_71).abs() < 2e-5, "{upper}");
    }

    /// Goes through the reference `wanted` until it stands; returns where and the largest position.
    fn follow(
        governor: &mut EdgeGovernor,
        wanted: impl Fn(f32) -> TipReference,
    ) -> (TipReference, f32) {
        let mut largest = f32::MIN;
        let mut last = TipReference::default();
        for tick in 0..8000 {
            last = governor.govern(&wanted(tick as f32 * TICK_S), TICK_S);
            largest = largest.max(last.position_m);
        }
        (last, largest)
    }

    fn ramp(from: f32, speed: f32, end: f32) -> impl Fn(f32) -> TipReference {
        move |time: f32| {
            let position_m = from + speed * time;
            if position_m < end {
                TipReference {
                    position_m,
                    velocity_m_s: speed,
                    acceleration_m_s2: 0.0,
                }
            } else {
                TipReference {
                    position_m: end,
                    ..Default::default()
                }
            }
        }
    }

    proptest! {
        #[test]
        fn edges_mirror_with_posture_and_slip(friction in 0.4_f32..1.0, tip in -0.1_f32..0.0) {
            let here = searched(tip, Posture::ElbowDown, &known(friction, Slip::Positive)).edges_m();
            let there = searched(-tip, Posture::ElbowUp, &known(friction, Slip::Negative)).edges_m();
            prop_assert!((here.1 + there.0).abs() < 3e-5 && (here.0 + there.1).abs() < 3e-5);
        }

        #[test]
        fn a_reference_beyond_the_edge_ends_at_it_and_never_passes_it(
            speed in 0.03_f32..0.5, end in 0.166_f32..0.3,
        ) {
            let mut governor = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
            governor.restart(0.0);
            let edge = governor.edges_m().1;
            let (last, largest) = follow(&mut governor, ramp(0.0, speed, end));
            prop_assert!(governor.is_at_edge());
            prop_assert!(largest < edge + 1e-4, "{} {}", largest, edge);
            prop_assert!((last.position_m - edge).abs() < 1e-4 && last.velocity_m_s.abs() < 1e-3);
        }

        #[test]
        fn a_reference_inside_is_reached_and_then_followed_exactly(
            speed in 0.01_f32..0.3, end in -0.1_f32..0.16, start in -0.15_f32..0.15,
        ) {
            let mut governor = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
            governor.restart(start);
            let (last, _) = follow(&mut governor, ramp(-0.15, speed, end));
            let wanted = ramp(-0.15, speed, end)(7.999);
            prop_assert!((last.position_m - wanted.position_m).abs() < 1e-4, "{:?} {:?}", last, wanted);
            prop_assert!(!governor.is_at_edge());
        }
    }
}
