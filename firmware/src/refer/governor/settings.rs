//! Settings of the edge governor.

use painleve_shared::settings;

settings! {
    /// Settings of the edge governor.
    #[derive(Copy)]
    pub struct GovernorSettings {
        /// Whether the governor is active; if not, the reference must be within reach.
        enabled: bool = true;
        /// Least p/Q22.
        p_ratio: f32 = 0.08, 0.0..=0.9;
        /// Least p. A belt that accelerates by a changes the normal force by a/p, which must not take it all: p falls
        /// towards the straight arm, whatever p/Q22 is.
        p_per_kg: f32 = 0.0, 0.0..=1e3, "1/kg";
        /// Number of standard deviations added to the friction estimate.
        friction_deviations: f32 = 1.5, 0.0..=10.0;
        /// Distance kept from the point where p/Q22 has its least value, at 1 kHz; it grows with the square of the control
        /// period, in which a disturbance moves the tip before the controller reacts. It and the next three are added in
        /// squares.
        distance_m: f32 = 0.5e-3, 0.0..=0.1, "m";
        /// The same in encoder counts, as seen at the tip: rounding moves the tip by as much.
        distance_counts: f32 = 3.0, 0.0..=1e3, "counts";
        /// The same for each N·m of the joints' known friction.
        distance_m_nm: f32 = 0.06, 0.0..=10.0, "m/(N·m)";
        /// The same for each standard deviation of the tip's distance from the edges, `estimator.tip_deviation_m`.
        distance_deviations: f32 = 2.0, 0.0..=10.0;
        /// Deceleration at which the reference stops before an edge.
        braking_m_s2: f32 = 1.0, 1e-3..=1e3, "m/s²";
        /// Largest speed of the approach to a reference that is away from the tip.
        catch_up_m_s: f32 = 0.3, 1e-3..=10.0, "m/s";
    }
}
