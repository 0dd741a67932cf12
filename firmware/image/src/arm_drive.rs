//! The control task's part of a board that drives an arm: its own sensors, switches and torque stages.
//!
//! The sensors' buses are read by interrupts, for the next tick: readings are one tick old, which is the delay
//! from sample to torque that scenarios simulate (`converters.torque.delay_ticks`).
//!
//! The torque stages are on only with the real plant: with frames from the host they stay off.

use cortex_m::peripheral::DWT;
use embedded_hal::digital::OutputPin;
use painleve_drivers::encoders::EncoderDriver;
use painleve_drivers::force_cell::ForceCellDriver;
use painleve_drivers::front_end::{FrontEnd, FrontEndSettings, InputLevels};
use painleve_drivers::stages::StageScale;
use painleve_firmware::Configuration;
use painleve_firmware::drive::Drive;
use painleve_firmware::law::Law;
use painleve_shared::Arm;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::{FrameSource, RefusedRate};
use painleve_shared::status::SupervisorState;

use crate::board::BoardDrive;
use crate::probe::SpareBits;
use crate::sensor_bus::{self, SensorBus, SpiWords};

/// Control rate while there is no configuration, Hz. The control timer runs from the start, so that only
/// finished control ticks feed the watchdogs.
const IDLE_HZ: f32 = 1000.0;

/// Time for which RESET has to be pressed to permit arming without a host, s.
const BUTTON_S: f32 = 1.0;

/// The registers and pins of a board that drives an arm.
pub trait ArmPins {
    /// SPI of the encoders.
    type EncoderSpi: SpiWords;
    /// SPI of the force cell.
    type ForceSpi: SpiWords;
    /// A pin that selects a sensor, low.
    type Select: OutputPin;

    /// Bits that a host may change while nothing is driven.
    const SPARE: &'static [SpareBits];

    /// Checks that the watchdogs have a limit for this rate, one within two periods if the torque depends on it.
    ///
    /// # Errors
    /// The rate, and the nearest ones that have a limit.
    fn check_rate(&self, tick_hz: f32, drives: bool) -> Result<(), RefusedRate>;

    /// Sets the rate of the control timer's interrupt and the watchdogs' limits.
    fn start_timer(&mut self, tick_hz: f32);

    /// Clears the control timer's interrupt and feeds the watchdogs.
    fn begin_tick(&mut self);

    /// Returns whether the control timer's interrupt has occurred again.
    fn next_tick_is_due(&self) -> bool;

    /// Returns the levels of the input pins.
    fn levels(&self) -> InputLevels;

    /// Enables the torque stages, with these codes of the converter.
    fn switch_stages_on(&mut self, codes: [u16; 2]);

    /// Disables the torque stages; the converter puts out zero torque.
    fn switch_stages_off(&mut self);

    /// Returns the count of a free-running counter: that of the processor's cycles, which must run.
    fn stopwatch(&self) -> u32 {
        DWT::cycle_count()
    }

    /// Returns the frequency of the stopwatch, Hz.
    fn stopwatch_hz(&self) -> u32;
}

/// The control task's part of a board.
pub struct ArmDrive<P: ArmPins> {
    pins: P,
    encoders: SensorBus<P::EncoderSpi, P::Select, EncoderDriver, 4>,
    force_cell: SensorBus<P::ForceSpi, P::Select, ForceCellDriver, 2>,
    front_end: FrontEnd,
    /// Scale of the torque stages; `None` until there is a configuration.
    stages: Option<StageScale>,
    source: FrameSource,
    /// Whether frames from this source drive the arm.
    is_driven: bool,
    /// Newest frame from the host, if the host is the source of frames.
    from_host: Option<SensorFrame>,
}

impl<P: ArmPins> ArmDrive<P> {
    /// Starts the control timer.
    pub fn new(
        mut pins: P,
        encoders: SensorBus<P::EncoderSpi, P::Select, EncoderDriver, 4>,
        force_cell: SensorBus<P::ForceSpi, P::Select, ForceCellDriver, 2>,
    ) -> Self {
        pins.start_timer(IDLE_HZ);
        Self {
            pins,
            encoders,
            force_cell,
            front_end: FrontEnd::new(None),
            stages: None,
            source: FrameSource::Lockstep,
            is_driven: false,
            from_host: None,
        }
    }

    /// Waits for the next tick, which the host's frame asks for; its frames never drive the stages.
    // Out of line: the bound on a tick's cycles leaves it out.
    #[cold]
    #[inline(never)]
    fn prolong_tick(&self) {
        while !self.pins.next_tick_is_due() {}
    }

    /// Returns the readings that were started at the last tick, and starts the next.
    fn read_sensors(&mut self) -> SensorFrame {
        let levels = self.pins.levels();
        // The parts' set-up times pass while the frame is assembled.
        let selected = sensor_bus::select_both(&mut self.encoders, &mut self.force_cell);
        let frame = self.front_end.frame(levels);
        sensor_bus::send_both(&mut self.encoders, &mut self.force_cell, &selected);
        frame
    }
}

impl<P: ArmPins> Drive for ArmDrive<P> {
    fn begin_tick(&mut self) {
        // The previous tick is finished, and this one is not too early.
        self.pins.begin_tick();
    }

    fn next_tick_is_due(&self) -> bool {
        self.pins.next_tick_is_due()
    }

    fn sample(&mut self) -> Option<SensorFrame> {
        match self.source {
            FrameSource::Lockstep | FrameSource::Realtime => {
                let frame = self.from_host.take();
                if frame.is_some_and(|it| it.inputs.contains(DigitalInputs::OVERLOAD)) {
                    self.prolong_tick();
                }
                frame
            }
            _ => Some(self.read_sensors()),
        }
    }

    fn actuate(&mut self, answer: &ActuatorFrame) {
        let is_active = answer
            .supervisor_state()
            .is_some_and(SupervisorState::drives);
        let is_on = is_active && self.is_driven && self.front_end.is_fit();
        let torques = if is_on {
            answer.torques
        } else {
            [TorqueCounts(0); 2]
        };
        self.front_end.note_output(is_active, torques);
        if let Some(stages) = self.stages.filter(|_| is_on) {
            self.pins.switch_stages_on(stages.codes(torques));
        } else {
            self.pins.switch_stages_off();
        }
    }

    fn end_tick(&mut self) {
        self.front_end.check();
    }

    fn stopwatch(&self) -> u32 {
        self.pins.stopwatch()
    }
}

impl<P: ArmPins> BoardDrive for ArmDrive<P> {
    const SPARE: &'static [SpareBits] = P::SPARE;

    fn check_rate(&self, tick_hz: f32, source: FrameSource) -> Result<(), RefusedRate> {
        // With frames from the host the stages stay off.
        self.pins.check_rate(tick_hz, source.is_on_board())
    }

    fn start<L: Law>(&mut self, configuration: &Configuration<L>, source: FrameSource) {
        let converters = &configuration.converters;
        self.stages = Some(StageScale::new(
            &converters.torque,
            &converters.stages,
            &converters.mounting,
        ));
        self.source = source;
        self.is_driven = source.drives();
        self.from_host = None;
        // The switch has to be opened and closed again, and the sensors are checked anew.
        let is_mounted = source != FrameSource::Commissioning;
        let arm = Arm::new(configuration.arm).ok().filter(|_| is_mounted);
        self.front_end.restart(FrontEndSettings {
            encoders: converters.encoders,
            force: converters.force,
            torque: converters.torque,
            stages: converters.stages,
            winding: converters.winding,
            mounting: converters.mounting,
            tick_hz: configuration.tick_hz,
            arm,
            button_ticks: (source == FrameSource::StandAlone)
                .then_some((BUTTON_S * configuration.tick_hz) as u32),
        });
        let parts = converters.mounting.sensors;
        self.encoders.driver_mut().read_parts(parts);
        self.force_cell.driver_mut().read_parts(parts);
        self.encoders.restart();
        self.force_cell.restart();
        self.pins.start_timer(configuration.tick_hz);
    }

    fn idle(&mut self) {
        self.pins.start_timer(IDLE_HZ);
    }

    fn offer(&mut self, frame: SensorFrame) {
        self.from_host = Some(frame);
    }

    fn permit_arming(&mut self, permitted: bool) -> bool {
        let is_permitted = permitted && self.source.is_on_board();
        self.front_end.permit_arming(is_permitted);
        is_permitted
    }

    // In line: each interrupt contains its own bus only.
    #[inline(always)]
    fn serve_sensor_bus(&mut self, bus: usize) {
        if bus == 0 {
            if let Some(encoders) = self.encoders.serve() {
                self.front_end.take_encoders(encoders);
                self.encoders.prepare();
            }
        } else if let Some(force_cell) = self.force_cell.serve() {
            self.front_end.take_forces(force_cell);
            self.force_cell.prepare();
        }
    }

    fn stopwatch_hz(&self) -> u32 {
        self.pins.stopwatch_hz()
    }
}
