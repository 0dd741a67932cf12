//! Limits of the temperature of the torque stages' windings.

use crate::settings;

settings! {
    /// Protection of the windings by their I²t: a winding heats with the square of its torque, with one time
    /// constant. A torque stage controls the current, to which the torque is proportional.
    #[derive(Copy)]
    pub struct WindingSettings {
        /// Whether a winding that has become too hot stops the drive (fault 17).
        enabled: bool = true;
        /// Torque that each motor can give without end; half of its range (`converters.stages.motor_range_nm`) if absent.
        continuous_torque_nm: Option<[f32; 2]> = None, 1e-3..=1e6, "N·m";
        /// Time constant of each winding's temperature.
        time_constant_s: [f32; 2] = [20.0; 2], 1.0..=3600.0, "s";
    }
}
