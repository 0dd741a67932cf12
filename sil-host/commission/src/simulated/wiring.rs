//! Mounting and wiring of a simulated arm's parts, and their effect on its readings and torques.

use painleve_plant::scenario::Scenario;
use painleve_shared::counts::{
    EncoderCounts, EncoderScale, ForceCounts, LinearScale, TorqueCounts,
};
use painleve_shared::mounting::Mounting;

/// Mounting and wiring of an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Wiring {
    /// Directions and the force cell's zeros.
    pub mounting: Mounting,
    /// Readings of the encoders at angle zero, in the joints' directions, counts.
    pub encoder_offsets: [u32; 2],
    /// Whether each encoder is on the other's line.
    pub encoders_swapped: bool,
    /// Encoders that repeat this reading.
    pub encoder_frozen: [Option<EncoderCounts>; 2],
    /// Encoders that do not answer.
    pub encoder_silent: [bool; 2],
    /// Angle of each encoder divided by its joint's.
    pub encoder_ratio: [f64; 2],
    /// Whether each stage drives the other's joint.
    pub stages_swapped: bool,
    /// Torque of each stage divided by its command.
    pub stage_gain: [f64; 2],
    /// Gear ratio of each joint divided by the scenario's.
    pub gear_ratio: [f64; 2],
    /// Whether f_t and f_n are exchanged.
    pub forces_swapped: bool,
    /// Whether the force cell gives codes that no force gives.
    pub force_silent: bool,
    /// Whether the force cell always reads its tare.
    pub force_stuck: bool,
    /// Force cell reading divided by the force.
    pub force_gain: f64,
}

impl Wiring {
    /// Returns the wiring that a scenario describes, without a mistake.
    pub fn as_described(scenario: &Scenario) -> Self {
        Self {
            mounting: scenario.converters.mounting,
            encoder_offsets: scenario.converters.encoder.offset_counts,
            encoders_swapped: false,
            encoder_frozen: [None; 2],
            encoder_silent: [false; 2],
            encoder_ratio: [1.0; 2],
            stages_swapped: false,
            stage_gain: [1.0; 2],
            gear_ratio: [1.0; 2],
            forces_swapped: false,
            force_silent: false,
            force_stuck: false,
            force_gain: 1.0,
        }
    }

    /// Returns the encoders' readings for the readings of a perfectly mounted arm.
    pub fn encoders(
        &self,
        scales: &[EncoderScale; 2],
        joints: [EncoderCounts; 2],
    ) -> [EncoderCounts; 2] {
        let mut raw = [EncoderCounts(0); 2];
        for joint in 0..2 {
            let scale = &scales[joint];
            let mask = scale.modulus() - 1;
            let angle =
                f64::from(scale.counts_from_zero(joints[joint])) * self.encoder_ratio[joint];
            let forward = self.encoder_offsets[joint].wrapping_add_signed(angle.round() as i32);
            let turned = if self.mounting.encoder_reversed[joint] {
                forward.wrapping_neg()
            } else {
                forward
            };
            raw[joint] = EncoderCounts(turned & mask);
            if let Some(frozen) = self.encoder_frozen[joint] {
                raw[joint] = frozen;
            }
            if self.encoder_silent[joint] {
                raw[joint] = EncoderCounts::MISSING;
            }
        }
        if self.encoders_swapped {
            raw.swap(0, 1);
        }
        raw
    }

    /// Returns the force cell's readings for those of a perfectly mounted one, f_t and f_n.
    pub fn forces(
        &self,
        scale: &LinearScale<f32>,
        mut forces: [ForceCounts; 2],
    ) -> [ForceCounts; 2] {
        if self.force_silent {
            return [ForceCounts::MISSING; 2];
        }
        if self.forces_swapped {
            forces.swap(0, 1);
        }
        let most = scale.maximum_counts();
        let mut raw = [ForceCounts(0); 2];
        for axis in 0..2 {
            let counts = (f64::from(forces[axis].0) * self.force_gain).round() as i32;
            let signed = match (self.force_stuck, self.mounting.force_reversed[axis]) {
                (true, _) => 0,
                (false, true) => -counts,
                (false, false) => counts,
            };
            let reading = signed + self.mounting.force_tare[axis].0;
            raw[axis] = ForceCounts(reading.clamp(-most - 1, most));
        }
        raw
    }

    /// Returns the torques at the joints for commanded ones.
    pub fn torques(
        &self,
        scale: &LinearScale<f32>,
        mut torques: [TorqueCounts; 2],
    ) -> [TorqueCounts; 2] {
        for (joint, torque) in torques.iter_mut().enumerate() {
            let scale_of_joint = self.stage_gain[joint] * self.gear_ratio[joint];
            let gain = if self.mounting.stage_reversed[joint] {
                -scale_of_joint
            } else {
                scale_of_joint
            };
            let most = scale.maximum_counts();
            let counts = (f64::from(torque.0) * gain).round() as i32;
            *torque = TorqueCounts(counts.clamp(-most - 1, most));
        }
        if self.stages_swapped {
            torques.swap(0, 1);
        }
        torques
    }
}
