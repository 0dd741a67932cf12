//! Settings of the hybrid law.

use painleve_shared::settings;

settings! {
    /// Source of the friction f_t that the hybrid law compensates.
    #[derive(Copy)]
    pub enum FrictionFeedForward {
        /// The last reading of the force cell, as in the paper.
        "measured" => Measured,
        /// The estimated friction −μ̂ s α_f, corrected by the low-passed reading: d̂ += k (f_t + μ̂
        /// s α_f − d̂) with k = min(T/(τ + T), ⅓ p̂/Q22). The pole of the loop through the contact, 1 − k
        /// Q22/p, then stays at ⅔ or above even close to the edge.
        "observed" => Observed {
            /// Time constant τ far from the edge.
            time_constant_s: f32, 0.0..=10.0, "s";
        },
        /// Coulomb friction −μ sign(ż_r) α_f of a known belt.
        "model" => Model {
            /// Friction coefficient μ.
            friction: f32, 0.0..=10.0;
            /// Belt speed.
            belt_speed_m_s: f32, -100.0..=100.0, "m/s";
        },
    }
}

settings! {
    /// Settings of the hybrid law. The default gains are stable with one sample of delay at 1 kHz
    /// and 14-bit encoders.
    #[derive(Copy)]
    pub struct HybridSettings {
        /// Desired normal force f_n*; nothing is learnt of friction and contact from readings at the end of the force
        /// cell's range.
        normal_force_n: f32 = 10.0, 0.0..=1e3, "N";
        /// Position gain K'_P.
        position_gain_per_s2: f32 = 5800.0, 0.0..=1e6, "1/s²";
        /// Velocity gain K'_D.
        velocity_gain_per_s: f32 = 128.0, 0.0..=1e4, "1/s";
        /// Gain of ∫ (z_t* − z_t) dt, added to α_v; not in the paper.
        position_integral_gain_per_s3: f32 = 10_000.0, 0.0..=1e9, "1/s³";
        /// Rate at which the law learns, and cancels, the tip's acceleration along the belt by contact forces that are not
        /// fed forward; 0 for never. Not in the paper.
        force_drift_rad_s: f32 = 1500.0, 0.0..=1e4, "rad/s";
        /// Rate at which the normal force rises to f_n*, as a fraction of it: after landing, and after a motion that left
        /// too little torque for it.
        pressing_rate_per_s: f32 = 20.0, 0.1..=1e6, "1/s";
        /// Least fraction of f_n* to which the normal force is reduced where the torque limits do not allow f_n*, and from
        /// which it rises; 1 for always f_n*, as in the paper.
        least_pressing: f32 = 0.1, 0.0..=1.0;
        /// Integral gain K'_I of the force; 0 for none. The paper's is 650 1/s elbow down and 0 elbow up. The integral
        /// corrects by f_n* at most.
        force_integral_gain_per_s: f32 = 0.0, 0.0..=1e4, "1/s";
        /// Damping of a compliant contact, as a fraction of the change of force.
        contact_damping: f32 = 4.0, 0.0..=10.0;
        /// Friction feed-forward.
        friction: FrictionFeedForward = FrictionFeedForward::Observed { time_constant_s: 0.015 };
    }
}
