//! Driver in the loop: the board's sensor drivers on this PC, over models of the sensors' chips.
//!
//! The counts of the simulated converters are loaded into the chip models and read back, bit by
//! bit, through the drivers that run on the board. Without bit errors the controller receives the
//! same counts as natively and gives the same answers.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Instant;

use painleve_chips::wires::{Clock, ModelledBus, SelectPin, SharedPart};
use painleve_chips::{As5048a, BitErrors, BridgeAmplifier, Mcp3304};
use painleve_drivers::encoders::{self, EncoderDriver};
use painleve_drivers::exchange::PolledDriver;
use painleve_drivers::force_cell::{self, ForceCellDriver};
use painleve_firmware::supervise::lapses::Lapse;
use painleve_plant::{Configuration, Controller};
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::Health;
use painleve_shared::mounting::Mounting;

use super::{BoardError, ConnectedBoard, TimedAnswer};
use crate::timing::Unit;

/// Clocks of the board's buses, Hz.
const ENCODER_BUS_HZ: u64 = 5_250_000;
const FORCE_BUS_HZ: u64 = 1_312_500;

/// A driver over a modelled bus with `N` parts.
type Modelled<D, P, const N: usize> = PolledDriver<D, ModelledBus<P>, SelectPin<P>, Clock, N>;

/// The drivers, the chip models and the controller in this process.
pub struct Drivers {
    controller: Controller,
    encoders: Modelled<EncoderDriver, As5048a, 4>,
    force_cell: Modelled<ForceCellDriver, Mcp3304, 2>,
    /// First encoders of both joints, then the second ones.
    encoder_parts: [SharedPart<As5048a>; 4],
    force_parts: [SharedPart<Mcp3304>; 2],
    /// Bridge amplifiers of f_n and f_t, whose failures can be simulated.
    pub bridges: [BridgeAmplifier; 2],
    encoder_bits: u8,
    force_bits: u8,
    mounting: Mounting,
    ticks: u32,
}

/// Checks that a board's sensors resolve what the controller takes them to resolve.
///
/// # Errors
/// [`BoardError::Parts`] if they are coarser.
pub fn check_parts(configuration: &Configuration) -> Result<(), BoardError> {
    let [encoder, _] = configuration.converters.encoders;
    let force = configuration.converters.force;
    for (key, wanted, has) in [
        ("converters.encoder.bits", encoder.bits, encoders::BITS),
        ("converters.force.bits", force.bits, force_cell::BITS),
    ] {
        if wanted > has {
            return Err(BoardError::Parts { key, wanted, has });
        }
    }
    Ok(())
}

impl Drivers {
    /// Creates the drivers and a configured controller, with probability `bit_errors` of a flipped
    /// bit on every sensor line.
    ///
    /// # Errors
    /// [`BoardError::Parts`] if the scenario's converters have a higher resolution than the parts,
    /// and [`BoardError::Refused`] if the configuration is out of range.
    pub fn new(configuration: &Configuration, bit_errors: f64) -> Result<Self, BoardError> {
        check_parts(configuration)?;
        let [encoder, _] = configuration.converters.encoders;
        let force = configuration.converters.force;
        let mounting = configuration.converters.mounting;
        let clock = Clock::default();
        let mut encoder_bus = ModelledBus::new(&clock, ENCODER_BUS_HZ, true);
        let encoder_parts = [1, 2, 4, 5].map(|seed| {
            let mut part = As5048a::default();
            part.bit_errors = BitErrors::new(bit_errors, seed);
            Rc::new(RefCell::new(part))
        });
        let selects = encoder_parts
            .each_ref()
            .map(|part| encoder_bus.attach(part));
        let mut encoders = EncoderDriver::new();
        encoders.read_parts(mounting.sensors);
        let mut force_bus = ModelledBus::new(&clock, FORCE_BUS_HZ, false);
        let force_parts = [3, 6].map(|seed| {
            let mut part = Mcp3304::default();
            part.bit_errors = BitErrors::new(bit_errors, seed);
            Rc::new(RefCell::new(part))
        });
        let force_selects = force_parts.each_ref().map(|part| force_bus.attach(part));
        let mut force_cell = ForceCellDriver::new();
        force_cell.read_parts(mounting.sensors);
        Ok(Self {
            controller: Controller::new(configuration).map_err(|_| BoardError::Refused)?,
            encoders: PolledDriver::new(encoders, encoder_bus, selects, clock.clone()),
            force_cell: PolledDriver::new(force_cell, force_bus, force_selects, clock),
            encoder_parts,
            force_parts,
            bridges: Default::default(),
            encoder_bits: encoder.bits,
            force_bits: force.bits,
            mounting,
            ticks: 0,
        })
    }

    /// Returns the number of bits flipped on the sensor lines.
    fn bit_errors(&self) -> u64 {
        let encoders = self.encoder_parts.iter();
        let encoders: u64 = encoders.map(|it| it.borrow().bit_errors.count).sum();
        let converters = self.force_parts.iter();
        let converters: u64 = converters.map(|it| it.borrow().bit_errors.count).sum();
        encoders + converters
    }

    /// Loads the counts of the simulated converters into the chip models.
    fn present(&self, frame: &SensorFrame) {
        let up = encoders::BITS - self.encoder_bits;
        for (part, joint) in self.encoder_parts.iter().zip(frame.joints.iter().cycle()) {
            part.borrow_mut().angle = (joint.0 << up) as u16;
        }
        let up = force_cell::BITS - self.force_bits;
        let [normal, tangential] = self.bridges;
        let [n_plus, n_minus] = normal.channels(frame.normal_force.0 << up);
        let [t_plus, t_minus] = tangential.channels(frame.tangential_force.0 << up);
        for part in &self.force_parts {
            part.borrow_mut().channels = [n_plus, n_minus, t_plus, t_minus, 0, 0, 0, 0];
        }
    }

    /// Returns the frame as the drivers read it.
    fn read(&mut self, frame: &SensorFrame) -> SensorFrame {
        self.present(frame);
        let joints = self.encoders.read().readings(self.encoder_bits);
        let force = self
            .force_cell
            .read()
            .readings(self.force_bits, &self.mounting);
        SensorFrame {
            joints: joints.map(|it| it.unwrap_or(EncoderCounts::MISSING)),
            normal_force: force.normal.unwrap_or(ForceCounts::MISSING),
            tangential_force: force.tangential.unwrap_or(ForceCounts::MISSING),
            ..*frame
        }
    }
}

impl ConnectedBoard for Drivers {
    const HOST: &'static str = "drivers";

    fn unit(&self) -> Unit {
        Unit::Nanoseconds
    }

    fn exchange(&mut self, frame: &SensorFrame) -> Result<TimedAnswer, BoardError> {
        let start = Instant::now();
        let read = self.read(frame);
        let frame = self.controller.tick(&read);
        self.ticks = self.ticks.wrapping_add(1);
        let cost = u32::try_from(start.elapsed().as_nanos()).unwrap_or(u32::MAX);
        Ok(TimedAnswer { frame, cost })
    }

    fn health(&mut self) -> Result<Health, BoardError> {
        Ok(Health {
            ticks: self.ticks,
            lapses: self.controller.lapses().totals(),
            ..Health::default()
        })
    }

    fn remark(&self) -> Option<String> {
        let flipped = self.bit_errors();
        let lapses = self.controller.lapses().totals();
        let lost = lapses.of(Lapse::EncoderOutOfRange) + lapses.of(Lapse::ForceOutOfRange);
        (flipped > 0).then(|| {
            format!(
                "sensor lines: {flipped} bits flipped, {lost} of {} ticks without a reading",
                self.ticks
            )
        })
    }
}
