//! Sensor frames from readings and switches, and the permission to arm: the part of a board with an arm that
//! depends on no chip.

use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::{DigitalInputs, SensorFrame};

use crate::ReadError;
use crate::encoders::{self, EncoderDriver};
use crate::force_cell::{self, ForceCellDriver};
use crate::plausibility::{Plausibility, SensorReadings};
use crate::switches::Switches;

/// Count of a sensor without a reading: out of every range, so that the controller counts it as a lapse.
const NO_ENCODER: EncoderCounts = EncoderCounts(u32::MAX);
const NO_FORCE: ForceCounts = ForceCounts(i32::MAX);

/// Levels of the switches' pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SwitchLevels {
    /// ENABLE.
    pub enable: bool,
    /// RESET.
    pub reset: bool,
}

/// Assembles the sensor frames of an arm.
#[derive(Clone, Debug)]
pub struct FrontEnd {
    encoder_bits: u8,
    force_bits: u8,
    switches: Switches,
    plausibility: Plausibility,
    sequence: u32,
    may_arm: bool,
    is_active: bool,
    has_readings: bool,
}

impl Default for FrontEnd {
    fn default() -> Self {
        Self::new(encoders::BITS, force_cell::BITS)
    }
}

impl FrontEnd {
    /// Makes a front end that gives counts of these resolutions and does not permit arming.
    pub fn new(encoder_bits: u8, force_bits: u8) -> Self {
        Self {
            encoder_bits,
            force_bits,
            switches: Switches::default(),
            plausibility: Plausibility::default(),
            sequence: 0,
            may_arm: false,
            is_active: false,
            has_readings: false,
        }
    }

    /// Permits or forbids the drive to arm.
    pub fn permit_arming(&mut self, permitted: bool) {
        self.may_arm = permitted;
    }

    /// Returns whether every reading of the last frame has come. Without one the torque has to go off at once:
    /// the controller tolerates a lost reading, which is one tick old already.
    pub fn has_readings(&self) -> bool {
        self.has_readings
    }

    /// Records whether the controller's last answer is in a state in which torque may be applied. A drive
    /// that has stopped needs a new permission.
    pub fn note_active(&mut self, is_active: bool) {
        self.may_arm &= is_active || !self.is_active;
        self.is_active = is_active;
    }

    /// Returns the frame of one tick. Sensors whose readings are not complete are `None`. ENABLE is high
    /// only with the permission and, before the drive is armed, with plausible readings.
    pub fn frame(
        &mut self,
        encoders: Option<&EncoderDriver>,
        force_cell: Option<&ForceCellDriver>,
        levels: SwitchLevels,
    ) -> SensorFrame {
        let lost = (Err(ReadError::Bus), Err(ReadError::Bus));
        let joints = encoders.map_or([Err(ReadError::Bus); 2], |it| {
            it.readings(self.encoder_bits)
        });
        let (tangential, normal) = force_cell.map_or(lost, |it| it.readings(self.force_bits));
        let magnets = encoders.map_or([None; 2], EncoderDriver::diagnostics);
        let readings = SensorReadings {
            joints: joints.map(Result::ok),
            forces: [tangential.ok(), normal.ok()],
            magnets: magnets.map(|it| it.map(|it| it.is_healthy())),
        };
        self.has_readings = readings.are_complete();
        let mut inputs = self.switches.tick(levels.enable, levels.reset);
        let plausible = self
            .plausibility
            .tick(&readings, self.encoder_bits, self.force_bits);
        if !self.may_arm || plausible.is_err() && !self.is_active {
            inputs.remove(DigitalInputs::ENABLE);
        }
        self.sequence = self.sequence.wrapping_add(1);
        SensorFrame {
            tick: self.sequence,
            sequence: self.sequence,
            joints: joints.map(|it| it.unwrap_or(NO_ENCODER)),
            normal_force: normal.unwrap_or(NO_FORCE),
            tangential_force: tangential.unwrap_or(NO_FORCE),
            inputs,
        }
    }
}
