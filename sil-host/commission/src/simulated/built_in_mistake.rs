//! Mistakes that can be built into a simulated arm.

use painleve_plant::scenario::Scenario;
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use strum::{EnumString, IntoStaticStr, VariantArray};

use super::wiring::Wiring;

/// A mistake of mounting or wiring, or a value in the scenario that the arm does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum BuiltInMistake {
    /// The magnet of joint 1 is mirrored.
    FirstEncoderMirrored,
    /// The elbow's magnet is mirrored.
    ElbowEncoderMirrored,
    /// The encoders' select lines are exchanged.
    EncodersSwapped,
    /// The encoder of joint 1 has turned by 30° on its shaft.
    FirstEncoderTurned,
    /// The elbow's encoder has turned by −30° on its shaft.
    ElbowEncoderTurned,
    /// The elbow's encoder repeats one reading.
    ElbowEncoderDead,
    /// The encoder of joint 1 does not answer.
    FirstEncoderSilent,
    /// The elbow's encoder turns twice as far as its joint.
    ElbowEncoderGeared,
    /// The motor of joint 1 has its phases exchanged.
    FirstStageMirrored,
    /// The elbow's motor has its phases exchanged.
    ElbowStageMirrored,
    /// The stages' inputs are exchanged.
    StagesSwapped,
    /// The stage of joint 1 gives half of its torque.
    FirstStageHalved,
    /// The elbow's stage gives twice its torque.
    ElbowStageDoubled,
    /// The gear of joint 1 has a third of its ratio.
    FirstGearOfAnotherRatio,
    /// The elbow's stage has no supply.
    ElbowStageDead,
    /// The force cell is mounted upside down.
    ForceCellUpsideDown,
    /// The wires of f_t are exchanged.
    TangentialForceMirrored,
    /// The force cell's axes are exchanged.
    ForceAxesSwapped,
    /// The bridge of f_n is out of balance by 40 % of the range.
    ForceCellOutOfBalance,
    /// The force cell has no supply: its live zero is gone.
    ForceCellWithoutSupply,
    /// The force cell repeats its reading without a load.
    ForceCellStuck,
    /// The force cell has three times its range.
    ForceCellOfAnotherRange,
    /// The belt is 12 mm higher.
    BeltTooHigh,
}

impl BuiltInMistake {
    /// All mistakes.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Returns the name in the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Builds the mistake into an arm.
    pub(super) fn build_into(self, wiring: &mut Wiring, actual: &mut Scenario) {
        let modulus = 1 << actual.converters.encoder.bits;
        let force_range_counts = 1 << (actual.converters.force.bits - 1);
        let toggle = |flag: &mut bool| *flag = !*flag;
        let turn = |offset: &mut u32, twelfths: u32| {
            *offset = (*offset + twelfths * modulus / 12) % modulus;
        };
        let mounting = &mut wiring.mounting;
        match self {
            Self::FirstEncoderMirrored => toggle(&mut mounting.encoder_reversed[0]),
            Self::ElbowEncoderMirrored => toggle(&mut mounting.encoder_reversed[1]),
            Self::EncodersSwapped => wiring.encoders_swapped = true,
            Self::FirstEncoderTurned => turn(&mut wiring.encoder_offsets[0], 1),
            Self::ElbowEncoderTurned => turn(&mut wiring.encoder_offsets[1], 11),
            Self::ElbowEncoderDead => wiring.encoder_frozen[1] = Some(EncoderCounts(0)),
            Self::FirstEncoderSilent => wiring.encoder_silent[0] = true,
            Self::ElbowEncoderGeared => wiring.encoder_ratio[1] = 2.0,
            Self::FirstStageMirrored => toggle(&mut mounting.stage_reversed[0]),
            Self::ElbowStageMirrored => toggle(&mut mounting.stage_reversed[1]),
            Self::StagesSwapped => wiring.stages_swapped = true,
            Self::FirstStageHalved => wiring.stage_gain[0] = 0.5,
            Self::ElbowStageDoubled => wiring.stage_gain[1] = 2.0,
            Self::FirstGearOfAnotherRatio => wiring.gear_ratio[0] = 1.0 / 3.0,
            Self::ElbowStageDead => wiring.stage_gain[1] = 0.0,
            Self::ForceCellUpsideDown => mounting.force_reversed.iter_mut().for_each(toggle),
            Self::TangentialForceMirrored => toggle(&mut mounting.force_reversed[0]),
            Self::ForceAxesSwapped => wiring.forces_swapped = true,
            Self::ForceCellOutOfBalance => {
                mounting.force_tare[1] = ForceCounts(force_range_counts * 2 / 5);
            }
            Self::ForceCellWithoutSupply => wiring.force_silent = true,
            Self::ForceCellStuck => wiring.force_stuck = true,
            Self::ForceCellOfAnotherRange => wiring.force_gain = 1.0 / 3.0,
            Self::BeltTooHigh => actual.arm.height_m -= 0.012,
        }
    }
}
