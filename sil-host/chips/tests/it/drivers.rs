//! The drivers read every value from the chip models, within the limits of the data sheets, with
//! and without disturbances.

use std::cell::RefCell;
use std::rc::Rc;

use painleve_chips::wires::{Clock, ModelledBus, SelectPin, SharedPart};
use painleve_chips::{As5048a, BitErrors, BridgeAmplifier, BridgeFailure, Mcp3304, SpiPart};
use painleve_drivers::ReadError;
use painleve_drivers::encoders::{self, EncoderDriver};
use painleve_drivers::exchange::PolledDriver;
use painleve_drivers::force_cell::{self, ForceCellDriver, ForceReadings};
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::mounting::{Mounting, SensorParts};

type Tested<D, P, const N: usize> = PolledDriver<D, ModelledBus<P>, SelectPin<P>, Clock, N>;
type TestedEncoders = Tested<EncoderDriver, As5048a, 4>;
type TestedForceCell = Tested<ForceCellDriver, Mcp3304, 2>;

fn encoders() -> (TestedEncoders, [SharedPart<As5048a>; 4]) {
    encoders_read(SensorParts::First)
}

/// First encoders of both joints, then the second ones.
fn encoders_read(read: SensorParts) -> (TestedEncoders, [SharedPart<As5048a>; 4]) {
    let clock = Clock::default();
    let mut bus = ModelledBus::new(&clock, encoders::FASTEST_HZ.into(), true);
    let parts = [(); 4].map(|()| Rc::new(RefCell::new(As5048a::default())));
    let selects = parts.each_ref().map(|part| bus.attach(part));
    let mut driver = EncoderDriver::new();
    driver.read_parts(read);
    (PolledDriver::new(driver, bus, selects, clock), parts)
}

fn force_cell() -> (TestedForceCell, SharedPart<Mcp3304>) {
    let (driver, [first, _]) = force_cells_read(SensorParts::First);
    (driver, first)
}

fn force_cells_read(read: SensorParts) -> (TestedForceCell, [SharedPart<Mcp3304>; 2]) {
    let clock = Clock::default();
    let mut bus = ModelledBus::new(&clock, force_cell::FASTEST_HZ.into(), false);
    let parts = [(); 2].map(|()| Rc::new(RefCell::new(Mcp3304::default())));
    let selects = parts.each_ref().map(|part| bus.attach(part));
    let mut driver = ForceCellDriver::new();
    driver.read_parts(read);
    (PolledDriver::new(driver, bus, selects, clock), parts)
}

/// An axis of the force cell without a failure.
const BRIDGE: BridgeAmplifier = BridgeAmplifier { failure: None };

/// The converter's channels for the pairs of both axes.
fn channels([n_plus, n_minus]: [i32; 2], [t_plus, t_minus]: [i32; 2]) -> [i32; 8] {
    [n_plus, n_minus, t_plus, t_minus, 0, 0, 0, 0]
}

/// Reads f_t and f_n.
fn forces(driver: &mut TestedForceCell) -> ForceReadings {
    driver
        .read()
        .readings(force_cell::BITS, &Mounting::default())
}

#[test]
fn every_angle_is_read_within_the_encoders_limits() {
    let (mut driver, parts) = encoders();
    for angle in 0..1 << encoders::BITS {
        parts[0].borrow_mut().angle = angle;
        parts[1].borrow_mut().angle = angle ^ 0x2a5a;
        let expected = [angle, angle ^ 0x2a5a].map(|it| Ok(EncoderCounts(it.into())));
        assert_eq!(driver.read().readings(encoders::BITS), expected);
    }
    assert!(parts.iter().all(|it| it.borrow().violations().is_empty()));
}

#[test]
fn forces_of_either_sign_are_read() {
    let (mut driver, part) = force_cell();
    for force in -1966..=1965 {
        let (normal, tangential) = (BRIDGE.channels(force), BRIDGE.channels(-force - 1));
        part.borrow_mut().channels = channels(normal, tangential);
        let expected = ForceReadings {
            tangential: Ok(ForceCounts(-force - 1)),
            normal: Ok(ForceCounts(force)),
        };
        assert_eq!(forces(&mut driver), expected);
    }
    assert!(part.borrow().violations().is_empty());
}

/// Whatever the force, a dead axis gives no reading, and the other axis is read.
#[test]
fn a_dead_axis_of_the_force_cell_gives_no_reading() {
    let (mut driver, part) = force_cell();
    for failure in BridgeFailure::ALL {
        let dead = BridgeAmplifier {
            failure: Some(*failure),
        };
        for force in (-1966..=1965).step_by(100) {
            part.borrow_mut().channels = channels(dead.channels(force), BRIDGE.channels(7));
            let expected = ForceReadings {
                tangential: Ok(ForceCounts(7)),
                normal: Err(ReadError::Implausible),
            };
            assert_eq!(forces(&mut driver), expected, "{failure:?} at {force}");
        }
    }
}

/// Saturation of the amplifier is no measurement.
#[test]
fn a_force_beyond_the_range_gives_no_reading() {
    let (mut driver, part) = force_cell();
    for force in [-2100, -1967, 1966, 2100] {
        part.borrow_mut().channels = channels(BRIDGE.channels(force), BRIDGE.channels(0));
        assert_eq!(forces(&mut driver).normal, Err(ReadError::Implausible));
    }
}

/// With both sensors of each channel, or the second ones alone, which are passed on as the first ones were.
#[test]
fn second_sensors_are_read() {
    let (mut driver, parts) = encoders_read(SensorParts::Both);
    let (mut force_driver, force_parts) = force_cells_read(SensorParts::Both);
    for (part, angle) in parts.iter().zip([11, 22, 33, 44]) {
        part.borrow_mut().angle = angle;
    }
    for (part, [normal, tangential]) in force_parts.iter().zip([[5, -6], [7, -8]]) {
        part.borrow_mut().channels = channels(BRIDGE.channels(normal), BRIDGE.channels(tangential));
    }
    let encoders = driver.read();
    assert_eq!(encoders.pairs(), [[Ok(11), Ok(33)], [Ok(22), Ok(44)]]);
    assert_eq!(encoders.readings(encoders::BITS)[1], Ok(EncoderCounts(22)));
    let pairs = force_driver.read().pairs(&Mounting::default());
    assert_eq!(pairs, [[Ok(-6), Ok(-8)], [Ok(5), Ok(7)]]);
    assert!(parts.iter().all(|it| it.borrow().violations().is_empty()));
    assert!(
        force_parts
            .iter()
            .all(|it| it.borrow().violations().is_empty())
    );

    let (mut driver, parts) = encoders_read(SensorParts::Second);
    parts[0].borrow_mut().dead = Some(true);
    parts[2].borrow_mut().angle = 33;
    parts[3].borrow_mut().angle = 44;
    for _ in 0..200 {
        let encoders = driver.read();
        let expected = [33, 44].map(|it| Ok(EncoderCounts(it)));
        assert_eq!(encoders.readings(encoders::BITS), expected);
    }
    assert_eq!(driver.read().magnets(), [Some(true); 2]);
    let (mut force_driver, force_parts) = force_cells_read(SensorParts::Second);
    force_parts[1].borrow_mut().channels = channels(BRIDGE.channels(7), BRIDGE.channels(-8));
    assert_eq!(
        forces(&mut force_driver),
        ForceReadings {
            tangential: Ok(ForceCounts(-8)),
            normal: Ok(ForceCounts(7)),
        }
    );
}

#[test]
fn a_disturbed_encoder_is_read_again_in_the_same_tick() {
    let (mut driver, parts) = encoders();
    parts[1].borrow_mut().angle = 77;
    parts[1].borrow_mut().errors = 1;
    assert_eq!(
        driver.read().readings(encoders::BITS)[1],
        Ok(EncoderCounts(77))
    );
    assert_eq!(parts[1].borrow().errors, 0, "the flag is cleared");
}

#[test]
fn dead_lines_give_no_reading_or_a_recognisably_dead_one() {
    let (mut driver, parts) = encoders();
    parts[0].borrow_mut().dead = Some(true);
    parts[1].borrow_mut().dead = Some(false);
    assert_eq!(
        driver.read().readings(encoders::BITS),
        [Err(ReadError::Flagged), Ok(EncoderCounts(0))]
    );
    let (mut driver, part) = force_cell();
    part.borrow_mut().dead = Some(true);
    assert_eq!(forces(&mut driver).tangential, Err(ReadError::NotZero));
    part.borrow_mut().dead = Some(false);
    assert_eq!(forces(&mut driver).tangential, Err(ReadError::Implausible));
}

#[test]
fn a_missing_magnet_of_any_encoder_in_use_is_detected() {
    for (read, in_use) in [
        (SensorParts::First, 0..2),
        (SensorParts::Second, 2..4),
        (SensorParts::Both, 0..4),
    ] {
        for encoder in in_use {
            let (mut driver, parts) = encoders_read(read);
            let mut healthy = [Some(true); 2];
            for _ in 0..200 {
                driver.read();
            }
            assert_eq!(driver.read().magnets(), healthy);
            parts[encoder].borrow_mut().diagnostics = 0x09ff;
            for _ in 0..200 {
                driver.read();
            }
            healthy[encoder % 2] = Some(false);
            assert_eq!(driver.read().magnets(), healthy, "{read:?} {encoder}");
        }
    }
}

/// One bit in ten thousand is flipped, in both directions.
#[test]
fn with_bit_errors_a_reading_is_correct_or_missing() {
    let (mut driver, parts) = encoders();
    let (mut force_driver, force_part) = force_cell();
    for (seed, part) in parts.iter().enumerate() {
        part.borrow_mut().bit_errors = BitErrors::new(1e-4, seed as u64);
    }
    force_part.borrow_mut().bit_errors = BitErrors::new(1e-4, 2);
    let mut lost = 0;
    const TICKS: u32 = 100_000;
    for tick in 0..TICKS {
        let angles = [tick * 7 % 16384, tick * 13 % 16384];
        for (part, angle) in parts.iter().zip(angles) {
            part.borrow_mut().angle = angle as u16;
        }
        let [normal, tangential] = [tick * 11, tick * 3].map(|it| (it % 3900) as i32 - 1950);
        let pairs = [normal, tangential].map(|it| BRIDGE.channels(it));
        force_part.borrow_mut().channels = channels(pairs[0], pairs[1]);
        for (reading, angle) in driver
            .read()
            .readings(encoders::BITS)
            .into_iter()
            .zip(angles)
        {
            match reading {
                Ok(counts) => assert_eq!(counts.0, angle, "tick {tick}"),
                Err(_) => lost += 1,
            }
        }
        let read = forces(&mut force_driver);
        for (reading, force) in [(read.tangential, tangential), (read.normal, normal)] {
            match reading {
                Ok(counts) => assert_eq!(counts.0, force, "tick {tick}"),
                Err(_) => lost += 1,
            }
        }
    }
    let errors: u64 = parts.iter().map(|it| it.borrow().bit_errors.count).sum();
    assert!(errors > 1000);
    assert!(
        lost < TICKS / 1000,
        "{lost} of {} readings were lost",
        4 * TICKS
    );
}
