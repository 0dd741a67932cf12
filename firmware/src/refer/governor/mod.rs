//! Keeps the reference where sliding has a solution.
//!
//! p = Q22 (1 − μ s Q12/Q22) depends on the posture only. From the estimated friction and a margin
//! for its uncertainty, the governor computes how far along the belt p stays above a given fraction
//! of Q22: the edges of the admissible stretch around the tip. If the reference could not stop
//! before an edge, the governor decelerates it within a bound and holds it at the edge.
//!
//! The search for the edges goes outwards from the tip, one or two points at each tick. The time of
//! a tick is therefore bounded, and the edges follow the friction estimate within a tenth of a
//! second at 1 kHz.

mod search;
mod settings;

use painleve_shared::{Arm, Posture, Real};

use self::search::{Admissibility, Search};
pub use self::settings::GovernorSettings;
use crate::estimate::friction::FrictionEstimate;
use crate::estimate::response::ContactResponse;
use crate::refer::reference::TipReference;

/// Points evaluated at each tick while the edges are unknown.
const POINTS_IN_A_HURRY: u32 = 2;
/// Number of points from one end of the reach to the other in the outward search.
const STEPS_OVER_REACH: f32 = 64.0;
/// Fraction of the reach in use: beyond it the arm is almost straight.
const USABLE_REACH: f32 = 0.995;

/// Longest control period for which the distance kept from the edge suffices, s. With longer ones it grows with their
/// square: the tip swings further before the controller reacts.
const PERIOD_S: f32 = 1e-3;

/// A reference farther than this from the last one, m, counts as a jump; the governor catches up
/// with it.
const JUMP_M: f32 = 2e-3;
/// A reference nearer than this, m, has been caught up with.
const CAUGHT_M: f32 = 2e-5;
/// Rate at which the remaining distance to a target decays, 1/s.
const APPROACH_PER_S: f32 = 20.0;

/// What decides how far the edges stay from the point where p is zero, in addition to the settings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EdgeMargins {
    /// Least p/Q22 where a thrown tip may land. A change of it makes the edges unknown.
    pub landing_p_ratio: f32,
    /// Least p/Q22 for which the contact's response asks. The edges follow it.
    pub contact_p_ratio: f32,
    /// How far the contact has shown that it is soft, 0 … 1. Its least p/Q22 then replaces the distance that the edges
    /// keep on a rigid contact.
    pub soft: f32,
    /// Slow changes of the contact force from tick to tick by causes unknown, N. The edges follow them, too.
    pub restless_n: f32,
}

impl EdgeMargins {
    /// The margins for a contact with this response, and for a tip that may land where p/Q22 is `landing_p_ratio` or
    /// more.
    #[inline]
    pub fn of(response: &ContactResponse, landing_p_ratio: f32) -> Self {
        Self {
            landing_p_ratio,
            contact_p_ratio: response.least_p_ratio,
            soft: response.soft,
            restless_n: response.restless_n,
        }
    }
}

/// What makes the joints' motion uncertain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointErrors {
    /// Distance by which a count of the coarser encoder moves the tip along the belt, m.
    pub count_m: f32,
    /// Larger Coulomb friction of the joints, N·m.
    pub friction_nm: f32,
    /// Play of the gears, rad.
    pub play_rad: f32,
}

/// The governor's settings for one arm and rate.
#[derive(Clone, Copy, Debug)]
pub struct EdgeGovernor {
    enabled: bool,
    friction_deviations: f32,
    braking_m_s2: f32,
    catch_up_m_s: f32,
    tick_s: f32,
    /// Least p as a fraction of Q22, at this control rate.
    least_p_ratio: f32,
    /// Distance kept from the point where p has that value, with these encoders, m.
    distance_m: f32,
    /// Distance kept from the point where p is zero, because of the joints' friction and play, m.
    clearance_m: f32,
    /// The same for each N by which the force changes from tick to tick, and the largest such distance.
    clearance_m_n: f32,
    clearance_limit_m: f32,
}

/// The edges that an [`EdgeGovernor`] has found, and the reference it follows.
#[derive(Clone, Copy, Debug)]
pub struct GovernorState {
    /// Edges of the admissible stretch around the tip, m.
    lower_m: f32,
    upper_m: f32,
    search: Option<Search>,
    /// Edge for the least p/Q22 while the search goes on to the point where p is zero, m.
    near_m: f32,
    /// Least ratio p/Q22 that the present search requires beyond the setting.
    asked_p_ratio: f32,
    /// Whether both edges have been found since that requirement was set.
    is_fresh: bool,
    /// The last reference followed: position (m) and velocity (m/s).
    position_m: f32,
    velocity_m_s: f32,
    /// Whether it was equal to the given reference.
    follows: bool,
    /// Whether the given reference is beyond an edge.
    at_edge: bool,
}

impl GovernorState {
    /// Starts without edges except the arm's reach (m).
    pub fn new(reach_m: f32) -> Self {
        Self {
            lower_m: -USABLE_REACH * reach_m,
            upper_m: USABLE_REACH * reach_m,
            search: None,
            near_m: 0.0,
            asked_p_ratio: 0.0,
            is_fresh: false,
            position_m: 0.0,
            velocity_m_s: 0.0,
            follows: false,
            at_edge: false,
        }
    }

    /// Restarts from a tip at rest at `tip_t_m`, from where it catches up with the reference.
    pub fn restart(&mut self, tip_t_m: f32) {
        self.position_m = tip_t_m;
        self.velocity_m_s = 0.0;
        self.follows = false;
    }

    /// Returns the edges of the admissible stretch, m.
    pub fn edges_m(&self) -> (f32, f32) {
        (self.lower_m, self.upper_m)
    }

    /// Returns the edges once both have been found for the present requirement.
    pub fn fresh_edges_m(&self) -> Option<(f32, f32)> {
        self.is_fresh.then_some((self.lower_m, self.upper_m))
    }

    /// Returns whether an edge holds the reference back.
    pub fn is_at_edge(&self) -> bool {
        self.at_edge
    }
}

impl EdgeGovernor {
    /// Makes a governor that is called every `tick_s`, for these joints.
    pub fn new(settings: &GovernorSettings, tick_s: f32, joints: &JointErrors) -> Self {
        let periods = (tick_s / PERIOD_S).at_least(1.0);
        Self {
            enabled: settings.enabled,
            friction_deviations: settings.friction_deviations,
            braking_m_s2: settings.braking_m_s2,
            catch_up_m_s: settings.catch_up_m_s,
            tick_s,
            least_p_ratio: settings
                .minimum_p_ratio
                .at_least(settings.p_ratio_per_s2 * tick_s * tick_s),
            distance_m: settings.distance_m * (periods * periods)
                + settings.distance_counts * joints.count_m,
            clearance_m: settings.clearance_m_nm * joints.friction_nm
                + settings.clearance_m_rad * joints.play_rad,
            clearance_m_n: settings.clearance_m_n,
            clearance_limit_m: settings.clearance_limit_m,
        }
    }

    /// Continues the search for the edges around a tip at `tip_t_m` (m), with the settings' margins and these.
    pub fn search(
        &self,
        state: &mut GovernorState,
        arm: &Arm<f32>,
        posture: Posture,
        tip_t_m: f32,
        friction: &FrictionEstimate,
        margins: EdgeMargins,
    ) {
        if margins.landing_p_ratio != state.asked_p_ratio {
            state.asked_p_ratio = margins.landing_p_ratio;
            state.search = None;
            state.is_fresh = false;
        }
        let mut search = state.search.unwrap_or(Search::start(1.0, tip_t_m));
        let margin = self.friction_deviations * friction.deviation;
        let admissibility = Admissibility {
            arm,
            posture,
            friction: friction.coefficient + margin,
            slip: friction.slip_seen.then_some(friction.slip),
            minimum_p_ratio: if search.is_beyond {
                0.0
            } else {
                self.least_p_ratio
                    .at_least(margins.landing_p_ratio)
                    .at_least(margins.contact_p_ratio)
            },
        };
        let reach = USABLE_REACH * arm.reach_on_belt_m();
        let step = 2.0 * reach / STEPS_OVER_REACH;
        let points = if state.is_fresh { 1 } else { POINTS_IN_A_HURRY };
        for _ in 0..points {
            let point = search.point(step, reach);
            search = search.next(point, admissibility.at(point), reach);
        }
        if search.is_over() {
            search = self.settle(state, search, tip_t_m, margins);
        }
        state.search = Some(search);
    }

    /// Takes over the edge that a search has found, with the distances kept from it; returns the next search.
    fn settle(
        &self,
        state: &mut GovernorState,
        search: Search,
        tip_t_m: f32,
        margins: EdgeMargins,
    ) -> Search {
        let direction = search.direction;
        let clearance_m = (self.clearance_m + self.clearance_m_n * margins.restless_n)
            .at_most(self.clearance_limit_m);
        let edge_m = if search.is_beyond {
            let clear_m = search.inside_m - direction * clearance_m;
            direction * (direction * clear_m).at_most(direction * state.near_m)
        } else {
            search.inside_m - direction * (1.0 - margins.soft) * self.distance_m
        };
        if clearance_m > 0.0 && !search.is_beyond {
            state.near_m = edge_m;
            return search.beyond();
        }
        if direction > 0.0 {
            state.upper_m = edge_m;
        } else {
            // A stretch shorter than both margins shrinks to a point.
            state.lower_m = edge_m.at_most(state.upper_m);
            state.is_fresh = true;
        }
        Search::start(-direction, tip_t_m)
    }

    /// Returns the reference to follow instead of `wanted`, one tick after the last one.
    pub fn govern(&self, state: &mut GovernorState, wanted: &TipReference) -> TipReference {
        let tick_s = self.tick_s;
        if !self.enabled {
            return *wanted;
        }
        let (lower, upper) = (state.lower_m, state.upper_m);
        let outside = |position: f32| position > upper || position < lower;
        let speed = wanted.velocity_m_s;
        let stop_m = wanted.position_m + 0.5 * speed * speed.abs() / self.braking_m_s2;
        let jumps = (wanted.position_m - state.position_m).abs() > JUMP_M;
        state.at_edge = outside(wanted.position_m);
        state.follows = !outside(stop_m)
            && !state.at_edge
            && (if state.follows {
                !jumps
            } else {
                (wanted.position_m - state.position_m).abs() < CAUGHT_M
            });
        if state.follows {
            state.position_m = wanted.position_m;
            state.velocity_m_s = speed;
            return *wanted;
        }
        // The highest speed from which the reference still stops within a distance.
        let stopping_speed = |distance: f32| {
            (2.0 * self.braking_m_s2 * distance)
                .square_root()
                .at_most(APPROACH_PER_S * distance)
        };
        let target = wanted.position_m.limited(lower, upper);
        let away = target - state.position_m;
        let approach = stopping_speed(away.abs()).at_most(self.catch_up_m_s);
        let moves_along = if state.at_edge { 0.0 } else { speed };
        let velocity = (moves_along + approach.copysign(away)).limited(
            -stopping_speed((state.position_m - lower).at_least(0.0)),
            stopping_speed((upper - state.position_m).at_least(0.0)),
        );
        // Beyond an edge that has moved inwards, the limit above only forbids going further out.
        let step = 2.0 * self.braking_m_s2 * tick_s;
        let change = (velocity - state.velocity_m_s).within(step);
        let velocity = state.velocity_m_s + change;
        let acceleration = change / tick_s;
        state.velocity_m_s = velocity;
        state.position_m += velocity * tick_s;
        TipReference {
            position_m: state.position_m,
            velocity_m_s: velocity,
            acceleration_m_s2: acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::{ArmParameters, Slip};
    use proptest::prelude::*;

    const TICK_S: f32 = 1e-3;

    fn arm() -> Arm<f32> {
        Arm::new(ArmParameters::default()).unwrap()
    }

    fn known(coefficient: f32, slip: Slip) -> FrictionEstimate {
        FrictionEstimate {
            coefficient,
            next_coefficient: coefficient,
            catch_up: 0.0,
            deviation: 0.0,
            slip,
            slip_seen: true,
            sticks: false,
        }
    }

    fn governor() -> EdgeGovernor {
        let settings = GovernorSettings {
            minimum_p_ratio: 0.0,
            p_ratio_per_s2: 0.0,
            distance_m: 0.0,
            distance_counts: 0.0,
            ..Default::default()
        };
        EdgeGovernor::new(&settings, TICK_S, &JointErrors::default())
    }

    fn searched(tip_t_m: f32, posture: Posture, friction: &FrictionEstimate) -> GovernorState {
        let mut state = GovernorState::new(arm().reach_on_belt_m());
        for _ in 0..300 {
            governor().search(
                &mut state,
                &arm(),
                posture,
                tip_t_m,
                friction,
                EdgeMargins::default(),
            );
        }
        state
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

    /// Returns the upper edge, m, at which the searches settle with the friction 0.6. p is zero at 0.16471 m.
    fn upper_edge_m(
        governor: &EdgeGovernor,
        state: &mut GovernorState,
        margins: EdgeMargins,
    ) -> f32 {
        let friction = known(0.6, Slip::Positive);
        for _ in 0..300 {
            let posture = Posture::ElbowDown;
            governor.search(state, &arm(), posture, -0.1, &friction, margins);
        }
        state.edges_m().1
    }

    #[test]
    fn joints_with_friction_or_play_keep_their_distance_from_where_p_is_zero() {
        let edge_m = |joints: JointErrors, contact: f32| {
            let governor = EdgeGovernor::new(&GovernorSettings::default(), TICK_S, &joints);
            let mut state = GovernorState::new(arm().reach_on_belt_m());
            let margins = EdgeMargins {
                contact_p_ratio: contact,
                ..Default::default()
            };
            upper_edge_m(&governor, &mut state, margins)
        };
        let ideal = JointErrors::default();
        let rough = JointErrors {
            friction_nm: 0.05,
            play_rad: 1e-3,
            ..ideal
        };
        // 0.05 N·m and 1 mrad keep 6.8 mm.
        for contact in [0.0, 0.05] {
            let edge = edge_m(rough, contact);
            assert!((edge - (0.164_71 - 0.0068)).abs() < 3e-5, "{edge}");
        }
        // The least p/Q22 applies as well, as without friction.
        assert_eq!(edge_m(rough, 0.8), edge_m(ideal, 0.8));
        let stiff = JointErrors {
            friction_nm: 1.0,
            ..ideal
        };
        let edge = edge_m(stiff, 0.0);
        assert!((edge - (0.164_71 - 0.008)).abs() < 3e-5, "{edge}");
    }

    #[test]
    fn a_restless_force_keeps_the_tip_away_from_the_edge_and_a_calm_one_lets_it_return() {
        let mut state = GovernorState::new(arm().reach_on_belt_m());
        let mut edge_m = |restless_n: f32| {
            let margins = EdgeMargins {
                restless_n,
                ..Default::default()
            };
            upper_edge_m(&with_distances(), &mut state, margins)
        };
        let calm = edge_m(0.0);
        // 0.1 N from tick to tick keep 4 mm.
        let restless = edge_m(0.1);
        assert!((restless - (0.164_71 - 0.004)).abs() < 3e-5, "{restless}");
        let most = edge_m(10.0);
        assert!((most - (0.164_71 - 0.008)).abs() < 3e-5, "{most}");
        assert_eq!(edge_m(0.0), calm);
    }

    #[test]
    fn on_a_soft_contact_the_least_p_ratio_replaces_the_distance() {
        let edge_m = |contact: f32, soft: f32| {
            let margins = EdgeMargins {
                contact_p_ratio: contact,
                soft,
                ..Default::default()
            };
            let mut state = GovernorState::new(arm().reach_on_belt_m());
            upper_edge_m(&with_distances(), &mut state, margins)
        };
        let soft = edge_m(0.02, 1.0);
        assert!((soft - edge_m(0.02, 0.0) - 0.5e-3).abs() < 3e-5, "{soft}");
        assert!(edge_m(0.075, 1.0) < soft);
    }

    /// A governor with the default settings on an arm without joint errors.
    fn with_distances() -> EdgeGovernor {
        EdgeGovernor::new(
            &GovernorSettings::default(),
            TICK_S,
            &JointErrors::default(),
        )
    }

    #[test]
    fn the_distance_from_the_edge_grows_with_the_period_below_1_khz() {
        let settings = GovernorSettings::default();
        for (tick_hz, distance_m) in [(4000.0, 0.5e-3), (1000.0, 0.5e-3), (500.0, 2e-3)] {
            let governor = EdgeGovernor::new(&settings, 1.0 / tick_hz, &JointErrors::default());
            assert!((governor.distance_m - distance_m).abs() < 1e-6);
        }
    }

    #[test]
    fn a_tip_beyond_the_edge_is_led_back_to_the_stretch_next_to_it() {
        let friction = known(0.6, Slip::Positive);
        let (_, upper) = searched(0.18, Posture::ElbowDown, &friction).edges_m();
        assert!((upper - 0.164_71).abs() < 2e-5, "{upper}");
    }

    /// Follows the reference `wanted` until it stands still; returns the final and the largest
    /// position.
    fn follow(
        state: &mut GovernorState,
        wanted: impl Fn(f32) -> TipReference,
    ) -> (TipReference, f32) {
        let mut largest = f32::MIN;
        let mut last = TipReference::default();
        for tick in 0..8000 {
            last = governor().govern(state, &wanted(tick as f32 * TICK_S));
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
            let mut state = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
            state.restart(0.0);
            let edge = state.edges_m().1;
            let (last, largest) = follow(&mut state, ramp(0.0, speed, end));
            prop_assert!(state.is_at_edge());
            prop_assert!(largest < edge + 1e-4, "{} {}", largest, edge);
            prop_assert!((last.position_m - edge).abs() < 1e-4 && last.velocity_m_s.abs() < 1e-3);
        }

        #[test]
        fn a_reference_inside_is_reached_and_then_followed_exactly(
            speed in 0.01_f32..0.3, end in -0.1_f32..0.16, start in -0.15_f32..0.15,
        ) {
            let mut state = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
            state.restart(start);
            let (last, _) = follow(&mut state, ramp(-0.15, speed, end));
            let wanted = ramp(-0.15, speed, end)(7.999);
            prop_assert!((last.position_m - wanted.position_m).abs() < 1e-4, "{:?} {:?}", last, wanted);
            prop_assert!(!state.is_at_edge());
        }
    }
}
