//! The criterion on a ball bouncing on a vibrating table, whose exponents are known.

use nalgebra::{SVector, Vector2};
use painleve_plant::mechanics::event::first_negative;

use super::tangent::{Crossing, along, slope_along};
use super::{Regime, RegimeVerdict, Return, Tangent};

/// A ball on a table that moves as A sin ωt, with restitution e. The state is
/// the height and velocity of the ball and the phase of the table; flights are smooth, impacts are
/// events, and the deviation is propagated across them as in the arm.
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

    /// Returns the duration of the ball's flight.
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

    fn judge(&self, start: SVector<f64, 3>, transient: usize, impacts: usize) -> RegimeVerdict {
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
        RegimeVerdict::of(&returns)
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

    /// Returns the larger multiplier of the map with this trace.
    fn multiplier(restitution: f64, trace: f64) -> f64 {
        let root = 0.25 * trace * trace - restitution * restitution;
        if root < 0.0 {
            restitution
        } else {
            0.5 * trace.abs() + root.sqrt()
        }
    }

    /// Returns the exponent along the same orbit from the map's Jacobian, derived by hand.
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
fn the_balls_period_doubles_at_the_known_amplitude() {
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
fn a_strongly_shaken_ball_is_chaotic_with_the_exponent_of_its_jacobian() {
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
