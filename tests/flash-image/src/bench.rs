//! The board with the simulated arm on its sensors and torque stages.

use painleve_chips::BridgeAmplifier;
use painleve_plant::Plant;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::LinkMotion;
use painleve_shared::counts::{EncoderScale, ForceCounts, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{FrameSource, Request, Response};
use painleve_shared::mounting::{Mounting, SensorParts};

use crate::board::{BoardChip, BoardSnapshot, EmulatedBoard, F405, G474};
use painleve_chips::stm32::Pin;
use painleve_chips::{MICROSECOND, MILLISECOND, Picoseconds};

/// Ticks before the switch is closed.
const BEFORE_ENABLE: u32 = 100;

/// Angle by which the second encoders are turned on their shafts, counts.
const SECOND_ENCODER_OFFSET: u16 = 9000;

/// Readings of f_t and f_n of the second force cell without a load, counts.
const SECOND_FORCE_TARE: [i32; 2] = [31, -44];

/// Turn of a link in a tick in which an operator carries the arm, rad.
const CARRIED_RAD: f64 = 2e-3;

/// Ticks between two alive messages of the host.
const ALIVE_TICKS: u32 = 50;

/// The board with the STM32F405 and its arm.
pub type BoardBench = Bench<F405>;

/// The board NUCLEO-G474RE and its arm.
pub type NucleoBench = Bench<G474>;

/// A board that controls a simulated arm with its own sensors.
pub struct Bench<C: BoardChip> {
    /// The board.
    pub board: EmulatedBoard<C>,
    /// The arm.
    pub simulation: Simulation,
    statistics: Statistics,
    /// Newest frame of the simulated sensors.
    pub frame: SensorFrame,
    period: Picoseconds,
    ticks: u32,
    /// Whether the host sends alive messages.
    pub host_is_there: bool,
    waits: u32,
    /// Whether [`Bench::tick`] closes the switch of the safety chain after a while.
    pub closes_switch: bool,
    /// How the parts are mounted on the arm.
    pub mounted: Mounting,
    /// Torque at each joint by the converter's code, divided by that of a board without gears.
    pub gear: [f64; 2],
    /// Turns of the encoders on their shafts, counts.
    pub encoder_offset: [u16; 2],
    /// Encoders that repeat their last angle.
    pub is_frozen: [bool; 2],
    /// Second encoders that repeat their last angle.
    pub second_is_frozen: [bool; 2],
    /// Readings of f_t and f_n beyond its tare at which the force cell is stuck, counts.
    pub force_is_stuck_at: Option<[i32; 2]>,
    /// The same of the second force cell.
    pub second_force_is_stuck_at: Option<[i32; 2]>,
    /// Whether the second sensors have the same zeros as the first ones.
    pub second_is_aligned: bool,
    /// The arm is held until it is first driven.
    is_held: bool,
    /// Link angles at which an operator holds the arm, rad.
    held_rad: Option<LinkMotion<f64>>,
    /// The arm where an operator is carrying it.
    carried_to: Option<Box<Simulation>>,
}

/// State of a bench at one instant.
pub struct BenchSnapshot<C = F405> {
    board: BoardSnapshot<C>,
    simulation: Simulation,
    frame: SensorFrame,
}

/// Loads a built-in scenario.
///
/// # Panics
/// If there is no scenario of this name.
pub fn scenario(name: &str) -> Scenario {
    Scenario::load(name, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// Loads a built-in scenario for an arm with one sensor on each channel.
///
/// # Panics
/// If there is no scenario of this name.
pub fn with_one_sensor(name: &str) -> Scenario {
    let mut scenario = scenario(name);
    scenario.converters.mounting.sensors = SensorParts::First;
    scenario
}

/// Simulates the arm of a board, which itself takes one tick from the sample to the torque.
///
/// # Panics
/// If the scenario is out of range.
fn simulated(scenario: &Scenario) -> Simulation {
    let mut simulated = scenario.clone();
    simulated.converters.torque.delay_ticks = 0.0;
    Simulation::new(&simulated).unwrap_or_else(|error| panic!("{error}"))
}

/// Encodes a scenario's configuration for the board.
///
/// # Panics
/// If it cannot be encoded.
pub fn encoded(scenario: &Scenario) -> Vec<u8> {
    postcard::to_stdvec(&scenario.controller_configuration())
        .unwrap_or_else(|error| panic!("{error}"))
}

impl<C: BoardChip> Bench<C> {
    /// Creates a bench with a board that is booted and configured for the arm on its own sensors,
    /// but not enabled.
    pub fn new(scenario: &Scenario) -> Self {
        Self::with_board(scenario, EmulatedBoard::booted())
    }

    /// Creates a bench with a board that has booted.
    ///
    /// # Panics
    /// If the scenario is out of range, or the image rejects it.
    pub fn with_board(scenario: &Scenario, board: EmulatedBoard<C>) -> Self {
        let mut bench = Self::without_configuration(scenario, board);
        bench.host_is_there = true;
        let response = bench
            .board
            .configure(FrameSource::Sensors, &encoded(scenario));
        assert!(
            matches!(response, Some(Response::Ready { .. })),
            "{response:?}"
        );
        assert!(bench.board.permit_arming());
        bench
    }

    /// The arm on a board that waits for its host.
    ///
    /// # Panics
    /// If the scenario is out of range.
    pub fn without_configuration(scenario: &Scenario, board: EmulatedBoard<C>) -> Self {
        let mut bench = Self {
            board,
            simulation: simulated(scenario),
            statistics: Statistics::new(0.05),
            frame: SensorFrame::default(),
            period: 1_000_000 * MICROSECOND / u64::from(scenario.run.tick_hz),
            ticks: 0,
            host_is_there: false,
            waits: 0,
            closes_switch: true,
            mounted: Mounting::default(),
            gear: [1.0; 2],
            encoder_offset: [0; 2],
            is_frozen: [false; 2],
            second_is_frozen: [false; 2],
            force_is_stuck_at: None,
            second_force_is_stuck_at: None,
            second_is_aligned: false,
            is_held: true,
            held_rad: None,
            carried_to: None,
        };
        bench.present();
        bench
    }

    /// Gives the parts the state of the simulated arm, as they are mounted.
    pub fn present(&mut self) {
        let frame = self.simulation.sample(&mut self.statistics);
        self.show(frame.unwrap_or_else(|error| panic!("{error}")));
    }

    /// Gives the parts the readings of a frame, as they are mounted, or those of an arm that an operator holds.
    pub fn show(&mut self, frame: SensorFrame) {
        self.frame = frame;
        if let Some(held_rad) = self.held_rad {
            let angles = held_rad.to_joints().to_array();
            self.frame.joints = angles.map(|it| EncoderScale::default().reading(it));
            self.frame.normal_force = ForceCounts(0);
            self.frame.tangential_force = ForceCounts(0);
        }
        let mounted = self.mounted;
        let joints = self.frame.joints.map(|it| it.0 as u16);
        let turned = |joint: usize, is_reversed: [bool; 2]| {
            if is_reversed[joint] {
                joints[joint].wrapping_neg()
            } else {
                joints[joint]
            }
        };
        let (second_offset, second_tare) = if self.second_is_aligned {
            (0, [0; 2])
        } else {
            (SECOND_ENCODER_OFFSET, SECOND_FORCE_TARE)
        };
        let wiring = self.board.wiring();
        for joint in 0..2 {
            if !self.is_frozen[joint] {
                let angle = turned(joint, mounted.encoder_reversed);
                wiring.encoders[joint].angle =
                    angle.wrapping_add(self.encoder_offset[joint]) & 0x3fff;
            }
            if !self.second_is_frozen[joint] {
                let angle = turned(joint, mounted.second_encoder_reversed);
                wiring.second_encoders[joint].angle = angle.wrapping_add(second_offset) & 0x3fff;
            }
        }
        let forces = [self.frame.tangential_force.0, self.frame.normal_force.0];
        let signed = |axis: usize, is_reversed: [bool; 2]| {
            forces[axis] * if is_reversed[axis] { -1 } else { 1 }
        };
        let channels = |[tangential, normal]: [i32; 2], bridges: [BridgeAmplifier; 2]| {
            let [of_normal, of_tangential] = bridges;
            let [n_plus, n_minus] = of_normal.channels(normal);
            let [t_plus, t_minus] = of_tangential.channels(tangential);
            [n_plus, n_minus, t_plus, t_minus, 0, 0, 0, 0]
        };
        let first = [0, 1].map(|axis| {
            let present = signed(axis, mounted.force_reversed);
            let net = self.force_is_stuck_at.map_or(present, |it| it[axis]);
            net + mounted.force_tare[axis].0
        });
        let second = [0, 1].map(|axis| {
            let present = signed(axis, mounted.second_force_reversed);
            let net = self.second_force_is_stuck_at.map_or(present, |it| it[axis]);
            net + second_tare[axis]
        });
        wiring.force.channels = channels(first, wiring.bridges);
        wiring.second_force.channels = channels(second, [BridgeAmplifier::default(); 2]);
    }

    /// An operator holds the arm in the air with its links at these angles from the plumb line, degrees.
    pub fn hold(&mut self, plumb_deg: [f64; 2]) {
        let [one, two] = plumb_deg.map(f64::to_radians);
        self.held_rad = Some(LinkMotion::new(one, two));
        self.present();
    }

    /// An operator sets the tip on the belt of this scenario at its start, and lets go.
    ///
    /// # Panics
    /// If the scenario is out of range.
    pub fn set_down(&mut self, scenario: &Scenario) {
        self.simulation = simulated(scenario);
        self.held_rad = None;
        self.is_held = false;
        self.present();
    }

    /// An operator carries the arm to the start of this scenario, as fast as a hand does, and holds it there until it is driven.
    ///
    /// # Panics
    /// If the scenario is out of range.
    pub fn carry(&mut self, scenario: &Scenario) {
        let here_rad = self.simulation.plant().snapshot().theta_rad;
        self.held_rad = self.held_rad.or(Some(here_rad));
        self.carried_to = Some(Box::new(simulated(scenario)));
        self.is_held = true;
    }

    /// Moves an arm that is carried on by one tick.
    fn carry_on(&mut self, there: Box<Simulation>) {
        let there_rad = there.plant().snapshot().theta_rad;
        let here_rad = self.held_rad.unwrap_or(there_rad);
        let step_rad = (there_rad - here_rad).map(|rad| rad.clamp(-CARRIED_RAD, CARRIED_RAD));
        if step_rad.amax() > 0.0 {
            self.held_rad = Some(here_rad + step_rad);
            self.carried_to = Some(there);
        } else {
            self.held_rad = None;
            self.simulation = *there;
        }
        self.present();
    }

    /// Returns whether an operator is carrying the arm.
    pub fn is_carried(&self) -> bool {
        self.carried_to.is_some()
    }

    /// Runs one control tick of the image. Closes the switch after a while; holds the arm until it
    /// is first driven.
    pub fn tick(&mut self) {
        self.wait_for_tick();
        self.ticks += 1;
        if self.ticks == BEFORE_ENABLE && self.closes_switch {
            self.board.enable(true);
        }
        if let Some(there) = self.carried_to.take() {
            return self.carry_on(there);
        }
        self.is_held &= self.board.torque().enabled != Some(true);
        if self.is_held || self.held_rad.is_some() {
            return;
        }
        let torque = self.board.torque();
        let counts = if torque.enabled == Some(true) {
            let most = (1 << 11) - 1;
            [0, 1].map(|joint| {
                let geared = f64::from(torque.counts[joint]) * self.gear[joint];
                let counts = (geared.round() as i32).clamp(-most - 1, most);
                if self.mounted.stage_reversed[joint] {
                    -counts
                } else {
                    counts
                }
            })
        } else {
            [0; 2]
        };
        let answer = ActuatorFrame {
            torques: counts.map(TorqueCounts),
            ..ActuatorFrame::default()
        };
        self.simulation
            .advance(Some(&answer), &mut self.statistics)
            .unwrap_or_else(|error| panic!("{error}"));
        self.present();
    }

    /// Waits for the next tick and returns the number of the last tick that the image has answered.
    pub fn ticks_answered(&mut self) -> u32 {
        self.wait_for_tick();
        // Long enough for the answer on the line.
        self.board.machine.run_for(self.period / 5 * 2);
        let mut answered = 0;
        while let Some(response) = self.board.response(0) {
            if let Response::Tick { answer, .. } = response {
                answered = answer.tick;
            }
        }
        answered
    }

    /// Returns whether [`BoardBench::tick`] has closed the switch of the safety chain.
    pub fn switch_is_closed(&self) -> bool {
        self.ticks >= BEFORE_ENABLE
    }

    /// Runs until half a period after the next interrupt of the control timer, or for two periods.
    /// The host sends alive messages meanwhile.
    pub fn wait_for_tick(&mut self) {
        self.waits += 1;
        if self.host_is_there && self.waits.is_multiple_of(ALIVE_TICKS) {
            self.board.send(&Request::Alive);
        }
        let machine = &mut self.board.machine;
        let latest = machine.now() + 2 * self.period;
        let next = machine.chip().next_tick().min(latest);
        machine.run_for(next + self.period / 2 - machine.now());
    }

    /// Runs ticks until the arm is driven with a non-zero torque.
    ///
    /// # Panics
    /// If that does not happen within 200 ticks.
    pub fn drive(&mut self) {
        for _ in 0..2 * BEFORE_ENABLE {
            self.tick();
            let torque = self.board.torque();
            if torque.enabled == Some(true) && torque.counts != [0; 2] {
                for _ in 0..20 {
                    self.tick();
                }
                return;
            }
        }
        panic!("the arm is not driven: {:?}", self.board.torque());
    }

    /// Returns the time until the torque is off; `None` if it is still on at the end of the second
    /// tick from now.
    pub fn time_until_off(&mut self) -> Option<Picoseconds> {
        let start = self.board.machine.now();
        let next = self.board.machine.chip().next_tick();
        let limit = next.min(start + self.period) + self.period + self.period / 2;
        while !self.board.torque().is_off() {
            if self.board.machine.now() >= limit {
                return None;
            }
            self.board.machine.run_for(10 * MICROSECOND);
        }
        Some(self.board.machine.now() - start)
    }

    /// Returns whether the torque stays off for this number of ticks.
    pub fn stays_off(&mut self, ticks: u32) -> bool {
        (0..ticks).all(|_| {
            self.wait_for_tick();
            self.board.torque().is_off()
        })
    }

    /// Checks that the torque stays off for this number of ticks.
    ///
    /// # Panics
    /// If it does not.
    pub fn assert_stays_off(&mut self, ticks: u32) {
        assert!(self.stays_off(ticks), "{:?}", self.board.torque());
    }

    /// Returns the complete state.
    pub fn snapshot(&self) -> BenchSnapshot<C> {
        BenchSnapshot {
            board: self.board.snapshot(),
            simulation: self.simulation.clone(),
            frame: self.frame,
        }
    }

    /// Restores a snapshot.
    pub fn restore(&mut self, snapshot: &BenchSnapshot<C>) {
        self.board.restore(&snapshot.board);
        self.simulation = snapshot.simulation.clone();
        self.frame = snapshot.frame;
    }

    /// Drives a pin from outside.
    pub fn drive_pin(&mut self, pin: Pin, level: Option<bool>) {
        self.board.machine.chip_mut().drive_pin(pin, level);
    }

    /// Runs for this many milliseconds while the arm stays fixed.
    pub fn run_ms(&mut self, milliseconds: u64) {
        self.board.machine.run_for(milliseconds * MILLISECOND);
    }
}
