//! An external push on the tip: an impulse spread over a short time.

use nalgebra::Vector2;
use painleve_shared::settings;

settings! {
    /// One push, with a constant force over its duration.
    #[derive(Copy)]
    pub struct Push {
        /// Impulse along the belt and normal to it; zero for no push.
        impulse_ns: [f64; 2] = [0.0; 2], -10.0..=10.0, "N·s";
        /// Start of the push.
        at_s: f64 = 1.0, 0.0..=1e7, "s";
        /// Duration of the push.
        duration_s: f64 = 0.005, 1e-4..=1e3, "s";
    }
}

impl Push {
    /// Returns whether there is a push.
    pub fn is_on(&self) -> bool {
        self.impulse_ns != [0.0; 2]
    }

    /// Returns the force (F_t, F_n) on the tip at time `t_s`, N.
    #[inline]
    pub fn force_n(&self, t_s: f64) -> Vector2<f64> {
        if t_s >= self.at_s && t_s < self.at_s + self.duration_s {
            Vector2::from(self.impulse_ns) / self.duration_s
        } else {
            Vector2::zeros()
        }
    }

    /// Returns the next time after `t_s` at which the force jumps, s; infinite if there is none.
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        if !self.is_on() {
            return f64::INFINITY;
        }
        let corners = [self.at_s, self.at_s + self.duration_s];
        corners
            .into_iter()
            .find(|corner| *corner > t_s)
            .unwrap_or(f64::INFINITY)
    }
}
