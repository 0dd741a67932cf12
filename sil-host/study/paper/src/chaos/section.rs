//! Returns of the arm to θ̇1 = 0 from below: the section of the paper's Fig. 5.

use painleve_plant::mechanics::dop853::{Dop853Step, Tolerance};
use painleve_plant::mechanics::event::first_negative;
use painleve_plant::mechanics::impact::ImpactLaw;
use painleve_plant::mechanics::{ArmProbe, ArmStep};
use painleve_plant::{Event, State};

use super::arm::ArmTangent;
use super::tangent::Tangent;
use super::verdict::Return;

/// Threshold below which θ̇1 must fall between returns, rad/s: during quiet sliding, rounding
/// changes the sign of θ̇1.
const DOWNWARDS_RAD_S: f64 = -1e-6;

/// Number of intervals of a step that are searched separately.
const SEARCH_PARTS: u32 = 8;

/// Index of θ̇1 in the state.
const RATE: usize = 2;

/// Observes a plant on a belt of constant speed: its returns, and the growth of a deviation
/// between them.
#[derive(Clone, Debug)]
pub struct Returns {
    tangent: ArmTangent,
    went_down: bool,
    step: Box<Dop853Step<4>>,
    returns: Vec<Return<4>>,
}

impl Returns {
    /// Creates a probe without returns; `impact` is the plant's impact law.
    pub fn new(impact: ImpactLaw) -> Self {
        Self {
            tangent: ArmTangent::new(impact, Tangent::default()),
            went_down: false,
            step: Box::new(Dop853Step::empty()),
            returns: Vec::new(),
        }
    }

    /// Returns the returns in order. A velocity that jumps from negative to positive in an
    /// impact counts as a return, with the state after it.
    pub fn returns(&self) -> &[Return<4>] {
        &self.returns
    }

    fn note(&mut self, time_s: f64, state: State) {
        self.went_down = false;
        self.returns.push(Return {
            time_s,
            state,
            log_growth: self.tangent.tangent_mut().take_log_growth(),
        });
    }

    /// Returns the first time at which θ̇1 turns positive in a step, s, and the state there.
    fn upward_zero(&mut self, now: &ArmStep<'_>) -> Option<(f64, State)> {
        let (motion, mode, size_s) = (now.motion, now.mode, now.end_s - now.start_s);
        let derivative = |t: f64, x: &State| motion.derivative(mode, t, x);
        let slope = derivative(now.start_s, now.start);
        let end_slope = derivative(now.end_s, now.end);
        // The cubic through both ends lies in the convex hull of its Bernstein coefficients.
        let third = size_s / 3.0;
        let hull = [
            now.start[RATE],
            now.start[RATE] + slope[RATE] * third,
            now.end[RATE] - end_slope[RATE] * third,
            now.end[RATE],
        ];
        self.went_down |= hull[0] < DOWNWARDS_RAD_S;
        if hull.iter().all(|rate| *rate <= 0.0) || hull.iter().all(|rate| *rate > 0.0) {
            return None;
        }
        let tolerance = Tolerance {
            relative: 1.0,
            absolute: 1.0,
        };
        self.step.take(
            &derivative,
            now.start_s,
            now.start,
            &slope,
            size_s,
            &tolerance,
        );
        let end_slope = derivative(now.start_s + size_s, &self.step.end);
        self.step.finish(&end_slope);
        let dense = self.step.dense(&derivative);
        let mut before = (now.start_s, now.start[RATE]);
        for part in 1..=SEARCH_PARTS {
            let at = now.start_s + size_s * (f64::from(part) / f64::from(SEARCH_PARTS));
            let after = (at, dense.at(at)[RATE]);
            self.went_down |= after.1 < DOWNWARDS_RAD_S;
            if self.went_down && before.1 <= 0.0 && after.1 > 0.0 {
                let margin = |t: f64| -dense.at(t)[RATE];
                let zero = first_negative((before.0, -before.1), (after.0, -after.1), margin);
                return Some((zero, dense.at(zero)));
            }
            before = after;
        }
        None
    }
}

impl ArmProbe for Returns {
    fn step(&mut self, now: &ArmStep<'_>) {
        let jumped = self
            .tangent
            .before()
            .is_some_and(|state| state[RATE] <= 0.0)
            && now.start[RATE] > 0.0
            && self.went_down;
        self.tangent.step(now);
        let flow = now.motion.derivative(now.mode, now.end_s, now.end);
        let zero = if jumped {
            Some((now.start_s, *now.start))
        } else {
            self.upward_zero(now)
        };
        if let Some((time_s, state)) = zero {
            // The position within a step at which the flow is removed makes no difference in the
            // long run.
            self.tangent.tangent_mut().remove_flow(&flow);
            self.note(time_s, state);
        }
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        self.tangent.event(time_s, event, state);
    }
}
