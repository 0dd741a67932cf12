//! Settings of the edge governor.

use painleve_shared::settings;

settings! {
    /// Settings of the edge governor.
    #[derive(Copy)]
    pub struct GovernorSettings {
        /// Whether the governor is active; if not, the reference must be within reach.
        enabled: bool = true;
        /// Least p/Q22.
        minimum_p_ratio: f32 = 0.012, 0.0..=0.9;
        /// The same, times the square of the control period, if that is more: the distance by which a
        /// disturbance moves the tip before the controller reacts grows with that square.
        p_ratio_per_s2: f32 = 2e4, 0.0..=1e6, "1/s²";
        /// Number of standard deviations added to the friction estimate.
        friction_deviations: f32 = 1.5, 0.0..=10.0;
        /// Distance kept from the point where p/Q22 has its least value, except on a soft contact; below 1 kHz it
        /// grows with the square of the control period.
        distance_m: f32 = 0.5e-3, 0.0..=0.1, "m";
        /// Number of encoder counts, as seen at the tip, added to that distance: rounding moves the
        /// tip by as much.
        distance_counts: f32 = 3.0, 0.0..=1e3, "counts";
        /// Distance kept from the point where p is zero, for each N·m of the joints' known friction.
        clearance_m_nm: f32 = 0.085, 0.0..=10.0, "m/(N·m)";
        /// Distance kept from that point in addition, for each rad of the gears' known play.
        clearance_m_rad: f32 = 2.55, 0.0..=100.0, "m/rad";
        /// Distance kept from that point in addition, for each N (at most 0.2 N) by which the force changes from tick
        /// to tick by causes unknown: near the edge a vibration is amplified, and an unknown inertia moves the edge.
        clearance_m_n: f32 = 0.04, 0.0..=10.0, "m/N";
        /// Largest such distance.
        clearance_limit_m: f32 = 8e-3, 0.0..=0.1, "m";
        /// Deceleration at which the reference stops before an edge.
        braking_m_s2: f32 = 1.0, 1e-3..=1e3, "m/s²";
        /// Largest speed of the approach to a reference that is away from the tip.
        catch_up_m_s: f32 = 0.3, 1e-3..=10.0, "m/s";
    }
}
