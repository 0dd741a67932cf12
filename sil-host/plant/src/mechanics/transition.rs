//! Decides the next contact mode and the end of the present one.

use painleve_shared::{ContactTerms, Pose, Slip, SolutionMode, settings};

use super::dop853::{DenseStep, Dop853Step};
use super::event::{first_negative, stays_above};
use super::motion::{Evaluation, Motion, theta, theta_dot};
use crate::plant::{ContactMode, State};

settings! {
    /// What follows if p < 0 and b ≥ 0, so that both sliding and flight solve the equations.
    #[derive(Copy, Eq)]
    pub enum Indeterminate {
        /// The tip leaves (the paper, after Elkaranshawy et al. 2017).
        "flight" => Flight,
        /// The tip continues to slide with f_n = −b/p.
        "slide" => Slide,
    }
}

/// What follows for a tip on the belt without normal velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Continuation {
    /// Motion in this mode.
    Mode(ContactMode),
    /// An impact without collision.
    Thrown,
}

/// Slip below which the tip is at rest on the belt, m/s: well above rounding errors and well below
/// the resolution of any tolerance.
const REST_SLIP_M_S: f64 = 1e-12;

/// Below this fraction of Q22, p counts as zero: −b/p then exceeds any force.
const P_GUARD: f64 = 1e-6;

/// Clearance, m, below which a step is searched for contact; at the default tolerances it
/// exceeds the error of the quintic of [`stays_above`] within one step.
const CLEARANCE_M: f64 = 1e-6;

/// A tip that leaves the belt faster than this is thrown off, m/s.
const TAKE_OFF_SPEED_M_S: f64 = 1e-7;

/// Rounding error of the depth of a tip that leaves the belt without normal velocity, m.
const GRAZING_M: f64 = 1e-14;

/// Number of parts into which a step is divided for a search.
const SEARCH_PARTS: u32 = 8;

/// Step size, s, below which b and p change little; longer steps are searched.
const SHORT_STEP_S: f64 = 5e-3;

/// Decides what follows at time `t_s` from a state with the tip on the belt
/// and no normal velocity.
pub fn decide(
    motion: &Motion<'_>,
    t_s: f64,
    state: &State,
    indeterminate: Indeterminate,
) -> Continuation {
    let terms = motion.terms(t_s, state);
    let slip_speed = motion.relative_velocity_m_s(t_s, state).x;
    if slip_speed.abs() <= REST_SLIP_M_S {
        return Continuation::Mode(from_rest(motion, t_s, &terms));
    }
    let slip = Slip::of(slip_speed);
    let guarded = |side| guarded_p(side, terms.p_per_kg(motion.friction, slip), terms.q.m22);
    Continuation::Mode(match SolutionMode::classify(guarded(1.0), terms.b_m_s2()) {
        SolutionMode::Sliding => ContactMode::slide(slip),
        SolutionMode::Flight => ContactMode::Flight,
        SolutionMode::Indeterminate => match indeterminate {
            Indeterminate::Slide if guarded(-1.0) > 0.0 => ContactMode::slide(slip),
            _ => ContactMode::Flight,
        },
        SolutionMode::Inconsistent => return Continuation::Thrown,
    })
}

/// Returns how far p is from zero on its side, in excess of the guard, 1/kg. The side is 1 in a determinate slide; −1 in
/// an indeterminate one, in which p and b both have the opposite sign.
#[inline]
fn guarded_p(side: f64, p_per_kg: f64, q22_per_kg: f64) -> f64 {
    side * p_per_kg - P_GUARD * q22_per_kg
}

fn from_rest(motion: &Motion<'_>, t_s: f64, terms: &ContactTerms<f64>) -> ContactMode {
    if terms.b_m_s2() >= 0.0 {
        return ContactMode::Flight;
    }
    if cone_margin(motion, t_s, terms) >= 0.0 {
        return ContactMode::Stick;
    }
    // At the edge of the cone, one direction has zero acceleration up to rounding and the other an
    // acceleration against itself: take the better of the two.
    let away = |slip: Slip| slip.sign::<f64>() * slip_acceleration(motion, t_s, terms, slip);
    [Slip::Positive, Slip::Negative]
        .into_iter()
        .filter(|slip| guarded_p(1.0, terms.p_per_kg(motion.friction, *slip), terms.q.m22) > 0.0)
        .max_by(|one, other| away(*one).total_cmp(&away(*other)))
        // In one direction p is at least Q22, so there is a slip.
        .map_or(ContactMode::Flight, ContactMode::slide)
}

/// Returns the distance of the sticking force from the edge of the friction cone, N; negative
/// outside.
fn cone_margin(motion: &Motion<'_>, t_s: f64, terms: &ContactTerms<f64>) -> f64 {
    let force = motion.force_n(t_s, ContactMode::Stick, terms);
    motion.friction * force.y - force.x.abs()
}

/// Returns the acceleration of the tip along the belt relative to it while sliding, m/s².
fn slip_acceleration(motion: &Motion<'_>, t_s: f64, terms: &ContactTerms<f64>, slip: Slip) -> f64 {
    let force = motion.force_n(t_s, ContactMode::slide(slip), terms);
    terms.free_acceleration_m_s2.x + terms.q.row(0).transpose().dot(&force)
        - motion.belt.acceleration_m_s2(t_s)
}

/// Returns functions of the state that reach zero where a mode ends: the gap (m) in flight; slip
/// (m/s), b (m/s²) and p (1/kg) in sliding; the distance to the edge of the cone (N) and b (m/s²)
/// in sticking. Unused functions are infinite.
pub fn event_functions(
    motion: &Motion<'_>,
    mode: ContactMode,
    t_s: f64,
    state: &State,
) -> [f64; 3] {
    if let Some(slip) = mode.slip() {
        return slide_functions(motion, slip, 1.0, t_s, state);
    }
    if mode == ContactMode::Flight {
        return [motion.gap_m(state), f64::INFINITY, f64::INFINITY];
    }
    let terms = motion.terms(t_s, state);
    [
        cone_margin(motion, t_s, &terms),
        -terms.b_m_s2(),
        f64::INFINITY,
    ]
}

/// Returns the [`event_functions`] of a slide on either [side](guarded_p) of p = 0.
fn slide_functions(
    motion: &Motion<'_>,
    slip: Slip,
    side: f64,
    t_s: f64,
    state: &State,
) -> [f64; 3] {
    let terms = motion.terms(t_s, state);
    [
        slip.sign::<f64>() * motion.relative_velocity_m_s(t_s, state).x,
        side * -terms.b_m_s2(),
        guarded_p(side, terms.p_per_kg(motion.friction, slip), terms.q.m22),
    ]
}

/// Returns whether the tip slides at a state and continues in the same direction.
#[inline]
pub fn slides_on(mode: ContactMode, here: &Evaluation) -> bool {
    mode.slip().is_some_and(|slip| {
        slip.sign::<f64>() * here.slip[0] > REST_SLIP_M_S
            && here.b_m_s2 < 0.0
            && here.p_per_kg > P_GUARD * here.q22_per_kg
    })
}

/// Returns whether a mode lasts through a step of `h` seconds, judged by its two ends; `false`
/// requests a search.
#[inline]
pub fn goes_on(
    motion: &Motion<'_>,
    mode: ContactMode,
    h: f64,
    start: &Evaluation,
    end: &Evaluation,
) -> bool {
    let Some(slip) = mode.slip() else {
        if mode == ContactMode::Flight {
            return stays_above(CLEARANCE_M, h, start.gap, end.gap);
        }
        let inside_cone = motion.friction * end.force_n.y - end.force_n.x.abs() >= 0.0;
        return inside_cone && end.b_m_s2 <= 0.0 && h <= SHORT_STEP_S;
    };
    let side = start.p_per_kg.signum();
    let holds = side * -end.b_m_s2 >= 0.0 && guarded_p(side, end.p_per_kg, end.q22_per_kg) >= 0.0;
    // Slip can vanish and restart within a step; a cubic through both ends detects this.
    let sign = slip.sign::<f64>();
    let [v0, a0] = start.slip.map(|x| sign * x);
    let [v1, a1] = end.slip.map(|x| sign * x);
    let third = h / 3.0;
    let slides = v0.min(v1).min(v0 + a0 * third).min(v1 - a1 * third) >= 0.0;
    holds && slides && h <= SHORT_STEP_S
}

/// Returns the time of the first event in a finished step, s; the event has happened at that time.
pub fn first_event_s(
    motion: &Motion<'_>,
    mode: ContactMode,
    step: &mut Dop853Step<4>,
    start: &Evaluation,
    end: &Evaluation,
) -> Option<f64> {
    if goes_on(motion, mode, step.h, start, end) {
        return None;
    }
    match mode {
        ContactMode::Flight => first_landing_s(motion, step, start),
        ContactMode::SlidePositive => first_end_of_slide_s(motion, Slip::Positive, step, start),
        ContactMode::SlideNegative => first_end_of_slide_s(motion, Slip::Negative, step, start),
        ContactMode::Stick => {
            let margin = |t: f64, x: &State| {
                let [cone, pressed, _] = event_functions(motion, mode, t, x);
                cone.min(pressed)
            };
            let dense = step.dense(&|t, x: &State| motion.derivative(mode, t, x));
            first_in_parts(step, &dense, &margin)
        }
    }
}

fn first_landing_s(
    motion: &Motion<'_>,
    step: &mut Dop853Step<4>,
    start: &Evaluation,
) -> Option<f64> {
    let start = start.gap;
    let (t, h) = (step.t, step.h);
    let dense = step.dense(&|t, x: &State| motion.derivative(ContactMode::Flight, t, x));
    // A flight that starts on the belt has a root at its start. With a normal velocity that root is
    // divided out; without one, the tip may graze the belt by less than the rounding error, which
    // must not count as landing.
    let from_belt = start[0].abs() < 1e-12;
    let thrown = from_belt && start[1] > TAKE_OFF_SPEED_M_S;
    let slack = if from_belt && !thrown { GRAZING_M } else { 0.0 };
    let gap_and_speed = |at: f64| {
        let state = dense.at(at);
        let pose = Pose::new(&theta(&state));
        let normal = motion.arm.jacobian(&pose).row(1).transpose();
        (
            motion.arm.gap_m(&pose) + slack,
            normal.dot(theta_dot(&state).vector()),
        )
    };
    let gap = |at: f64| motion.gap_m(&dense.at(at)) + slack;
    let mut before = (t, start[0] + slack, start[1]);
    for at in looks(t, h) {
        let (gap_at, speed_at) = gap_and_speed(at);
        let mut after = (at, gap_at, speed_at);
        if after.1 >= 0.0 && before.2 < 0.0 && after.2 > 0.0 {
            // A dip between two samples.
            let lowest = first_negative((before.0, -before.2), (after.0, -after.2), |at| {
                -gap_and_speed(at).1
            });
            let depth = gap(lowest);
            if depth < 0.0 {
                after = (lowest, depth, 0.0);
            }
        }
        if after.1 < 0.0 {
            if before.0 == t && thrown {
                let divided = |at: f64| gap(at) / (at - t);
                return Some(first_negative(
                    (t, start[1]),
                    (after.0, divided(after.0)),
                    divided,
                ));
            }
            if before.1 < 0.0 {
                return Some(before.0);
            }
            return Some(first_negative(
                (before.0, before.1),
                (after.0, after.1),
                gap,
            ));
        }
        before = (at, after.1, after.2);
    }
    None
}

/// Returns the times at which a step from `t` over `h` is sampled; the last is its end.
fn looks(t: f64, h: f64) -> impl Iterator<Item = f64> {
    (1..=SEARCH_PARTS).map(move |part| t + h * (f64::from(part) / f64::from(SEARCH_PARTS)))
}

/// Returns how much later than at `state` the tip of a flight meets the belt, s, to first order.
pub fn landing_correction_s(motion: &Motion<'_>, mode: ContactMode, state: &State) -> f64 {
    if mode.is_contact() {
        return 0.0;
    }
    let pose = Pose::new(&theta(state));
    let gap = motion.arm.gap_m(&pose);
    let speed = motion
        .arm
        .jacobian(&pose)
        .row(1)
        .transpose()
        .dot(theta_dot(state).vector());
    // A landing at grazing speed needs no correction.
    if speed < -1e-6 && gap.abs() > 1e-16 {
        -gap / speed
    } else {
        0.0
    }
}

fn first_end_of_slide_s(
    motion: &Motion<'_>,
    slip: Slip,
    step: &mut Dop853Step<4>,
    start: &Evaluation,
) -> Option<f64> {
    let side = start.p_per_kg.signum();
    let margin = |t: f64, x: &State| {
        let [sliding, pressed, p] = slide_functions(motion, slip, side, t, x);
        (sliding + 0.5 * REST_SLIP_M_S).min(pressed).min(p)
    };
    let mode = ContactMode::slide(slip);
    let dense = step.dense(&|t, x: &State| motion.derivative(mode, t, x));
    first_in_parts(step, &dense, &margin)
}

/// Returns the first time in a step at which a margin is negative, searched part by part.
fn first_in_parts(
    step: &Dop853Step<4>,
    dense: &DenseStep<4>,
    margin: &impl Fn(f64, &State) -> f64,
) -> Option<f64> {
    let mut before = (step.t, margin(step.t, &step.start));
    if before.1 < 0.0 {
        return Some(step.t);
    }
    for at in looks(step.t, step.h) {
        let after = (at, margin(at, &dense.at(at)));
        if after.1 < 0.0 {
            return Some(first_negative(before, after, |at| {
                margin(at, &dense.at(at))
            }));
        }
        before = after;
    }
    None
}
