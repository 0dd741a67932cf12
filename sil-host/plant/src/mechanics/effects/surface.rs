//! An uneven belt: waves along it, a seam, vibration. Slopes are small, so the contact's normal is
//! taken as vertical.

use core::f64::consts::{PI, TAU};

use painleve_shared::settings;

/// Length over which the belt rises by its step, m.
const STEP_M: f64 = 5e-3;

settings! {
    /// The belt's surface: heights above a flat belt at rest.
    #[derive(Copy)]
    pub struct Surface {
        /// Amplitude of waves along the belt.
        waviness_m: f64 = 0.0, 0.0..=0.01, "m";
        /// Length of these waves.
        wave_length_m: f64 = 0.1, 1e-3..=1e3, "m";
        /// Height of the bump where the belt is joined.
        seam_height_m: f64 = 0.0, -0.01..=0.01, "m";
        /// Length of the bump.
        seam_length_m: f64 = 0.02, 1e-3..=1.0, "m";
        /// Height by which the belt rises at its joint, as on an overlap; it falls back evenly along
        /// the rest of the belt.
        step_height_m: f64 = 0.0, -0.01..=0.01, "m";
        /// Length of the whole belt, with one seam.
        belt_length_m: f64 = 1.0, 0.1..=1e3, "m";
        /// Amplitude of a vibration of the whole belt.
        vibration_m: f64 = 0.0, 0.0..=0.01, "m";
        /// Frequency of the vibration.
        vibration_hz: f64 = 50.0, 0.0..=1e3, "Hz";
    }
}

/// The surface at one place and time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePoint {
    /// Height above the flat belt, m.
    pub height_m: f64,
    /// Slope along the belt.
    pub slope: f64,
    /// Vertical speed, m/s.
    pub speed_m_s: f64,
}

impl Surface {
    /// Returns whether the belt is flat and does not vibrate.
    pub fn is_flat(&self) -> bool {
        self.waviness_m == 0.0
            && self.seam_height_m == 0.0
            && self.step_height_m == 0.0
            && self.vibration_m == 0.0
    }

    /// Returns the surface at time `t_s` and position `along_belt_m` on the belt.
    pub fn at(&self, t_s: f64, along_belt_m: f64) -> SurfacePoint {
        let (mut height, mut slope, mut speed) = (0.0, 0.0, 0.0);
        if self.waviness_m != 0.0 {
            let number = TAU / self.wave_length_m;
            let phase = number * along_belt_m;
            height += self.waviness_m * libm::sin(phase);
            slope += self.waviness_m * number * libm::cos(phase);
        }
        if self.seam_height_m != 0.0 {
            // The seam lies in the middle of the belt's length, so that no run starts on it.
            let turns = along_belt_m / self.belt_length_m;
            let place = (turns - libm::floor(turns) - 0.5) * self.belt_length_m;
            if place.abs() < 0.5 * self.seam_length_m {
                let number = TAU / self.seam_length_m;
                height += 0.5 * self.seam_height_m * (1.0 + libm::cos(number * place));
                slope -= 0.5 * self.seam_height_m * number * libm::sin(number * place);
            }
        }
        if self.step_height_m != 0.0 {
            let turns = along_belt_m / self.belt_length_m - 0.5;
            let place = (turns - libm::floor(turns)) * self.belt_length_m;
            if place < STEP_M {
                let number = PI / STEP_M;
                height += 0.5 * self.step_height_m * (1.0 - libm::cos(number * place));
                slope += 0.5 * self.step_height_m * number * libm::sin(number * place);
            } else {
                let fall = self.step_height_m / (self.belt_length_m - STEP_M);
                height += self.step_height_m - fall * (place - STEP_M);
                slope -= fall;
            }
        }
        if self.vibration_m != 0.0 {
            let rate = TAU * self.vibration_hz;
            height += self.vibration_m * libm::sin(rate * t_s);
            speed += self.vibration_m * rate * libm::cos(rate * t_s);
        }
        SurfacePoint {
            height_m: height,
            slope,
            speed_m_s: speed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slope_and_speed_are_derivatives_of_the_height() {
        let surface = Surface {
            waviness_m: 1e-4,
            seam_height_m: 5e-4,
            step_height_m: -3e-4,
            vibration_m: 2e-4,
            ..Default::default()
        };
        for (t, x) in [
            (0.1, 0.02),
            (0.33, 0.497),
            (1.7, 0.503),
            (2.0, -0.498),
            (2.5, 1.2),
        ] {
            let point = surface.at(t, x);
            let height = |t: f64, x: f64| surface.at(t, x).height_m;
            let by_place = (height(t, x + 1e-7) - height(t, x - 1e-7)) / 2e-7;
            let by_time = (height(t + 1e-7, x) - height(t - 1e-7, x)) / 2e-7;
            assert!((point.slope - by_place).abs() < 1e-6);
            assert!((point.speed_m_s - by_time).abs() < 1e-6);
        }
    }
}
