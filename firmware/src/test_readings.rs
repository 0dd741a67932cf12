//! Readings that the tests of several modules give to what they test.

use painleve_shared::counts::ForceCounts;
use painleve_shared::frame::{DigitalInputs, SensorFrame};

use crate::configuration::Configuration;

/// Returns uniform noise in −1 … 1 from a fixed stream.
pub fn noise(step: u32) -> f32 {
    // The finaliser of MurmurHash3: successive steps are not correlated.
    let bits = step.wrapping_add(1);
    let bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    let bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    let bits = bits ^ (bits >> 16);
    (bits >> 8) as f32 / (1 << 23) as f32 - 1.0
}

/// Returns the frame of an arm at rest at x0,d that presses with 10 N and is enabled.
pub fn pressing(tick: u32) -> SensorFrame {
    let [encoder, _] = <Configuration>::default().converters.encoders;
    SensorFrame {
        tick,
        sequence: tick,
        joints: [
            encoder.reading((-11.4_f64).to_radians()),
            encoder.reading((-35.1_f64 + 11.4).to_radians()),
        ],
        normal_force: ForceCounts(1024),
        tangential_force: ForceCounts(-614),
        inputs: DigitalInputs::ENABLE,
    }
}
