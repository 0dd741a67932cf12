//! Mounting of sensors and torque stages on a real arm.

use crate::counts::ForceCounts;
use crate::settings;

settings! {
    /// The sensors that are read on each channel: both encoders, f_t and f_n.
    #[derive(Copy, Eq)]
    pub enum SensorParts = Both {
        /// The first sensor of each channel; there may be no second one. A sensor that repeats a plausible
        /// reading is then found only by the motion that it hides.
        "first" => First,
        /// The second sensor of each channel, in place of the first.
        "second" => Second,
        /// Both. The readings of the first sensors count as long as the second ones confirm them.
        "both" => Both,
    }
}

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
        /// Lowest code of the force cell's converter that a working cell gives: 4096 counts are 5 V, the live zero is
        /// 2048.
        force_lowest_code: u16 = 82, 41..=1024, "counts";
        /// Highest code that a working cell gives.
        force_highest_code: u16 = 4013, 3071..=4054, "counts";
        /// The sensors that are read on each channel.
        sensors: SensorParts = SensorParts::Both;
        /// Whether the second encoders of θ1 and of the elbow count backwards.
        second_encoder_reversed: [bool; 2] = [false; 2];
        /// Whether the second force cell, or second bridges on the same one, read f_t and f_n with the opposite
        /// sign. Their tare is not needed.
        second_force_reversed: [bool; 2] = [false; 2];
        /// Largest difference of two encoders of one joint by their noise, in counts of 14 bits; by default six standard
        /// deviations of the noisiest AS5048A.
        second_encoder_tolerance: u16 = 23, 4..=400, "counts";
        /// Largest difference of two readings of one force by their noise, in counts of 12 bits.
        second_force_tolerance: u16 = 16, 4..=400, "counts";
    }
}
