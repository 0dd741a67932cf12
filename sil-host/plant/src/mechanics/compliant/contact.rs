//! The compliant contact: its normal force from penetration, its friction from bristles.
//!
//! **Normal.** Kelvin–Voigt: f_n = k δ + c δ̇. Hunt–Crossley: f_n = k δ (1 + d δ̇), where the
//! damping grows with the penetration δ, so that the force does not jump at touchdown. Neither ever
//! pulls.
//!
//! **Tangential.** LuGre (Canudas de Wit, Olsson, Åström, Lischinsky 1995), with the deflection z
//! of the bristles scaled to y = σ₀ z, which is ±g in steady sliding: ẏ = σ₀ (v − |v| y/g), f_t =
//! −f_n (y + σ₁ ẏ/σ₀ + σ₂ v), g = μ (1 + (r − 1) exp(−(v/v_s)²)), where r is the ratio of static to
//! kinetic friction and v_s Stribeck's speed.

use painleve_shared::settings;

settings! {
    /// Kind of contact between tip and belt.
    #[derive(Copy, Eq)]
    pub enum ContactKind {
        /// Rigid bodies, Coulomb friction, instantaneous impacts.
        "rigid" => Rigid,
        /// Spring and damper, bristle friction.
        "compliant" => Compliant,
    }
}

settings! {
    /// Damping of the normal force.
    #[derive(Copy)]
    pub enum NormalDamping {
        /// f_n = k δ + c δ̇.
        "kelvin-voigt" => KelvinVoigt {
            /// Damping c.
            damping_ns_m: f64, 0.0..=1e6, "N·s/m";
        },
        /// Kelvin–Voigt with the damping that gives a mass a coefficient of restitution.
        "restitution" => Restitution {
            /// Restitution e of a mass that falls on the contact.
            restitution: f64, 0.01..=1.0;
            /// The mass.
            mass_kg: f64, 1e-6..=1e3, "kg";
        },
        /// f_n = k δ (1 + d δ̇).
        "hunt-crossley" => HuntCrossley {
            /// Dissipation d.
            dissipation_s_m: f64, 0.0..=1e4, "s/m";
        },
    }
}

settings! {
    /// The contact between tip and belt. The default is 10⁵ N/m with a damping ratio of 0.6 for 40 g, which gives a
    /// restitution near the paper's.
    #[derive(Copy)]
    pub struct TipContact {
        /// Rigid or compliant; the other keys are for a compliant one.
        kind: ContactKind = ContactKind::Rigid;
        /// Normal stiffness k.
        stiffness_n_m: f64 = 1e5, 1e3..=1e9, "N/m";
        /// Damping of the normal force.
        normal: NormalDamping = NormalDamping::KelvinVoigt { damping_ns_m: 76.0 };
        /// Tangential stiffness σ₀ per newton of normal force.
        bristle_stiffness_per_m: f64 = 1e4, 1.0..=1e8, "1/m";
        /// Damping σ₁ of the bristles per newton of normal force.
        bristle_damping_s_m: f64 = 0.0, 0.0..=1e3, "s/m";
        /// Static friction over kinetic friction, r.
        static_friction_ratio: f64 = 1.0, 1.0..=10.0;
        /// Stribeck's speed v_s.
        stribeck_speed_m_s: f64 = 0.01, 1e-4..=10.0, "m/s";
        /// Viscous friction σ₂ per newton of normal force.
        viscous_friction_s_m: f64 = 0.0, 0.0..=10.0, "s/m";
        /// Error tolerance of one integration step, absolute and relative: for angles (rad), rates
        /// (rad/s) and the bristles' deflection y.
        local_error: f64 = 1e-6, 1e-9..=1e-3;
    }
}

/// The contact's law, with its constants precomputed.
#[derive(Clone, Copy, Debug)]
pub struct CompliantContact {
    stiffness_n_m: f64,
    /// Damping c of Kelvin–Voigt, N·s/m.
    damping_ns_m: f64,
    /// Dissipation d of Hunt–Crossley, s/m.
    dissipation_s_m: f64,
    settings: TipContact,
}

impl CompliantContact {
    /// Creates the law of validated settings.
    pub fn new(settings: &TipContact) -> Self {
        let (damping_ns_m, dissipation_s_m) = match settings.normal {
            NormalDamping::KelvinVoigt { damping_ns_m } => (damping_ns_m, 0.0),
            NormalDamping::Restitution {
                restitution,
                mass_kg,
            } => {
                let critical = 2.0 * (settings.stiffness_n_m * mass_kg).sqrt();
                (damping_ratio(restitution) * critical, 0.0)
            }
            NormalDamping::HuntCrossley { dissipation_s_m } => (0.0, dissipation_s_m),
        };
        Self {
            stiffness_n_m: settings.stiffness_n_m,
            damping_ns_m,
            dissipation_s_m,
            settings: *settings,
        }
    }

    /// Returns the normal force, N, at a penetration δ (m) with rate δ̇ (m/s).
    #[inline]
    pub fn normal_force_n(&self, depth_m: f64, depth_rate_m_s: f64) -> f64 {
        if depth_m <= 0.0 {
            return 0.0;
        }
        let spring = self.stiffness_n_m * depth_m;
        let force = spring * (1.0 + self.dissipation_s_m * depth_rate_m_s)
            + self.damping_ns_m * depth_rate_m_s;
        force.max(0.0)
    }

    /// Returns g, the ratio of friction to normal force in steady sliding, for the coefficient μ.
    #[inline]
    pub fn sliding_ratio(&self, friction: f64, slip_m_s: f64) -> f64 {
        let excess = self.settings.static_friction_ratio - 1.0;
        if excess == 0.0 {
            return friction;
        }
        let relative = slip_m_s / self.settings.stribeck_speed_m_s;
        friction * (1.0 + excess * libm::exp(-relative * relative))
    }

    /// Returns ẏ, 1/s, of bristles with deflection y at a slip velocity (m/s).
    #[inline]
    pub fn bristle_rate_per_s(&self, friction: f64, slip_m_s: f64, bristles: f64) -> f64 {
        // Avoids a division by zero without friction.
        let ratio = self.sliding_ratio(friction, slip_m_s).max(1e-6);
        self.settings.bristle_stiffness_per_m * (slip_m_s - slip_m_s.abs() * bristles / ratio)
    }

    /// Returns f_t/f_n of bristles with deflection y and rate ẏ (1/s) at a slip velocity (m/s).
    #[inline]
    pub fn friction_ratio(&self, slip_m_s: f64, bristles: f64, bristle_rate_per_s: f64) -> f64 {
        let settings = &self.settings;
        let damping = settings.bristle_damping_s_m / settings.bristle_stiffness_per_m;
        -(bristles + damping * bristle_rate_per_s + settings.viscous_friction_s_m * slip_m_s)
    }
}

/// Returns the damping ratio with which a mass that falls on a Kelvin–Voigt contact rebounds with
/// restitution e, where the contact ends when the force vanishes (Schwager and Pöschel 2007).
fn damping_ratio(restitution: f64) -> f64 {
    let of = |ratio: f64| {
        if ratio < 1.0 {
            let root = (1.0 - ratio * ratio).sqrt();
            let angle = libm::atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio * ratio);
            // Beyond 2 ζ² = 1 the angle exceeds π/2.
            libm::exp(-ratio / root * (core::f64::consts::PI - angle))
        } else {
            let root = (ratio * ratio - 1.0).sqrt().max(1e-9);
            libm::exp(-ratio / root * libm::log((ratio + root) / (ratio - root)))
        }
    };
    let (mut low, mut high) = (0.0, 50.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if of(middle) > restitution {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_normal_force_never_pulls(
            depth in -1e-3_f64..1e-3, rate in -1.0_f64..1.0, hunt: bool,
        ) {
            let normal = if hunt {
                NormalDamping::HuntCrossley { dissipation_s_m: 3.0 }
            } else {
                NormalDamping::KelvinVoigt { damping_ns_m: 76.0 }
            };
            let contact = CompliantContact::new(&TipContact { normal, ..Default::default() });
            let force = contact.normal_force_n(depth, rate);
            prop_assert!(force >= 0.0 && (depth > 0.0 || force == 0.0));
        }

        /// A mass on the contact alone, in small explicit steps, rebounds with the set restitution.
        #[test]
        fn the_damping_gives_the_restitution(restitution in 0.05_f64..0.95) {
            let settings = TipContact {
                normal: NormalDamping::Restitution { restitution, mass_kg: 0.05 },
                ..Default::default()
            };
            let contact = CompliantContact::new(&settings);
            let (mut depth, mut rate, step) = (1e-15, 1.0, 1e-7);
            for _ in 0..1_000_000 {
                let force = contact.normal_force_n(depth, rate);
                if depth <= 0.0 || (force == 0.0 && rate < 0.0) {
                    break;
                }
                rate -= force / 0.05 * step;
                depth += rate * step;
            }
            prop_assert!((-rate - restitution).abs() < 1e-3, "{} for {}", -rate, restitution);
        }
    }
}
