//! Mounting of sensors and torque stages on a real arm.

use crate::counts::ForceCounts;
use crate::settings;

settings! {
    /// Directions and zeros of the parts as they are mounted. A board corrects its readings and torques by
    /// them, so that the controller always sees the arm of the model. The simulated arm has none of these.
    #[derive(Copy, Eq)]
    pub struct Mounting {
        /// Whether the encoders of θ1 and of the elbow count backwards, as behind a mirrored magnet.
        encoder_reversed: [bool; 2] = [false; 2];
        /// Whether the torque stages turn their joints backwards.
        stage_reversed: [bool; 2] = [false; 2];
        /// Whether the force cell reads f_t and f_n with the opposite sign.
        force_reversed: [bool; 2] = [false; 2];
        /// Readings of f_t and f_n without a load, in counts from the live zero, before any change of sign.
        force_tare: [ForceCounts; 2] = [ForceCounts(0); 2], -(1 << 21)..=(1 << 21) - 1, "counts";
        /// Lowest code of the force cell's converter (4096 counts are 5 V, the live zero is 2048) that a
        /// working cell gives: below, a supply or a wire is dead.
        force_lowest_code: u16 = 82, 41..=1024, "counts";
        /// Highest code that a working cell gives.
        force_highest_code: u16 = 4013, 3071..=4054, "counts";
    }
}
