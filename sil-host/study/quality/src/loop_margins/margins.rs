//! Margins of a stable closed loop, from its open loop.

use std::f64::consts::TAU;

use nalgebra::Complex;
use serde::Serialize;

pub(super) fn decibels(gain: f64) -> f64 {
    20.0 * libm::log10(gain)
}

/// Returns |value|.
pub(super) fn size(value: Complex<f64>) -> f64 {
    libm::hypot(value.re, value.im)
}

/// Returns the angle of a value, rad.
pub(super) fn angle(value: Complex<f64>) -> f64 {
    libm::atan2(value.im, value.re)
}

/// Returns the value of size 1 at an angle, rad.
pub(super) fn turned(angle_rad: f64) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(angle_rad);
    Complex::new(cosine, sine)
}

/// Frequencies at which the open loop is evaluated.
const FREQUENCIES: usize = 600;
/// Lowest of them, Hz.
const LOWEST_HZ: f64 = 0.25;

/// What a stable loop bears before it becomes unstable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// Highest frequency at which the gain falls through 1, Hz.
    pub crossover_hz: Option<f64>,
    /// Smallest change of phase at a gain of 1 that makes the loop unstable, degrees.
    pub phase_deg: Option<f64>,
    /// Smallest additional delay that does, ms.
    pub delay_ms: Option<f64>,
    /// Smallest increase of the gain that does, dB.
    pub gain_db: Option<f64>,
    /// Smallest decrease of the gain that does, dB.
    pub reduction_db: Option<f64>,
    /// Smallest distance of the open loop from −1: 1/max|S|.
    pub modulus: f64,
}

impl Margins {
    /// Takes the margins from the open loop as a function of frequency, Hz, up to half the control rate.
    pub fn of(open_loop: impl Fn(f64) -> Complex<f64>, tick_hz: f64) -> Self {
        let ratio = 0.5 * tick_hz / LOWEST_HZ;
        let hz = (0..FREQUENCIES)
            .map(|number| LOWEST_HZ * libm::pow(ratio, number as f64 / (FREQUENCIES - 1) as f64));
        let points: Vec<(f64, Complex<f64>)> = hz.map(|hz| (hz, open_loop(hz))).collect();
        let mut margins = Self {
            crossover_hz: None,
            phase_deg: None,
            delay_ms: None,
            gain_db: None,
            reduction_db: None,
            modulus: points
                .iter()
                .map(|(_, value)| size(value + 1.0))
                .fold(f64::INFINITY, f64::min),
        };
        for pair in points.windows(2) {
            let [(low_hz, low), (high_hz, high)] = [pair[0], pair[1]];
            if (size(low) > 1.0) != (size(high) > 1.0) {
                let share = libm::log(size(low)) / libm::log(size(low) / size(high));
                let at_hz = low_hz + share * (high_hz - low_hz);
                margins.take_crossover(at_hz, low + (high - low) * share, size(low) > 1.0);
            }
            if (low.im > 0.0) != (high.im > 0.0) {
                let share = low.im / (low.im - high.im);
                let real = low.re + share * (high.re - low.re);
                if real < 0.0 {
                    margins.take_inversion(-real);
                }
            }
        }
        margins
    }

    fn take_crossover(&mut self, hz: f64, value: Complex<f64>, falls: bool) {
        // The angle from −1, the way that a delay turns.
        let lag_rad = angle(-value);
        let phase_deg = lag_rad.abs().to_degrees();
        self.phase_deg = Some(
            self.phase_deg
                .map_or(phase_deg, |least| least.min(phase_deg)),
        );
        let delay_ms = 1e3 * lag_rad.rem_euclid(TAU) / (TAU * hz);
        self.delay_ms = Some(self.delay_ms.map_or(delay_ms, |least| least.min(delay_ms)));
        if falls {
            self.crossover_hz = Some(hz);
        }
    }

    /// Takes a real negative value of the open loop, by its size.
    fn take_inversion(&mut self, size: f64) {
        let margin = if size < 1.0 {
            &mut self.gain_db
        } else {
            &mut self.reduction_db
        };
        let decibels = decibels(size).abs();
        *margin = Some(margin.map_or(decibels, |least| least.min(decibels)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integrator of gain ω_c with a delay: phase margin 90° − ω_c T, gain margin π/(2 ω_c T).
    #[test]
    fn an_integrator_with_delay_has_the_margins_of_the_textbook() {
        let (crossover_rad_s, delay_s) = (100.0, 0.004);
        let open_loop = |hz: f64| {
            let omega = TAU * hz;
            Complex::new(0.0, -crossover_rad_s / omega) * turned(-omega * delay_s)
        };
        let margins = Margins::of(open_loop, 1000.0);
        let near = |value: Option<f64>, expected: f64| {
            assert!(
                (value.unwrap() / expected - 1.0).abs() < 3e-3,
                "{value:?} {expected}"
            );
        };
        near(margins.crossover_hz, crossover_rad_s / TAU);
        near(
            margins.phase_deg,
            90.0 - (crossover_rad_s * delay_s).to_degrees(),
        );
        near(
            margins.delay_ms,
            1e3 * (std::f64::consts::FRAC_PI_2 / crossover_rad_s - delay_s),
        );
        near(
            margins.gain_db,
            decibels(std::f64::consts::FRAC_PI_2 / (crossover_rad_s * delay_s)),
        );
        assert_eq!(margins.reduction_db, None);
        assert!(
            margins.modulus > 0.5 && margins.modulus < 0.8,
            "{margins:?}"
        );
    }

    /// k (s + 1)²/s³ is stable only for k > 0.5: its gain can be reduced by 20 log(k/0.5).
    #[test]
    fn a_conditionally_stable_loop_has_a_margin_of_reduction() {
        let open_loop = |hz: f64| {
            let s = Complex::new(0.0, TAU * hz / 10.0);
            (s + 1.0) * (s + 1.0) * 2.0 / (s * s * s)
        };
        let margins = Margins::of(open_loop, 1000.0);
        assert!(
            (margins.reduction_db.unwrap() - decibels(4.0)).abs() < 0.2,
            "{margins:?}"
        );
    }
}
