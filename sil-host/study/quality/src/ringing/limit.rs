//! The stability limit of a compliant contact, with a friction observer around it.

/// A sliding contact and the arm behind it, at one place on the belt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactAtPlace {
    /// Stiffness k, N/m.
    pub stiffness_n_m: f64,
    /// Damping c, N·s/m.
    pub damping_ns_m: f64,
    /// p, 1/kg.
    pub p_per_kg: f64,
    /// Q22, 1/kg.
    pub q22_per_kg: f64,
}

impl ContactAtPlace {
    /// Returns the largest stable rate λ of the observer, 1/s; infinite if every rate is stable.
    ///
    /// It is the smaller root of the limit of Routh and Hurwitz, (λ + c p)(k p + c Q22 λ) = k Q22 λ.
    pub fn largest_rate_per_s(&self) -> f64 {
        let Self {
            stiffness_n_m: k,
            damping_ns_m: c,
            p_per_kg: p,
            q22_per_kg: q22,
        } = *self;
        let square = c * q22;
        let linear = k * p + c * c * p * q22 - k * q22;
        let constant = c * k * p * p;
        let discriminant = linear * linear - 4.0 * square * constant;
        if linear >= 0.0 || discriminant < 0.0 {
            return f64::INFINITY;
        }
        // The form without cancellation.
        2.0 * constant / (libm::sqrt(discriminant) - linear)
    }
}
