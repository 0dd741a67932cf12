//! The plant with its converters, tick by tick: sample, command, sample, …
//!
//! Up to three things happen from one tick to the next: the torque changes (a fraction of a tick
//! after the tick), the encoders capture (a fraction of a tick before the next one), and the next
//! tick begins.

use nalgebra::Vector2;
use painleve_shared::frame::{DigitalInputs, SensorFrame};
use painleve_shared::kinematics::Pose;
use painleve_shared::range::OutOfRange;
use painleve_shared::settings::Settings;
use painleve_shared::{ActuatorFrame, Arm, GeneralisedTorque, JointTorque};

use crate::converters::encoder::Encoders;
use crate::converters::force_cell::ForceCell;
use crate::converters::link_loss::{LossyLink, Lost};
use crate::converters::torque_stage::TorqueStages;
use crate::mechanics::BuiltInPlant;
use crate::mechanics::belt::BeltSettings;
use crate::plant::{Plant, PlantError, Probe};
use crate::sample::{Sample, reference_tip_t_m};
use crate::scenario::Scenario;
use crate::tick_clock::TickClock;

/// A plant with its converters at a control rate.
#[derive(Clone, Debug)]
pub struct Simulation<P = BuiltInPlant> {
    plant: P,
    encoders: Encoders,
    force_cell: ForceCell,
    torque_stages: TorqueStages,
    link: LossyLink,
    lost: Lost,
    clock: TickClock,
    first_tick: u32,
    enable_at_s: f64,
    arm: Arm<f64>,
    push: Push,
    command_nm: JointTorque<f64>,
}

/// A force on the tip for a number of ticks.
#[derive(Clone, Copy, Debug, Default)]
struct Push {
    force_n: Vector2<f64>,
    ticks: u32,
}

impl Simulation {
    /// Creates the scenario's own plant and converters at their start.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        scenario.validate()?;
        Self::of(BuiltInPlant::new(scenario)?, scenario)
    }
}

/// Why a frame is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// It is to another tick.
    #[error("the answer is for tick {tick}, but tick {sampled} has been sampled")]
    OtherTick {
        /// Its tick.
        tick: u32,
        /// The tick that has been sampled.
        sampled: u32,
    },
    /// Its state or its fault is unknown.
    #[error("the answer has state {state} and fault {fault}, at least one of which is unknown")]
    NotUnderstood {
        /// Number of the state.
        state: u8,
        /// Number of the fault.
        fault: u8,
    },
}

impl Simulation {
    /// Gives the belt this friction and speed from now on.
    pub fn set_belt(&mut self, belt: &BeltSettings) {
        self.plant.set_belt(belt);
    }
}

impl<P: Plant> Simulation<P> {
    /// Creates a simulation of any plant at its start, with the scenario's converters.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn of(plant: P, scenario: &Scenario) -> Result<Self, OutOfRange> {
        scenario.validate()?;
        let converters = &scenario.converters;
        let seed = scenario.run.seed;
        let tick_hz = f64::from(scenario.run.tick_hz);
        let (faults, tick_s) = (&converters.faults, 1.0 / tick_hz);
        Ok(Self {
            encoders: Encoders::new(
                &converters.encoder,
                faults,
                tick_s,
                seed,
                &plant.link_angles_rad(),
            ),
            force_cell: ForceCell::new(&converters.force, faults, tick_s, seed),
            torque_stages: TorqueStages::new(&converters.torque, faults, tick_s, seed),
            link: LossyLink::new(&converters.link, seed),
            lost: Lost::default(),
            clock: TickClock::new(tick_hz, scenario.run.tick_jitter, seed),
            first_tick: scenario.run.first_tick,
            enable_at_s: scenario.run.enable_at_s,
            arm: Arm::new(scenario.arm)?,
            push: Push::default(),
            command_nm: JointTorque::zeros(),
            plant,
        })
    }

    /// Pushes the tip with a force (f_t, f_n), N, for a number of ticks. It enters as the joint
    /// torques that have the same effect, Jᵀ f, and is part of the torques that are recorded.
    pub fn push(&mut self, force_n: [f64; 2], ticks: u32) {
        self.push = Push {
            force_n: force_n.into(),
            ticks,
        };
    }

    /// Returns the torques of the push at this tick, N·m, if there is one.
    fn take_push_nm(&mut self) -> Option<JointTorque<f64>> {
        self.push.ticks = self.push.ticks.checked_sub(1)?;
        let pose = Pose::new(&self.plant.link_angles_rad());
        let torque_nm = self.arm.jacobian(&pose).transpose() * self.push.force_n;
        Some(GeneralisedTorque::from_vector(torque_nm).to_joints())
    }

    /// Returns the torques that the last tick has commanded, with those of a push, before the lag of the stages, N·m.
    pub fn command_nm(&self) -> JointTorque<f64> {
        self.command_nm
    }

    /// Returns the plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// Returns the control rate, Hz.
    pub fn tick_hz(&self) -> f64 {
        self.clock.tick_hz()
    }

    /// Returns the time at which ENABLE rises, s.
    pub fn enable_at_s(&self) -> f64 {
        self.enable_at_s
    }

    /// Returns the number of ticks since the start.
    pub fn ticks(&self) -> u64 {
        self.clock.tick()
    }

    /// Returns the frame for the controller at this tick. Call it once per tick, because it draws
    /// noise.
    ///
    /// # Errors
    /// [`PlantError`] if the contact mode of the start cannot be decided.
    pub fn sample(&mut self, probe: &mut dyn Probe) -> Result<SensorFrame, PlantError> {
        self.plant.advance(self.plant.time_s(), probe)?;
        self.lost = self.link.draw();
        let time_s = self.plant.time_s();
        let force_n = self.plant.contact_force_n();
        let force = self.force_cell.read(&force_n, time_s);
        let enabled = time_s >= self.enable_at_s;
        let tick = self.frame_tick();
        Ok(SensorFrame {
            tick,
            sequence: tick,
            joints: self.encoders.readings(time_s),
            normal_force: force.normal,
            tangential_force: force.tangential,
            inputs: if enabled {
                DigitalInputs::ENABLE
            } else {
                DigitalInputs::default()
            },
        })
    }

    /// Returns the number of this tick in its frames, where it wraps.
    fn frame_tick(&self) -> u32 {
        self.first_tick.wrapping_add(self.clock.tick() as u32)
    }

    /// Checks that an answer is one to this tick.
    ///
    /// # Errors
    /// [`AnswerError`] if it is to another tick, or not understood.
    pub fn check_answer(&self, answer: &ActuatorFrame) -> Result<(), AnswerError> {
        let (tick, sampled) = (answer.tick, self.frame_tick());
        let &ActuatorFrame { state, fault, .. } = answer;
        if tick != sampled {
            return Err(AnswerError::OtherTick { tick, sampled });
        }
        if !answer.is_understood() {
            return Err(AnswerError::NotUnderstood { state, fault });
        }
        Ok(())
    }

    /// Returns whether the watchdog of the torque stages has removed the torque.
    pub fn drive_watchdog_has_tripped(&self) -> bool {
        self.torque_stages.has_tripped()
    }

    /// Returns whether the frame of this tick's sample is lost; the controller must not receive it.
    pub fn sensor_frame_is_lost(&self) -> bool {
        self.lost.sensor
    }

    /// Returns whether the answer to this tick's sample is lost.
    pub fn actuator_frame_is_lost(&self) -> bool {
        self.lost.actuator
    }

    /// Returns the complete data of this tick, for records. `answered` stays false: only the caller knows it.
    pub fn describe(&self, sensor: &SensorFrame, actuator: &ActuatorFrame) -> Sample {
        Sample {
            plant: self.plant.snapshot(),
            sensor: *sensor,
            actuator: *actuator,
            reference_tip_t_m: reference_tip_t_m(actuator),
            delivered: !self.lost.sensor,
            answered: false,
        }
    }

    /// Accepts the controller's answer to this tick's sample, if there is one and it is not lost,
    /// and advances to the next tick.
    ///
    /// # Errors
    /// [`PlantError`] if the plant cannot continue.
    pub fn advance(
        &mut self,
        answer: Option<&ActuatorFrame>,
        probe: &mut dyn Probe,
    ) -> Result<(), PlantError> {
        let arrived = answer.filter(|_| !self.lost.actuator);
        let torques = arrived.map(|frame| frame.torques);
        self.torque_stages.command(torques, self.plant.time_s());
        let change_s = self.clock.after_s(self.torque_stages.change_after_tick());
        let capture_s = self
            .clock
            .before_next_s(self.encoders.capture_before_tick());

        let captures_first = capture_s < change_s;
        if captures_first {
            self.plant.advance(capture_s, probe)?;
            self.encoders.capture(&self.plant.link_angles_rad());
        }
        if self.torque_stages.change_after_tick() > 0.0 {
            self.plant.advance(change_s, probe)?;
        }
        let joints_rad = self.plant.link_angles_rad().to_joints();
        let mut torque_nm = self
            .torque_stages
            .target_nm(&joints_rad, self.plant.time_s());
        if let Some(push_nm) = self.take_push_nm() {
            torque_nm += push_nm;
        }
        self.command_nm = torque_nm;
        self.plant
            .command_torque(torque_nm, self.torque_stages.lag_s());
        if !captures_first {
            self.plant.advance(capture_s, probe)?;
            self.encoders.capture(&self.plant.link_angles_rad());
        }
        let next_s = self.clock.before_next_s(0.0);
        self.clock.advance();
        self.plant.advance(next_s, probe)
    }
}
