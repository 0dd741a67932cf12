//! Codes of the converter that drives the torque stages, from joint torques.

use painleve_shared::counts::{LinearScale, TorqueCounts};
use painleve_shared::mounting::Mounting;
use painleve_shared::stages::StageSettings;

/// Bits of the torque stages' digital-to-analog converter.
pub const CONVERTER_BITS: u8 = 12;

/// The converter's code for zero torque.
pub const NO_TORQUE: u16 = 1 << (CONVERTER_BITS - 1);

/// Scale between joint torques and the converter's codes.
#[derive(Clone, Copy, Debug)]
pub struct StageScale {
    /// Codes per count of joint torque; negative for a stage that turns its joint backwards.
    codes_per_count: [f32; 2],
}

impl StageScale {
    /// Makes the scale of stages for joint torques of this scale.
    pub fn new(torque: &LinearScale<f32>, stages: &StageSettings, mounting: &Mounting) -> Self {
        let code_range = f32::from(NO_TORQUE);
        let mut codes_per_count = [0.0; 2];
        let range_nm = stages.joint_range_nm(torque.range);
        for ((scale, range_nm), is_reversed) in codes_per_count
            .iter_mut()
            .zip(range_nm)
            .zip(mounting.stage_reversed)
        {
            let forward = torque.per_count() / range_nm * code_range;
            *scale = if is_reversed { -forward } else { forward };
        }
        Self { codes_per_count }
    }

    /// Returns the converter's codes for joint torques, in offset binary; limited to its range.
    #[inline]
    pub fn codes(&self, torques: [TorqueCounts; 2]) -> [u16; 2] {
        let [torque_1, torque_2] = torques;
        let [scale_1, scale_2] = self.codes_per_count;
        [code(torque_1, scale_1), code(torque_2, scale_2)]
    }
}

/// Returns the code nearest to a torque.
#[inline]
fn code(torque: TorqueCounts, codes_per_count: f32) -> u16 {
    // Half a code more, so that cutting off the fraction rounds.
    let code = torque.0 as f32 * codes_per_count + (f32::from(NO_TORQUE) + 0.5);
    // The conversion to 32 bits is one instruction. It saturates at 0; a torque that is not finite cannot occur.
    (code as u32).min((1 << CONVERTER_BITS) - 1) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(bits: u8, stages: StageSettings, stage_reversed: [bool; 2]) -> StageScale {
        let mounting = Mounting {
            stage_reversed,
            ..Mounting::default()
        };
        StageScale::new(&LinearScale { bits, range: 5.0 }, &stages, &mounting)
    }

    fn codes(scale: &StageScale, counts: i32) -> [u16; 2] {
        scale.codes([TorqueCounts(counts); 2])
    }

    #[test]
    fn without_a_gear_every_count_is_a_code() {
        let scale = scale(12, StageSettings::default(), [false, true]);
        for counts in -2048..=2047 {
            let forward = (2048 + counts) as u16;
            let backwards = (2048 - counts).min(4095) as u16;
            assert_eq!(codes(&scale, counts), [forward, backwards]);
        }
    }

    #[test]
    fn other_resolutions_are_rounded() {
        let scale = scale(16, StageSettings::default(), [false; 2]);
        for (counts, code) in [(16, 2049), (7, 2048), (9, 2049), (-9, 2047), (32767, 4095)] {
            assert_eq!(codes(&scale, counts), [code; 2]);
        }
    }

    /// 5 N·m at the joint are 5/(10 · 0.8) = 0.625 N·m of a motor of 1 N·m; and 5/(0.5 · 8) = 1.25 of one of 1 N·m.
    #[test]
    fn a_gear_and_a_motor_scale_the_torque() {
        let stages = StageSettings {
            gear_ratio: [10.0, 5.0],
            gear_efficiency: [0.8, 0.8],
            motor_range_nm: Some([1.0; 2]),
        };
        let scale = scale(12, stages, [false; 2]);
        assert_eq!(codes(&scale, 1000), [2048 + 625, 2048 + 1250]);
        assert_eq!(codes(&scale, -1000), [2048 - 625, 2048 - 1250]);
        assert_eq!(codes(&scale, 2047)[1], 4095);
        assert_eq!(codes(&scale, -2048)[1], 0);
    }
}
