//! A mass picked up by the tip.

use painleve_shared::settings;

settings! {
    /// A point mass that stays at the tip from a given time on. It has the velocity of the tip when
    /// it is picked up, so no velocity jumps.
    #[derive(Copy)]
    pub struct Payload {
        /// Mass; zero for no payload.
        mass_kg: f64 = 0.0, 0.0..=10.0, "kg";
        /// Time at which it is picked up.
        at_s: f64 = 1.0, 0.0..=1e7, "s";
    }
}

impl Payload {
    /// Returns whether there is a payload.
    pub fn is_on(&self) -> bool {
        self.mass_kg != 0.0
    }

    /// Returns the time at which it is picked up if that is after `t_s`, s; infinite otherwise.
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        if self.is_on() && self.at_s > t_s {
            self.at_s
        } else {
            f64::INFINITY
        }
    }
}
