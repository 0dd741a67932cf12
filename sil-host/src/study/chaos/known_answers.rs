//! The criterion on orbits whose answer is known.

use nalgebra::{Matrix2, SVector, Vector1, Vector2};

use super::tangent::{Crossing, along, slope_along};
use super::{Regime, Return, Tangent, Verdict};
use crate::plant::event::first_negative;

/// Judges a map by its iterates after a transient.
fn judge_map<const N: usize>(
    start: SVector<f64, N>,
    transient: usize,
    iterations: usize,
    map: impl Fn(&SVector<f64, N>) -> SVector<f64, N>,
) -> Verdict {
    let mut state = (0..transient).fold(start, |state, _| map(&state));
    let mut tangent = Tangent::default();
    let returns: Vec<Return<N>> = (0..iterations)
        .map(|iteration| {
            tangent.carry(|direction| along(&state, direction, &map));
            state = map(&state);
            Return {
                time_s: iteration as f64,
                state,
                log_growth: tangent.take_log_growth(),
            }
        })
        .collect();
    Verdict::of(&returns)
}

fn logistic(r: f64, iterations: usize) -> Verdict {
    judge_map(Vector1::new(0.3), 10_000, iterations, |x| {
        Vector1::new(r * x.x * (1.0 - x.x))
    })
}

/// ln 2 at r = 4 (Ulam and von Neumann).
#[test]
fn the_logistic_map_at_4_is_chaotic_with_exponent_ln_2() {
    let verdict = logistic(4.0, 20_000);
    assert_eq!(verdict.regime, Regime::Chaotic);
    let (exponent, error) = (
        verdict.exponent_per_s.unwrap(),
        verdict.standard_error_per_s.unwrap(),
    );
    assert!((exponent - 2.0_f64.ln()).abs() < 0.01, "{exponent}");
    assert!(error < 0.01 && (exponent - 2.0_f64.ln()).abs() < 4.0 * error);
}

/// At r = 3.2 the multiplier of the 2-cycle is 4 + 2r − r² = 0.16; at r = 1 + √5 it is 0.
#[test]
fn the_logistic_maps_2_cycle_has_the_exponent_of_its_multiplier() {
    let verdict = logistic(3.2, 400);
    assert_eq!(
        (verdict.regime, verdict.period),
        (Regime::Periodic, Some(2))
    );
    let expected = 0.5 * 0.16_f64.ln();
    assert!(
        (verdict.exponent_per_s.unwrap() - expected).abs() < 1e-6,
        "{verdict:?}"
    );
}

/// Period doublings at r = 3, 3.4495, 3.5441, 3.5644 …, chaos from 3.5699, the window of period 3 from
/// 1 + √8 = 3.8284.
#[test]
fn the_logistic_maps_cascade_and_windows_are_told() {
    for (r, regime, period) in [
        (2.9, Regime::Periodic, Some(1)),
        (3.4, Regime::Periodic, Some(2)),
        (3.5, Regime::Periodic, Some(4)),
        (3.55, Regime::Periodic, Some(8)),
        (3.565, Regime::Periodic, Some(16)),
        (3.7, Regime::Chaotic, None),
        (3.83, Regime::Periodic, Some(3)),
        (3.9, Regime::Chaotic, None),
    ] {
        let verdict = logistic(r, 2000);
        assert_eq!(
            (verdict.regime, verdict.period),
            (regime, period),
            "r = {r}: {verdict:?}"
        );
    }
}

/// At a period doubling the exponent is zero: nothing may be claimed.
#[test]
fn at_a_bifurcation_the_verdict_is_open() {
    assert_eq!(logistic(3.0, 400).regime, Regime::Undecided);
}

/// 0.41922 for a = 1.4, b = 0.3 (Sprott, *Chaos and Time-Series Analysis*).
#[test]
fn the_henon_map_has_its_exponent() {
    let verdict = judge_map(Vector2::new(0.1, 0.1), 1000, 50_000, |x| {
        Vector2::new(1.0 - 1.4 * x.x * x.x + x.y, 0.3 * x.x)
    });
    assert_eq!(verdict.regime, Regime::Chaotic);
    assert!(
        (verdict.exponent_per_s.unwrap() - 0.419_22).abs() < 0.01,
        "{verdict:?}"
    );
}

/// A rotation by an irrational angle neither returns nor forgets.
#[test]
fn a_rotation_is_undecided() {
    let (sine, cosine) = 1.0_f64.sin_cos();
    let rotation = Matrix2::new(cosine, -sine, sine, cosine);
    let verdict = judge_map(Vector2::new(1.0, 0.0), 0, 2000, |x| rotation * x);
    assert_eq!(verdict.regime, Regime::Undecided, "{verdict:?}");
}

#[test]
fn forgetting_everything_is_periodic_with_exponent_minus_infinity() {
    let verdict = judge_map(Vector1::new(0.3), 10, 100, |_| Vector1::new(0.7));
    assert_eq!(
        (verdict.regime, verdict.period),
        (Regime::Periodic, Some(1))
    );
    assert_eq!(verdict.exponent_per_s, Some(f64::NEG_INFINITY));
}

#[test]
fn too_few_returns_are_not_judged_and_none_are_quiet() {
    assert_eq!(logistic(4.0, 30).regime, Regime::Undecided);
    assert_eq!(Verdict::of::<1>(&[]).regime, Regime::Quiet);
}

/// A ball on a table that goes up and down as A sin ωt, with restitution e: flights with
/// the height and velocity of the ball and the phase of the table as state, impacts as
/// events, the deviation carried across them as in the arm.
struct Ball {
    amplitude_m: f64,
    restitution: f64,
}

const GRAVITY_M_S2: f64 = 9.81;
const OMEGA_RAD_S: f64 = 50.0;
const PERIOD_S: f64 = core::f64::consts::TAU / OMEGA_RAD_S;

impl Ball {
    fn table_m(&self, x: &SVector<f64, 3>) -> f64 {
        self.amplitude_m * libm::sin(OMEGA_RAD_S * x.z)
    }

    fn table_speed_m_s(&self, x: &SVector<f64, 3>) -> f64 {
        self.amplitude_m * OMEGA_RAD_S * libm::cos(OMEGA_RAD_S * x.z)
    }

    /// State: height (m), velocity (m/s), time within the table's period (s).
    fn flow(x: &SVector<f64, 3>) -> SVector<f64, 3> {
        SVector::from([x.y, -GRAVITY_M_S2, 1.0])
    }

    fn fly(x: &SVector<f64, 3>, duration_s: f64) -> SVector<f64, 3> {
        SVector::from([
            x.x + x.y * duration_s - 0.5 * GRAVITY_M_S2 * duration_s * duration_s,
            x.y - GRAVITY_M_S2 * duration_s,
            x.z + duration_s,
        ])
    }

    fn guard(&self, x: &SVector<f64, 3>) -> f64 {
        x.x - self.table_m(x)
    }

    fn jump(&self, x: &SVector<f64, 3>) -> SVector<f64, 3> {
        let table = self.table_speed_m_s(x);
        SVector::from([x.x, table + self.restitution * (table - x.y), x.z])
    }

    /// How long the ball flies.
    fn flight_s(&self, x: &SVector<f64, 3>) -> f64 {
        let gap = |t: f64| self.guard(&Self::fly(x, t));
        let look = 1e-3 / OMEGA_RAD_S;
        let mut before = look;
        assert!(gap(before) > 0.0, "the ball rests on the table");
        while gap(before + look) > 0.0 {
            before += look;
        }
        let after = before + look;
        first_negative((before, gap(before)), (after, gap(after)), gap)
    }

    fn judge(&self, start: SVector<f64, 3>, transient: usize, impacts: usize) -> Verdict {
        let (mut x, mut tangent, mut time_s) = (start, Tangent::default(), 0.0);
        let mut returns = Vec::new();
        for impact in 0..transient + impacts {
            let flight_s = self.flight_s(&x);
            tangent.carry(|direction| along(&x, direction, |x| Self::fly(x, flight_s)));
            let arriving = Self::fly(&x, flight_s);
            let (before, mut leaving) = (Self::flow(&arriving), self.jump(&arriving));
            let guard = |x: &SVector<f64, 3>| self.guard(x);
            let crossing = Crossing {
                before,
                after: Self::flow(&leaving),
                guard_rate: slope_along(&arriving, &before, guard),
            };
            tangent.cross(
                &crossing,
                |direction| slope_along(&arriving, direction, guard),
                |direction| along(&arriving, direction, |x| self.jump(x)),
            );
            leaving.z %= PERIOD_S;
            x = leaving;
            time_s += flight_s;
            tangent.remove_flow(&Self::flow(&x));
            let log_growth = tangent.take_log_growth();
            if impact >= transient {
                returns.push(Return {
                    time_s,
                    state: x,
                    log_growth,
                });
            }
        }
        Verdict::of(&returns)
    }

    /// The orbit with one impact per period T of the table: the ball leaves at v = g T/2,
    /// where the table has the speed (1 − e)/(1 + e) v. Its map (time, velocity) from impact
    /// to impact has determinant e² and trace 1 + e² + (1 + e)² a/g, with a the table's acceleration
    /// there; given the trace, a and so the table follow.
    fn with_period_one(restitution: f64, trace: f64) -> (Self, SVector<f64, 3>) {
        let e = restitution;
        let speed_m_s = 0.5 * GRAVITY_M_S2 * PERIOD_S;
        let table_speed_m_s = (1.0 - e) / (1.0 + e) * speed_m_s;
        let acceleration = GRAVITY_M_S2 * (trace - 1.0 - e * e) / ((1.0 + e) * (1.0 + e));
        let quadrature_m_s = -acceleration / OMEGA_RAD_S;
        let ball = Self {
            amplitude_m: quadrature_m_s.hypot(table_speed_m_s) / OMEGA_RAD_S,
            restitution,
        };
        let phase = quadrature_m_s.atan2(table_speed_m_s);
        let mut start = SVector::from([0.0, speed_m_s, phase / OMEGA_RAD_S]);
        start.x = ball.table_m(&start);
        (ball, start)
    }

    /// Larger multiplier of the map with that trace.
    fn multiplier(restitution: f64, trace: f64) -> f64 {
        let root = 0.25 * trace * trace - restitution * restitution;
        if root < 0.0 {
            restitution
        } else {
            0.5 * trace.abs() + root.sqrt()
        }
    }

    /// The exponent by the map's Jacobian, written down by hand, along the same orbit.
    fn exponent_by_hand(&self, start: SVector<f64, 3>, transient: usize, impacts: usize) -> f64 {
        let (mut x, mut deviation, mut growth, mut time_s) =
            (start, Vector2::new(1.0, 0.3), 0.0, 0.0);
        for impact in 0..transient + impacts {
            let flight_s = self.flight_s(&x);
            let arriving = Self::fly(&x, flight_s);
            let approach = self.table_speed_m_s(&arriving) - arriving.y;
            let (time, velocity) = (deviation.x, deviation.y);
            let departure = self.table_speed_m_s(&x) - arriving.y;
            let later = (departure * time + flight_s * velocity) / approach;
            let e = self.restitution;
            let table =
                -self.amplitude_m * OMEGA_RAD_S * OMEGA_RAD_S * libm::sin(OMEGA_RAD_S * arriving.z);
            let faster =
                (1.0 + e) * table * later - e * velocity + e * GRAVITY_M_S2 * (later - time);
            deviation = Vector2::new(later, faster);
            if impact >= transient {
                growth += deviation.norm().ln();
                time_s += flight_s;
            }
            deviation.normalize_mut();
            x = self.jump(&arriving);
            x.z %= PERIOD_S;
        }
        growth / time_s
    }
}

/// A deviation of the orbit with one impact per period shrinks by its multiplier; if the
/// multipliers are complex, both have the modulus e.
#[test]
fn the_ball_with_one_impact_per_period_has_the_exponent_of_its_multiplier() {
    for (restitution, trace, tolerance) in [
        (0.5, 1.2, 1e-6),
        (0.5, -1.2, 1e-6),
        (0.5, 0.3, 0.02),
        (0.8, 1.0, 0.02),
    ] {
        let (ball, start) = Ball::with_period_one(restitution, trace);
        let verdict = ball.judge(start, 100, 1000);
        assert_eq!(
            (verdict.regime, verdict.period),
            (Regime::Periodic, Some(1)),
            "{verdict:?}"
        );
        let expected = Ball::multiplier(restitution, trace).ln() / PERIOD_S;
        let relative = verdict.exponent_per_s.unwrap() / expected - 1.0;
        assert!(
            relative.abs() < tolerance,
            "trace {trace}: {verdict:?}, {expected}"
        );
    }
}

/// The multiplier is −1 where the trace is −(1 + e²), here −1.25.
#[test]
fn the_balls_period_doubles_where_it_must() {
    for (trace, period) in [(-1.2, 1), (-1.3, 2), (-1.5, 2)] {
        let (ball, mut start) = Ball::with_period_one(0.5, trace);
        start.y *= 1.001;
        let verdict = ball.judge(start, 3000, 1000);
        assert_eq!(
            (verdict.regime, verdict.period),
            (Regime::Periodic, Some(period)),
            "{trace}: {verdict:?}"
        );
    }
}

#[test]
fn a_hard_shaken_ball_is_chaotic_with_the_exponent_of_its_jacobian() {
    let (ball, mut start) = Ball::with_period_one(0.95, -5.0);
    start.y *= 1.1;
    let verdict = ball.judge(start, 300, 1700);
    assert_eq!(verdict.regime, Regime::Chaotic, "{verdict:?}");
    let expected = ball.exponent_by_hand(start, 300, 1700);
    let exponent = verdict.exponent_per_s.unwrap();
    assert!(
        (exponent / expected - 1.0).abs() < 0.02,
        "{exponent} {expected}"
    );
}
