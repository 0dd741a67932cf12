//! Steps of order 5, for torques that change every few milliseconds.

use super::super::cash_karp::ShortStep;
use super::super::dop853::Tolerance;
use super::super::motion::{Evaluation, Motion, StateTerms, theta};
use super::super::torque::{LagResponse, Remaining};
use super::super::transition;
use super::ArmOnBelt;
use crate::plant::State;

/// Longest step to try at order 5, s: at the default tolerance, the error estimate of a sliding arm
/// reaches 1 at 2 ms.
pub(super) const LONGEST_S: f64 = 4e-3;

/// Longest step to try at order 5, in time constants of the torque stages. Over a longer step the
/// error estimate does not see how the arm's response to the torque changes with its posture.
const LONGEST_LAGS: f64 = 4.0;

/// Largest error estimate of such a step, relative to the tolerance: for the same reason.
const LARGEST_ERROR_WITH_LAG: f64 = 0.1;

impl ArmOnBelt {
    /// Tries to reach `until_s` in one step of order 5. Returns the state with its terms and the equations there
    /// if the error is within the tolerance and no event is near, and the size up to which order 5
    /// is worth another attempt.
    // Always: the result has 36 numbers, which a call would copy.
    #[inline(always)]
    pub(super) fn short_step(
        &self,
        motion: &Motion<'_>,
        here: &Evaluation,
        until_s: f64,
        tolerance: &Tolerance,
    ) -> (Option<(State, StateTerms, Evaluation)>, f64) {
        let (mode, start_s) = (self.mode, self.time_s);
        let size = until_s - start_s;
        let (terms, torque) = (&self.terms, &self.torque);
        let known = &terms.known;
        let start = &self.state;
        let remaining = torque.remaining(start_s);
        let lags = remaining >= f64::EPSILON;
        if lags && size > LONGEST_LAGS * torque.lag_s() {
            return (None, self.short_size_s);
        }
        let step = if !lags {
            let torque_nm = torque.with_remaining(0.0);
            let derivative = |_, t, x: &State| motion.derivative_near(known, mode, t, torque_nm, x);
            ShortStep::take(derivative, start_s, start, &here.slope, size, tolerance)
        } else {
            let settled = motion.under_torque(mode, start_s, torque.with_remaining(0.0), terms);
            let decaying = (here.slope - settled.slope) / remaining;
            let response = LagResponse::new(torque, &decaying);
            let Remaining { at_nodes, at_end } = torque.remaining_in_step(remaining, size);
            let derivative = |stage: usize, t: f64, x: &State| {
                let remaining = at_nodes[stage];
                let torque_nm = torque.with_remaining(remaining);
                let state = x + response.state(remaining);
                motion.derivative_near(known, mode, t, torque_nm, &state)
                    - response.slope(remaining)
            };
            let smooth = start - response.state(remaining);
            let slope = here.slope - response.slope(remaining);
            let mut step = ShortStep::take(derivative, start_s, &smooth, &slope, size, tolerance);
            step.end += response.state(at_end);
            step
        };
        let limit = if lags { LARGEST_ERROR_WITH_LAG } else { 1.0 };
        if step.error.is_nan() || step.error > limit {
            return (None, 0.5 * size);
        }
        // The estimate is of order 5 in the size.
        let longest = if step.error <= 1.0 / 32.0 {
            self.short_size_s.max((2.0 * size).min(LONGEST_S))
        } else {
            self.short_size_s
        };
        let end = if mode.slip().is_some() {
            motion.onto_belt_from(&known.turned_to(&theta(&step.end)), &step.end)
        } else {
            self.onto_constraint(motion, until_s, &step.end)
        };
        let terms = StateTerms::new(motion.arm, &end);
        let there = motion.with_terms(mode, until_s, &terms);
        let goes_on = transition::goes_on(motion, mode, size, here, &there);
        (goes_on.then_some((end, terms, there)), longest)
    }
}
