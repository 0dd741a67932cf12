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
        /// Least p. A belt surface that accelerates by a towards or away from the arm changes the normal force by a/p, and
        /// must not use all of it up; p falls as the arm straightens, whatever p/Q22 is.
        p_per_kg: f32 = 0.0, 0.0..=1e3, "1/kg";
        /// Number of standard deviations by which friction and the tip's place are taken to be worse than estimated.
        deviations: f32 = 2.0, 0.0..=10.0;
        /// Distance kept from the point where p/Q22 has its least value, at 1 kHz; it grows with the square of the control
        /// period, in which a disturbance moves the tip before the controller reacts. The deviations of the tip's place
        /// are added in squares.
        distance_m: f32 = 0.5e-3, 0.0..=0.1, "m";
        /// Deceleration at which the reference stops before an edge.
        braking_m_s2: f32 = 1.0, 1e-3..=1e3, "m/s²";
        /// Largest speed of the approach to a reference that is away from the tip, in addition to its own. A tip that overtakes
        /// a slow belt slips in the other direction, for which nothing has been kept free.
        catch_up_m_s: f32 = 0.06, 1e-3..=10.0, "m/s";
    }
}
