//! A belt that hangs between its rollers: the piece under the tip moves as one mass on a spring and
//! a damper. The contact's own stiffness is that of the belt's material and the tip on this mass.

use painleve_shared::settings;

settings! {
    /// The piece of a hanging belt under the tip.
    #[derive(Copy)]
    pub struct HangingBelt {
        /// Mass that moves with the tip; zero for a belt on a firm bed.
        mass_kg: f64 = 0.0, 0.0..=10.0, "kg";
        /// Stiffness of its suspension.
        stiffness_n_m: f64 = 2e4, 100.0..=1e9, "N/m";
        /// Damping of its suspension; the default is 0.15 of the critical damping of 20 g.
        damping_ns_m: f64 = 6.0, 0.0..=1e6, "N·s/m";
    }
}

impl HangingBelt {
    /// Returns whether the belt hangs.
    pub fn is_on(&self) -> bool {
        self.mass_kg != 0.0
    }

    /// Returns the acceleration (m/s²) of the piece at a height above that of the unloaded belt (m)
    /// with a rate (m/s), under the normal force of a tip (N).
    #[inline]
    pub fn acceleration_m_s2(&self, height_m: f64, rate_m_s: f64, normal_force_n: f64) -> f64 {
        let suspension_n = self.stiffness_n_m * height_m + self.damping_ns_m * rate_m_s;
        -(suspension_n + normal_force_n) / self.mass_kg
    }
}
