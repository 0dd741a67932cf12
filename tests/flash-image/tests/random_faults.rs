//! Injects a thousand random faults at random instructions.

use painleve_flash_image::bench::{Bench, scenario};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_flash_image::stm32::Crystal;
use painleve_parts::{BitErrors, BridgeFailure};

/// Number of faults.
const FAULTS: u32 = 1000;

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
    Hang,
    ControlTimer,
    Crystal,
    Supply,
    EncoderDies,
    ForceCellDies,
    ForceAxisDies,
}

impl InjectedFault {
    const ALL: [Self; 12] = [
        Self::BitErrors,
        Self::SerialNoise,
        Self::ResetPin,
        Self::EnableGlitch,
        Self::BadInstruction,
        Self::Hang,
        Self::ControlTimer,
        Self::Crystal,
        Self::Supply,
        Self::EncoderDies,
        Self::ForceCellDies,
        Self::ForceAxisDies,
    ];

    /// Returns whether the arm must continue.
    fn is_survived(self) -> bool {
        matches!(self, Self::BitErrors | Self::SerialNoise)
    }

    fn strike<C: BoardChip>(self, bench: &mut Bench<C>, random: &mut Random) {
        let board = &mut bench.board;
        match self {
            Self::BitErrors => {
                let seed = random.below(u64::MAX);
                let wiring = board.wiring();
                for encoder in &mut wiring.encoders {
                    encoder.bit_errors = BitErrors::new(1e-4, seed);
                }
                wiring.force.bit_errors = BitErrors::new(1e-4, seed);
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
            Self::BadInstruction => board.machine.hard_fault(),
            Self::Hang => board.machine.hang(),
            Self::ControlTimer => board.machine.chip_mut().stop_control_timer(),
            Self::Crystal => board.machine.chip_mut().set_crystal(Crystal::Stops),
            Self::Supply => {
                let millivolts = 1500 + random.below(1350) as u32;
                board.machine.chip_mut().set_supply(millivolts);
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
        }
    }
}

/// The torque is off within two ticks, and stays off, for faults that end the drive; it stays on
/// for others.
#[test]
fn a_thousand_random_faults_take_the_torque_off_or_are_survived() {
    take_the_torque_off_or_are_survived::<F405>(FAULTS);
}

#[test]
fn random_faults_on_the_nucleo_take_the_torque_off_or_are_survived() {
    take_the_torque_off_or_are_survived::<G474>(FAULTS / 4);
}

fn take_the_torque_off_or_are_survived<C: BoardChip>(faults: u32) {
    let mut bench = Bench::<C>::new(&scenario("hybrid-elbow-down"));
    bench.drive();
    let healthy = bench.snapshot();
    let mut random = Random(1);
    let mut exceptions = Vec::new();
    for number in 0..faults {
        bench.restore(&healthy);
        let fault = InjectedFault::ALL[random.below(InjectedFault::ALL.len() as u64) as usize];
        for _ in 0..random.below(5) {
            bench.tick();
        }
        let count = random.below(15_000);
        bench.board.machine.run_instructions(count, 1_000_000_000);
        fault.strike(&mut bench, &mut random);
        let kept = if fault.is_survived() {
            for _ in 0..10 {
                bench.tick();
            }
            bench.board.torque().enabled == Some(true) && bench.board.resets().is_empty()
        } else {
            bench.time_until_off().is_some() && bench.stays_off(20)
        };
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
