//! Sensor frames from readings and switches, and the permission to arm: the part of a board with an arm that
//! depends on no chip.

use painleve_shared::Arm;
use painleve_shared::counts::{
    EncoderCounts, EncoderScale, ForceCounts, LinearScale, TorqueCounts,
};
use painleve_shared::frame::{DigitalInputs, SensorFrame};
use painleve_shared::mounting::{Mounting, SensorParts};
use painleve_shared::stages::StageSettings;
use painleve_shared::winding::WindingSettings;

use crate::ReadError;
use crate::TURNS;
use crate::checks::{Checks, Verdict};
use crate::encoders::EncoderDriver;
use crate::force_cell::{ForceCellDriver, ForceReadings};
use crate::gap::{GapCheck, Scales};
use crate::heating::HeatingModel;
use crate::plausibility::{Implausible, SensorReadings};
use crate::second_channel::{SecondChannel, Tolerance};
use crate::switches::Switches;

/// Largest difference of two AS5048A over a turn by their nonlinearity, ±1.6° together (DS000298, ±0.8° each),
/// from one end of it to the other, counts.
const ENCODER_RANGE: u16 = 146;

/// A sixteenth of the force cell's range by the gains of two cells, counts.
const FORCE_RANGE: u16 = 128;

/// Levels of the input pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InputLevels {
    /// ENABLE.
    pub enable: bool,
    /// RESET.
    pub reset: bool,
    /// Both torque stages are ready.
    pub stages_ready: bool,
}

/// What a front end knows about its arm.
#[derive(Clone, Debug)]
pub struct FrontEndSettings {
    /// Encoders of θ1 and of the elbow.
    pub encoders: [EncoderScale; 2],
    /// Force cell, N.
    pub force: LinearScale<f32>,
    /// Torque stages, N·m.
    pub torque: LinearScale<f32>,
    /// Their motors and gears.
    pub stages: StageSettings,
    /// Protection of their windings.
    pub winding: WindingSettings,
    /// Directions and zeros of the parts.
    pub mounting: Mounting,
    /// Rate of the readings, Hz.
    pub tick_hz: f32,
    /// The arm on its belt; `None` if the mounting is still unknown, so that encoders and force cell cannot be
    /// checked against each other.
    pub arm: Option<Arm<f32>>,
    /// Ticks for which RESET has to be pressed, with ENABLE open, to permit arming; `None` if only a host may.
    pub button_ticks: Option<u32>,
}

/// Assembles the sensor frames of an arm.
#[derive(Clone, Debug)]
pub struct FrontEnd {
    settings: Option<FrontEndSettings>,
    checks: Checks,
    switches: Switches,
    /// The newest readings, in the arm's directions, forces as (f_t, f_n), and whether they have come since the last
    /// frame.
    readings: SensorReadings,
    has_new_joints: bool,
    has_new_forces: bool,
    /// Second sensors of θ1, the elbow, f_t and f_n.
    second_encoders: [SecondChannel; 2],
    second_forces: [SecondChannel; 2],
    sequence: u32,
    may_arm: bool,
    /// Ticks for which RESET has been pressed, with ENABLE open.
    pressed_ticks: u32,
    is_active: bool,
    /// Whether the last frame had ENABLE.
    is_enabled: bool,
    /// Torques put out since the last frame.
    torques: [TorqueCounts; 2],
    is_fit: bool,
}

impl FrontEnd {
    /// Makes a front end that does not permit arming; without settings its frames have no readings.
    pub fn new(settings: Option<FrontEndSettings>) -> Self {
        let gap = settings.as_ref().and_then(|it| {
            let scales = Scales {
                encoders: it.encoders,
                force: it.force,
                torque: it.torque,
                check_hz: it.tick_hz / f32::from(TURNS),
            };
            Some(GapCheck::new(it.arm?, scales))
        });
        let heating_model = settings
            .as_ref()
            .and_then(|it| HeatingModel::new(&it.winding, &it.stages, &it.torque, it.tick_hz));
        let tick_hz = settings.as_ref().map_or(0.0, |it| it.tick_hz);
        let bits = settings.as_ref().map_or((0, 0), |it| {
            let [encoder, _] = it.encoders;
            (encoder.bits, it.force.bits)
        });
        Self {
            settings,
            checks: Checks::new(gap, heating_model, bits),
            switches: Switches::new(tick_hz),
            readings: SensorReadings::default(),
            has_new_joints: false,
            has_new_forces: false,
            second_encoders: [SecondChannel::default(); 2],
            second_forces: [SecondChannel::default(); 2],
            sequence: 0,
            may_arm: false,
            pressed_ticks: 0,
            is_active: false,
            is_enabled: false,
            torques: [TorqueCounts(0); 2],
            is_fit: false,
        }
    }

    /// Starts afresh with these settings; the windings are as hot as they were.
    pub fn restart(&mut self, settings: FrontEndSettings) {
        let mut restarted = Self::new(Some(settings));
        restarted.checks.keep_heat_of(&self.checks);
        *self = restarted;
    }

    /// Permits or forbids the drive to arm. After a new permission, ENABLE must be opened before it is closed: the arm moves
    /// when the operator closes the switch, not when the host permits it.
    pub fn permit_arming(&mut self, permitted: bool) {
        if permitted && !self.may_arm {
            self.switches.must_open();
        }
        self.may_arm = permitted;
    }

    /// Returns whether the drive may be on: every reading of the last frame has come, and the torque stages
    /// are ready. Otherwise the torque has to go off at once: the controller tolerates a lapse, and readings
    /// are one tick old already.
    pub fn is_fit(&self) -> bool {
        self.is_fit
    }

    /// Records whether the controller's last answer is in a state in which torque may be applied, and the
    /// torques that are put out, zero with the stages off. A drive that has stopped needs a new permission. A switch that was
    /// closed without effect, as in a fault, must be opened first: ENABLE that comes again with a reading would arm the drive.
    pub fn note_output(&mut self, is_active: bool, torques: [TorqueCounts; 2]) {
        self.may_arm &= is_active || !self.is_active;
        if self.is_enabled && !is_active {
            self.switches.must_open();
        }
        self.is_active = is_active;
        self.torques = torques;
    }

    /// Takes the readings of a complete set of the encoders for the next frame.
    // Out of line, so that the bound of the sensors' interrupts counts it once in a set of readings.
    #[inline(never)]
    pub fn take_encoders(&mut self, encoders: &EncoderDriver) {
        let Some(settings) = &self.settings else {
            return;
        };
        let [scale, _] = settings.encoders;
        let mask = scale.modulus().wrapping_sub(1);
        let turned = |counts: EncoderCounts, reversed: bool| {
            let backwards = EncoderCounts(counts.0.wrapping_neg() & mask);
            if reversed { backwards } else { counts }
        };
        let mounting = &settings.mounting;
        let [reversed_1, reversed_2] = match mounting.sensors {
            SensorParts::First | SensorParts::Both => mounting.encoder_reversed,
            SensorParts::Second => mounting.second_encoder_reversed,
        };
        let [joint_1, joint_2] = encoders.readings(scale.bits);
        let magnets = encoders.magnets();
        // An encoder that has lost its magnet may repeat its last angle. Before arming, the checks refuse it by name.
        let is_active = self.is_active;
        let is_angle = |magnet: Option<bool>| !is_active || magnet != Some(false);
        let reading = |joint: Result<EncoderCounts, ReadError>, reversed, magnet| {
            let counts = joint.ok().filter(|_| is_angle(magnet))?;
            Some(turned(counts, reversed))
        };
        self.readings.joints = [
            reading(joint_1, reversed_1, magnets[0]),
            reading(joint_2, reversed_2, magnets[1]),
        ];
        if mounting.sensors == SensorParts::Both {
            let tolerance = Tolerance {
                noise: mounting.second_encoder_tolerance,
                range: ENCODER_RANGE,
            };
            let reversed = [mounting.encoder_reversed, mounting.second_encoder_reversed];
            let pairs = encoders
                .pairs()
                .map(|pair| pair.map(|it| it.map(i32::from)));
            let channels = &mut self.second_encoders;
            let joints = &mut self.readings.joints;
            confirm(channels, joints, pairs, reversed, tolerance, self.is_active);
        }
        self.has_new_joints = true;
        self.readings.magnets = magnets;
    }

    /// Takes the readings of a complete set of the force cell for the next frame.
    // Out of line for the same reason as `take_encoders`.
    #[inline(never)]
    pub fn take_forces(&mut self, force_cell: &ForceCellDriver) {
        let Some(settings) = &self.settings else {
            return;
        };
        let most = settings.force.maximum_counts();
        let balanced = |counts: ForceCounts, tare: ForceCounts, reversed: bool| {
            let net = counts.0.wrapping_sub(tare.0);
            ForceCounts(if reversed { net.wrapping_neg() } else { net }.clamp(-most - 1, most))
        };
        let mounting = &settings.mounting;
        let [reversed_t, reversed_n] = match mounting.sensors {
            SensorParts::First | SensorParts::Both => mounting.force_reversed,
            SensorParts::Second => mounting.second_force_reversed,
        };
        let [tare_t, tare_n] = mounting.force_tare;
        let ForceReadings { tangential, normal } =
            force_cell.readings(settings.force.bits, mounting);
        self.readings.forces = [
            tangential.ok().map(|it| balanced(it, tare_t, reversed_t)),
            normal.ok().map(|it| balanced(it, tare_n, reversed_n)),
        ];
        self.has_new_forces = true;
        if mounting.sensors == SensorParts::Both {
            let tolerance = Tolerance {
                noise: mounting.second_force_tolerance,
                range: FORCE_RANGE,
            };
            let reversed = [mounting.force_reversed, mounting.second_force_reversed];
            let pairs = force_cell.pairs(mounting);
            let channels = &mut self.second_forces;
            let forces = &mut self.readings.forces;
            confirm(channels, forces, pairs, reversed, tolerance, self.is_active);
        }
    }

    /// Returns the frame of one tick, from the readings taken since the last one. ENABLE is high only with the
    /// permission and, before the drive is armed, with plausible readings and ready stages.
    pub fn frame(&mut self, levels: InputLevels) -> SensorFrame {
        let mut inputs = self.switches.tick(levels.enable, levels.reset);
        self.note_button(inputs.contains(DigitalInputs::RESET), levels.enable);
        let readings = &mut self.readings;
        let Verdict {
            contradiction,
            is_hot,
            plausible,
        } = *self.checks.verdict();
        // A sensor whose next set of readings is not complete in time gives none.
        if !core::mem::take(&mut self.has_new_joints) {
            readings.joints = [None; 2];
        }
        if !core::mem::take(&mut self.has_new_forces) {
            readings.forces = [None; 2];
        }
        let (joints, forces) = (readings.joints, readings.forces);
        let (is_complete, joints, [tangential_force, normal_force]) = match (joints, forces) {
            ([Some(joint_1), Some(joint_2)], [Some(tangential), Some(normal)]) => {
                (true, [joint_1, joint_2], [tangential, normal])
            }
            _ => (
                false,
                joints.map(|it| it.unwrap_or(EncoderCounts::MISSING)),
                forces.map(|it| it.unwrap_or(ForceCounts::MISSING)),
            ),
        };
        self.is_fit = is_complete && levels.stages_ready;
        if !is_complete {
            self.checks.note_missing();
        }
        if self.is_active {
            inputs.set(DigitalInputs::STAGE_NOT_READY, !levels.stages_ready);
            inputs.set(DigitalInputs::GAP_AGAINST_FORCE, contradiction);
            inputs.set(DigitalInputs::WINDING_HOT, is_hot);
        } else {
            let is_ready = plausible.is_ok() && levels.stages_ready && !contradiction && !is_hot;
            // Readings that have not been checked for long enough are no refusal yet.
            let is_refused = !is_ready && plausible != Err(Implausible::NotYet);
            let is_wanted = self.may_arm && inputs.contains(DigitalInputs::ENABLE);
            inputs.set(DigitalInputs::ARMING_REFUSED, is_wanted && is_refused);
            inputs.set(DigitalInputs::ENABLE, is_wanted && is_ready && self.is_fit);
        }
        if !self.may_arm {
            inputs.remove(DigitalInputs::ENABLE);
        }
        self.is_enabled = inputs.contains(DigitalInputs::ENABLE);
        self.sequence = self.sequence.wrapping_add(1);
        SensorFrame {
            tick: self.sequence,
            sequence: self.sequence,
            joints,
            normal_force,
            tangential_force,
            inputs,
        }
    }

    /// Checks readings and torques of the last frame, for those after it. Readings that have come since then are
    /// checked in place of the frame's.
    pub fn check(&mut self) {
        self.checks
            .tick(&self.readings, self.torques, self.is_active);
    }

    /// Permits arming once the button has been pressed for long enough: a deliberate act of an operator who has
    /// opened ENABLE. A press permits once: a line that is stuck high does not permit again.
    fn note_button(&mut self, is_pressed: bool, is_enabled: bool) {
        if !is_pressed {
            self.pressed_ticks = 0;
            return;
        }
        self.pressed_ticks = match is_enabled {
            true => u32::MAX,
            false => self.pressed_ticks.saturating_add(1),
        };
        let settings = self.settings.as_ref();
        let limit = settings.and_then(|it| it.button_ticks);
        if limit == Some(self.pressed_ticks) {
            self.permit_arming(true);
        }
    }
}

/// Removes the readings that the second sensor does not confirm. `reversed` are the directions of the first and of
/// the second sensors.
fn confirm<T>(
    channels: &mut [SecondChannel; 2],
    readings: &mut [Option<T>; 2],
    pairs: [[Result<i32, ReadError>; 2]; 2],
    [first_reversed, second_reversed]: [[bool; 2]; 2],
    tolerance: Tolerance,
    drives: bool,
) {
    let reversed = first_reversed.iter().zip(&second_reversed);
    let readings = readings.iter_mut().zip(reversed);
    for ((channel, pair), (reading, (first, second))) in
        channels.iter_mut().zip(pairs).zip(readings)
    {
        let [one, other] = pair;
        // Only the directions against each other matter.
        let other = if first == second {
            other
        } else {
            other.map(i32::wrapping_neg)
        };
        if !channel.confirms([one, other], tolerance, drives) {
            *reading = None;
        }
    }
}
