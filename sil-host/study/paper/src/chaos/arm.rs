//! Deviation of a neighbouring motion of the simulated arm.

use painleve_plant::mechanics::dop853::{Dop853Step, Tolerance};
use painleve_plant::mechanics::impact::{ImpactKind, ImpactLaw, state_after};
use painleve_plant::mechanics::motion::{Motion, theta};
use painleve_plant::mechanics::transition::event_functions;
use painleve_plant::mechanics::{ArmProbe, ArmStep};
use painleve_plant::{ContactMode, Event, State};
use painleve_shared::Pose;

use super::tangent::{Crossing, Tangent, along, along_by, slope_along};

/// Follows a plant on a belt of constant speed and propagates a deviation.
#[derive(Clone, Debug)]
pub struct ArmTangent {
    impact: ImpactLaw,
    tangent: Tangent<4>,
    /// Mode and state at the end of the last step, where the next event starts.
    before: Option<(ContactMode, State)>,
    /// Impacts since the last step, in order.
    impacts: Vec<ImpactKind>,
    step: Box<Dop853Step<4>>,
}

/// Tolerances with which no step is rejected: the plant has chosen the step size.
const ANY_ERROR: Tolerance = Tolerance {
    relative: 1.0,
    absolute: 1.0,
};

/// Size of differences at an impact, rad/s per m/s of approach, so that neighbours approach as well.
const PER_APPROACH: f64 = 0.1;

/// Smallest approach speed used for the size of differences, m/s.
const SLOWEST_APPROACH_M_S: f64 = 1e-6;

impl ArmTangent {
    /// Creates the probe with the deviation `tangent` at the beginning of the plant's next step;
    /// `impact` is
    /// the plant's impact law.
    pub fn new(impact: ImpactLaw, tangent: Tangent<4>) -> Self {
        Self {
            impact,
            tangent,
            before: None,
            impacts: Vec::new(),
            step: Box::new(Dop853Step::empty()),
        }
    }

    /// Returns the deviation at the end of the last step.
    pub fn tangent(&self) -> &Tangent<4> {
        &self.tangent
    }

    /// Returns the deviation mutably, see [`tangent`](Self::tangent).
    pub fn tangent_mut(&mut self) -> &mut Tangent<4> {
        &mut self.tangent
    }

    /// Returns the state before the event that starts the next step; `None` before the first step.
    pub fn before(&self) -> Option<&State> {
        self.before.as_ref().map(|(_, state)| state)
    }

    /// Propagates the deviation across the events between the last step and this one.
    fn cross(&mut self, mode: ContactMode, state: &State, now: &ArmStep<'_>) {
        let (motion, time_s) = (now.motion, now.start_s);
        let flow_before = motion.derivative(mode, time_s, state);
        let functions = |x: &State| event_functions(motion, mode, time_s, x);
        let normal = motion
            .arm
            .jacobian(&Pose::new(&theta(state)))
            .row(1)
            .transpose();
        let guard = |number: usize, direction: &State| {
            if mode == ContactMode::Flight {
                // In a decaying series of bounces, differences would drown in rounding.
                normal.dot(theta(direction).vector())
            } else {
                slope_along(state, direction, |x| functions(x)[number])
            }
        };
        // The event is the one whose guard is nearest to zero in time.
        let nearest = (0..3)
            .map(|number| {
                let rate = guard(number, &flow_before);
                (number, rate, (functions(state)[number] / rate).abs())
            })
            .filter(|(_, _, distance_s)| distance_s.is_finite())
            .min_by(|one, other| one.2.total_cmp(&other.2));
        let Some((number, guard_rate, _)) = nearest else {
            return;
        };
        let crossing = Crossing {
            before: flow_before,
            after: motion.derivative(now.mode, time_s, now.start),
            guard_rate,
        };
        let size = if self.impacts.is_empty() {
            f64::INFINITY
        } else {
            let approach_m_s = motion.relative_velocity_m_s(time_s, state).y.abs();
            PER_APPROACH * approach_m_s.max(SLOWEST_APPROACH_M_S)
        };
        let jump = |x: &State| jump(motion, &self.impact, time_s, x, &self.impacts, now.mode);
        self.tangent.cross(
            &crossing,
            |direction| guard(number, direction),
            |direction| {
                let jumped = along_by(size, state, direction, jump);
                // Only velocities jump, and no position moves along the guard.
                State::new(direction[0], direction[1], jumped[2], jumped[3])
            },
        );
    }
}

/// Returns the state after the impacts between two steps, on the manifold of the next mode.
fn jump(
    motion: &Motion<'_>,
    law: &ImpactLaw,
    time_s: f64,
    state: &State,
    impacts: &[ImpactKind],
    mode: ContactMode,
) -> State {
    let mut state = *state;
    for &kind in impacts {
        if kind == ImpactKind::WithoutCollision {
            state = motion.onto_belt(&state);
        }
        // The plant has completed this impact, and so do its neighbours.
        state = state_after(motion, law, time_s, &state, kind).map_or(state, |after| after.state);
    }
    onto_manifold(motion, time_s, mode, &state)
}

/// Returns the nearest state that a contact mode allows.
fn onto_manifold(motion: &Motion<'_>, time_s: f64, mode: ContactMode, state: &State) -> State {
    match mode {
        ContactMode::Flight => *state,
        ContactMode::SlidePositive | ContactMode::SlideNegative => motion.onto_belt(state),
        ContactMode::Stick => motion.onto_stick(time_s, motion.tip_t_m(state), state),
    }
}

impl ArmProbe for ArmTangent {
    fn step(&mut self, now: &ArmStep<'_>) {
        if let Some((mode, state)) = self.before
            && (mode != now.mode || !self.impacts.is_empty())
        {
            self.cross(mode, &state, now);
        }
        self.impacts.clear();
        self.before = Some((now.mode, *now.end));

        // The deviation follows the plant's own step and its projection.
        let (motion, mode, size_s) = (now.motion, now.mode, now.end_s - now.start_s);
        let derivative = |t: f64, x: &State| motion.derivative(mode, t, x);
        let step = &mut self.step;
        self.tangent.carry(|direction| {
            along(now.start, direction, |x| {
                let slope = derivative(now.start_s, x);
                step.take(&derivative, now.start_s, x, &slope, size_s, &ANY_ERROR);
                onto_manifold(motion, now.end_s, mode, &step.end)
            })
        });
    }

    fn event(&mut self, _: f64, event: Event, _: &State) {
        match event {
            Event::Impact { .. } => self.impacts.push(ImpactKind::Collision),
            Event::ImpactWithoutCollision { .. } => self.impacts.push(ImpactKind::WithoutCollision),
            Event::ModeChange { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests;
