//! Injects random faults at random instructions.

use painleve_chips::stm32::Crystal;
use painleve_chips::{BitErrors, BridgeFailure, MICROSECOND};
use painleve_flash_image::bench::{Bench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, F405, G474, STAGES_READY};
use painleve_flash_image::harm::Harm;
use painleve_plant::law_choice::build;
use painleve_plant::scenario::Scenario;
use painleve_shared::message::{FrameSource, Request};
use painleve_shared::mounting::{Mounting, SensorParts};

/// Number of faults of the ignored tests.
const FAULTS: u32 = 1000;

const DEFAULT: &str = "hybrid-elbow-down";

/// How long the host may be silent, ticks.
const HOST_LIMIT_TICKS: u32 = 200;

/// Marsaglia's xorshift.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InjectedFault {
    BitErrors,
    SerialNoise,
    ResetPin,
    EnableGlitch,
    BadInstruction,
    UnexpectedInterrupt,
    StoreToProgram,
    StackOverflow,
    Hang,
    ControlTimer,
    Crystal,
    Supply,
    StageNotReady,
    HostSilent,
    RefusedConfiguration,
    EncoderDies,
    ForceCellDies,
    ForceAxisDies,
    ForceCellSticks,
    EncoderFreezes,
    SecondEncoderDies,
    SecondForceCellDies,
}

impl InjectedFault {
    /// Those of an arm with one sensor on each channel.
    const OF_ONE_SENSOR: &[Self] = &[
        Self::BitErrors,
        Self::SerialNoise,
        Self::ResetPin,
        Self::EnableGlitch,
        Self::BadInstruction,
        Self::UnexpectedInterrupt,
        Self::StoreToProgram,
        Self::StackOverflow,
        Self::Hang,
        Self::ControlTimer,
        Self::Crystal,
        Self::Supply,
        Self::StageNotReady,
        Self::HostSilent,
        Self::RefusedConfiguration,
        Self::EncoderDies,
        Self::ForceCellDies,
        Self::ForceAxisDies,
    ];

    /// With two sensors on each channel: those of the second ones, and those that only two show.
    const OF_SECOND_SENSORS: &[Self] = &[
        Self::ForceCellSticks,
        Self::EncoderFreezes,
        Self::SecondEncoderDies,
        Self::SecondForceCellDies,
    ];

    /// Returns whether the arm must continue.
    fn is_survived(self) -> bool {
        matches!(self, Self::BitErrors | Self::SerialNoise)
    }

    fn strike<C: BoardChip>(self, bench: &mut Bench<C>, random: &mut Random) {
        let board = &mut bench.board;
        match self {
            Self::BitErrors => {
                // Every line has its own.
                let mut errors = || BitErrors::new(1e-4, random.below(u64::MAX));
                let wiring = board.wiring();
                let encoders = &mut wiring.encoders;
                for encoder in encoders.iter_mut().chain(&mut wiring.second_encoders) {
                    encoder.bit_errors = errors();
                }
                wiring.force.bit_errors = errors();
                wiring.second_force.bit_errors = errors();
            }
            Self::SerialNoise => {
                let bytes: Vec<u8> = (0..random.below(60))
                    .map(|_| random.below(256) as u8)
                    .collect();
                board.send_bytes(&bytes);
            }
            Self::ResetPin => board.machine.chip_mut().reset_pin(),
            Self::EnableGlitch => {
                // Long enough for the switch to be sampled.
                board.enable(false);
                board.machine.run_for(1_100_000_000);
                board.enable(true);
            }
            Self::BadInstruction => drop(board.machine.execute_undefined()),
            Self::UnexpectedInterrupt => board.machine.raise_unexpected(),
            Self::StoreToProgram => {
                let program = board.machine.symbol("main").expect("a program") & !3;
                board.machine.store(program);
            }
            Self::StackOverflow => board.machine.recurse(),
            Self::Hang => board.machine.hang(),
            Self::ControlTimer => board.machine.chip_mut().stop_control_timer(),
            Self::Crystal => board.machine.chip_mut().set_crystal(Crystal::Stops),
            Self::Supply => {
                let millivolts = 1500 + random.below(1350) as u32;
                board.machine.chip_mut().set_supply(millivolts);
            }
            Self::StageNotReady => bench.drive_pin(STAGES_READY, Some(false)),
            Self::HostSilent => {
                // Its limit counts from now.
                board.send(&Request::Alive);
                bench.host_is_there = false;
            }
            Self::RefusedConfiguration => {
                let mut configuration = encoded(&scenario(DEFAULT));
                // The control rate is the first field of the configuration.
                configuration[..4].copy_from_slice(&f32::NAN.to_le_bytes());
                board.send(&Request::Configure {
                    build: build(),
                    source: FrameSource::Sensors,
                    configuration: &configuration,
                });
                while !board.machine.chip().usart().incoming.is_empty() {
                    board.machine.run_for(5 * MICROSECOND);
                }
            }
            Self::EncoderDies => {
                let encoder = random.below(2) as usize;
                let level = random.below(2) == 0;
                board.wiring().encoders[encoder].dead = Some(level);
            }
            Self::ForceCellDies => {
                let level = random.below(2) == 0;
                board.wiring().force.dead = Some(level);
            }
            Self::ForceAxisDies => {
                let failures = BridgeFailure::ALL;
                let failure = failures[random.below(failures.len() as u64) as usize];
                let axis = random.below(2) as usize;
                board.wiring().bridges[axis].failure = Some(failure);
                bench.present();
            }
            Self::ForceCellSticks => {
                // At the reading without a force.
                if random.below(2) == 0 {
                    bench.force_is_stuck_at = Some([0; 2]);
                } else {
                    bench.second_force_is_stuck_at = Some([0; 2]);
                }
                bench.present();
            }
            Self::EncoderFreezes => {
                let encoder = random.below(2) as usize;
                if random.below(2) == 0 {
                    bench.is_frozen[encoder] = true;
                } else {
                    bench.second_is_frozen[encoder] = true;
                }
            }
            Self::SecondEncoderDies => {
                let encoder = random.below(2) as usize;
                let level = random.below(2) == 0;
                board.wiring().second_encoders[encoder].dead = Some(level);
            }
            Self::SecondForceCellDies => {
                let level = random.below(2) == 0;
                board.wiring().second_force.dead = Some(level);
            }
        }
    }

    /// Returns whether the board does what it promises: the arm goes on, or the torque is off in time and stays off.
    fn is_handled<C: BoardChip>(self, bench: &mut Bench<C>) -> bool {
        if self.is_survived() {
            for _ in 0..10 {
                bench.tick();
            }
            return bench.board.torque().enabled == Some(true) && bench.board.resets().is_empty();
        }
        let is_in_time = match self {
            // Shown by a turn of the joint beyond the tolerance.
            Self::EncoderFreezes => {
                let frozen = [0, 1].map(|it| bench.is_frozen[it] || bench.second_is_frozen[it]);
                let joint = usize::from(frozen[1]);
                let angle = |bench: &Bench<C>| i64::from(bench.frame.joints[joint].0);
                let frozen_at = angle(bench);
                let tolerance = i64::from(Mounting::default().second_encoder_tolerance);
                let (_, ticks) = Harm::until_off_counting(bench, 2000, |bench| {
                    (angle(bench) - frozen_at).abs() > tolerance
                });
                ticks <= 2
            }
            Self::HostSilent => {
                let drives = (0..HOST_LIMIT_TICKS - 2).all(|_| {
                    bench.tick();
                    bench.board.torque().enabled == Some(true)
                });
                bench.tick();
                bench.tick();
                drives && bench.time_until_off().is_some()
            }
            _ => bench.time_until_off().is_some(),
        };
        is_in_time && bench.stays_off(20)
    }
}

/// With random phases and frequencies of the clocks, the torque is off within two ticks, and stays off, for faults that end the drive; it stays on
/// for others.
#[test]
#[ignore = "random faults"]
fn a_thousand_random_faults_take_the_torque_off_or_are_survived() {
    take_the_torque_off_or_are_survived::<F405>(&scenario(DEFAULT), FAULTS);
}

#[test]
#[ignore = "random faults"]
fn a_thousand_random_faults_on_the_nucleo_take_the_torque_off_or_are_survived() {
    take_the_torque_off_or_are_survived::<G474>(&scenario(DEFAULT), FAULTS);
}

#[test]
#[ignore = "random faults"]
fn random_faults_of_an_arm_with_one_sensor_take_the_torque_off_or_are_survived() {
    take_the_torque_off_or_are_survived::<F405>(&with_one_sensor(DEFAULT), FAULTS / 16);
    take_the_torque_off_or_are_survived::<G474>(&with_one_sensor(DEFAULT), FAULTS / 16);
}

fn take_the_torque_off_or_are_survived<C: BoardChip>(scenario: &Scenario, faults: u32) {
    let second_sensors = match scenario.converters.mounting.sensors {
        SensorParts::Both => InjectedFault::OF_SECOND_SENSORS,
        SensorParts::First | SensorParts::Second => &[],
    };
    let kinds = [InjectedFault::OF_ONE_SENSOR, second_sensors].concat();
    let mut bench = Bench::<C>::new(scenario);
    bench.drive();
    let healthy = bench.snapshot();
    let mut random = Random(1);
    let mut exceptions = Vec::new();
    for number in 0..faults {
        bench.restore(&healthy);
        bench.host_is_there = true;
        bench.is_frozen = [false; 2];
        bench.second_is_frozen = [false; 2];
        bench.force_is_stuck_at = None;
        bench.second_force_is_stuck_at = None;
        // Anything that the manuals leave open, within their limits.
        let phase = random.below(u64::MAX);
        let [slowest, _, fastest] = C::OSCILLATOR_HZ;
        let oscillator_hz = slowest + random.below(fastest - slowest + 1);
        let ppm = random.below(101) as i32 - 50;
        let chip = bench.board.machine.chip_mut();
        chip.set_watchdog_phase(phase);
        chip.watchdogs_mut().0.oscillator_hz = oscillator_hz;
        chip.detune_crystal(ppm);
        let fault = kinds[random.below(kinds.len() as u64) as usize];
        for _ in 0..random.below(5) {
            bench.tick();
        }
        let count = random.below(15_000);
        bench.board.machine.run_instructions(count, 1_000_000_000);
        fault.strike(&mut bench, &mut random);
        let kept = fault.is_handled(&mut bench);
        if !kept {
            exceptions.push((number, fault));
        }
    }
    assert!(
        exceptions.is_empty(),
        "{} exceptions: {exceptions:?}",
        exceptions.len()
    );
}
