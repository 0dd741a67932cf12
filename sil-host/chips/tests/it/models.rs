//! The chips' models by themselves: nothing that an image does wrong may pass here.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use painleve_chips::machine::{Chip as _, Reset};
use painleve_chips::registers::Registers;
use painleve_chips::stm32::{
    CONTROL_KEYS, Outside, Pin, PinLevel, Timer, Usart, UsartLayout, Watchdog, WindowWatchdog,
    WiredChip, take_key,
};
use painleve_chips::stm32f4::{self, Stm32f4};
use painleve_chips::stm32g4::{self, Stm32g4};
use painleve_chips::{MICROSECOND, MILLISECOND, Picoseconds, Transfer};

/// No part is on any pin.
#[derive(Clone)]
struct Nothing;

impl Outside for Nothing {
    fn pin(&mut self, _: Pin, _: Option<bool>, _: Picoseconds) -> Option<PinLevel> {
        None
    }

    fn transfer(&mut self, _: usize, _: Transfer, _: Picoseconds) -> u16 {
        0
    }
}

/// Returns a chip whose power has just come up.
fn powered<C: WiredChip<Outside = Nothing>>() -> C {
    let mut chip = C::without_power(Nothing, C::OSCILLATOR_HZ[1]);
    chip.reset(Reset::Power, 0);
    chip
}

/// Compares every register with its value after a reset, but for these addresses. `clocks` are those that switch the
/// peripherals' clocks on.
fn check_after_reset<C: WiredChip<Outside = Nothing>>(clocks: &[u32], except: &[Range<u32>]) {
    let mut chip = powered::<C>();
    let table = Registers::parse(C::REGISTERS);
    let (own, others) = table
        .after_reset()
        .partition::<Vec<_>, _>(|(address, _)| clocks.contains(address));
    let mut differ = Vec::new();
    for (address, value) in own.into_iter().chain(others) {
        if except.iter().any(|it| it.contains(&address)) {
            continue;
        }
        let is = chip.read(address, 4, 0);
        if is != value {
            differ.push(format!("{address:#x} is {is:#x}, not {value:#x}"));
        }
        if clocks.contains(&address) {
            chip.write(address, 4, u32::MAX, 0);
        }
    }
    assert!(differ.is_empty(), "{differ:#?}");
}

#[test]
fn registers_of_the_stm32f405_start_with_the_manuals_values() {
    let except = [
        // TIM5 is not modelled, nor most of debug control: a load ends the test. The identification is the chip's own.
        0x4000_0c00..0x4000_1000,
        0xe004_2000..0xe004_2400,
        // The registers of I2S, which is not modelled.
        0x4000_381c..0x4000_3824,
        0x4001_301c..0x4001_3024,
        // The table has 0 for the reload of TIM2, and lacks the regulator's scale, its readiness and the speed of the
        // debugger's pins.
        0x4000_002c..0x4000_0030,
        0x4000_7000..0x4000_7008,
        0x4002_0008..0x4002_000c,
        // Inputs: the debugger's pins have pull resistors, which the table leaves out.
        0x4002_0010..0x4002_0014,
        0x4002_0410..0x4002_0414,
        // The option bytes are the chip's own.
        0x4002_3c14..0x4002_3c18,
    ];
    let clocks = [0x4002_3830, 0x4002_3840, 0x4002_3844];
    check_after_reset::<Stm32f4<Nothing>>(&clocks, &except);
}

#[test]
fn registers_of_the_stm32g474_start_with_the_manuals_values() {
    let except = [
        // The registers of I2S, which is not modelled.
        0x4000_381c..0x4000_3824,
        0x4001_301c..0x4001_3024,
        // The serial port's flags: the table lacks that the transmitter is empty.
        0x4000_441c..0x4000_4420,
        // The option bytes are the chip's own, and so is its identification.
        0x4002_2020..0x4002_2024,
        0xe004_2000..0xe004_2004,
        // Inputs: the debugger's pins have pull resistors, which the table leaves out.
        0x4800_0010..0x4800_0014,
        0x4800_0410..0x4800_0414,
    ];
    let clocks = [0x4002_1048, 0x4002_104c, 0x4002_1058, 0x4002_1060];
    check_after_reset::<Stm32g4<Nothing>>(&clocks, &except);
}

/// Returns whether the models refuse an operation, which ends an image's test.
fn is_refused<T>(operation: impl FnOnce() -> T) -> bool {
    catch_unwind(AssertUnwindSafe(operation)).is_err()
}

/// At 1 MHz, with a reload of 99.
#[test]
fn a_timer_whose_count_is_beyond_its_reload_runs_to_its_end_first() {
    const HZ: u64 = 1_000_000;
    let mut timer = Timer::default();
    timer.write(0x2c, 99, HZ, 0);
    timer.write(0x00, 1, HZ, 0);
    assert_eq!(timer.next_event(HZ), 100 * MICROSECOND);
    // A reload that is changed in time counts at once.
    timer.write(0x2c, 59, HZ, 50 * MICROSECOND + MICROSECOND / 2);
    assert_eq!(timer.next_event(HZ), 60 * MICROSECOND);
    timer.write(0x2c, 49, HZ, 51 * MICROSECOND);
    let wrap = (1 << 32) * MICROSECOND;
    assert_eq!(timer.next_event(HZ), wrap + 50 * MICROSECOND);
    assert_eq!(timer.read(0x24, HZ, wrap + 7 * MICROSECOND), 7);
    timer.advance(HZ, wrap + 49 * MICROSECOND);
    assert_eq!(timer.updates, 0);
    timer.advance(HZ, wrap + 50 * MICROSECOND);
    assert_eq!(timer.updates, 1);
    // The reload is not buffered.
    assert!(is_refused(|| timer.write(0x00, 0x81, HZ, 2 * wrap)));
}

const LINE_HZ: u64 = 92_160_000;

/// Two serial ports, and the offset of the data that each sends: both kinds, on, at this rate, with further bits in the
/// control registers.
fn serial_ports(further: [u32; 3], rate: Option<u32>) -> [(Usart, u32); 2] {
    let plain = (UsartLayout::SharedData, [0x0c, 0x08, 0x04], 1 << 13);
    let separate = (UsartLayout::SeparateData, [0x00, 0x0c, 0x28], 1);
    [plain, separate].map(|(layout, [control, divisor, data], on)| {
        let mut port = Usart::new(layout);
        if let Some(rate) = rate {
            port.write(divisor, rate, LINE_HZ, 0);
        }
        let bits = [on | 0xc | further[0], further[1], further[2]];
        for (offset, bits) in [8, 4, 0].into_iter().zip(bits.into_iter().rev()) {
            port.write(control + offset, bits, LINE_HZ, 0);
        }
        (port, data)
    })
}

#[test]
fn a_line_of_another_format_than_the_hosts_is_refused() {
    for (mut port, data) in serial_ports([0x1f0, 0, 0xc1], Some(100)) {
        port.write(data, 7, LINE_HZ, 0);
        port.advance(LINE_HZ, port.next_event());
        assert_eq!(port.outgoing, [7]);
    }
    let wrong = [
        ("9 bits", [1 << 12, 0, 0], Some(100)),
        ("parity", [1 << 10, 0, 0], Some(100)),
        ("8 samples", [1 << 15, 0, 0], Some(100)),
        ("2 stop bits", [0, 2 << 12, 0], Some(100)),
        ("flow control", [0, 0, 3 << 8], Some(100)),
        ("no rate", [0, 0, 0], None),
    ];
    for (name, further, rate) in wrong {
        for (mut port, data) in serial_ports(further, rate) {
            assert!(
                is_refused(|| port.write(data, 7, LINE_HZ, 0)),
                "{name}: sent"
            );
        }
        for (mut port, _) in serial_ports(further, rate) {
            port.incoming.push_back((0, 7));
            assert!(is_refused(|| port.advance(LINE_HZ, 0)), "{name}: received");
        }
    }
    // The STM32G474 has no other rate while it is on, and the prescaler of its clock is not modelled.
    let [(mut plain, _), (mut separate, _)] = serial_ports([0; 3], Some(100));
    plain.write(0x08, 100, LINE_HZ, 0);
    assert!(is_refused(|| separate.write(0x0c, 100, LINE_HZ, 0)));
    assert!(is_refused(|| separate.write(0x2c, 1, LINE_HZ, 0)));
}

#[test]
fn a_clock_that_changes_spoils_the_bytes_on_the_line() {
    for (mut port, data) in serial_ports([0; 3], Some(100)) {
        port.write(data, 7, LINE_HZ, 0);
        port.advance(LINE_HZ / 2, port.next_event());
        port.incoming.push_back((0, 8));
        port.advance(LINE_HZ / 2, port.next_event());
        assert!(port.outgoing != [7] && port.take() != 8);
    }
}

#[test]
fn a_byte_that_nobody_takes_from_the_serial_port_costs_the_next() {
    for (mut port, _) in serial_ports([0; 3], Some(100)) {
        port.incoming.extend([(0, 7), (1, 8)]);
        port.advance(LINE_HZ, 0);
        port.advance(LINE_HZ, 1);
        assert_eq!((port.overruns, port.take()), (1, 7));
    }
}

const SPI_HZ: u64 = 42_000_000;

/// A master that is on, with its select input held high by software.
const SPI_ON: u32 = 1 << 9 | 1 << 8 | 1 << 6 | 1 << 2;

fn plain_spi(control: u32, second: u32) -> stm32f4::Spi {
    let mut spi = stm32f4::Spi::default();
    spi.write(0x04, second, SPI_HZ, 0);
    spi.write(0x00, control, SPI_HZ, 0);
    spi
}

fn spi_with_fifos(control: u32, second: u32) -> stm32g4::Spi {
    let mut spi = stm32g4::Spi::default();
    spi.write(0x04, (0x1700 | second, 4), SPI_HZ, 0);
    spi.write(0x00, (control, 4), SPI_HZ, 0);
    spi
}

#[test]
fn words_of_another_format_than_the_sensors_are_refused() {
    plain_spi(SPI_ON, 0).write(0x0c, 7, SPI_HZ, 0);
    spi_with_fifos(SPI_ON, 0).write(0x0c, (7, 1), SPI_HZ, 0);
    let wrong = [
        ("select input low", SPI_ON & !(1 << 8), 0),
        ("select input of the pin", SPI_ON & !(1 << 9), 0),
        ("lowest bit first", SPI_ON | 1 << 7, 0),
        ("only receives", SPI_ON | 1 << 10, 0),
        ("checksum", SPI_ON | 1 << 13, 0),
        ("one data line", SPI_ON | 1 << 15, 0),
        ("other frames", SPI_ON, 1 << 4),
    ];
    for (name, first, second) in wrong {
        let mut plain = plain_spi(first, second);
        assert!(is_refused(|| plain.write(0x0c, 7, SPI_HZ, 0)), "{name}");
        let mut other = spi_with_fifos(first, second);
        let sent = is_refused(|| other.write(0x0c, (7, 1), SPI_HZ, 0));
        assert!(sent, "{name}");
    }
}

#[test]
fn a_word_that_nobody_takes_from_a_spi_costs_the_last() {
    const OVERRUN: u32 = 1 << 6;
    let mut plain = plain_spi(SPI_ON, 0);
    for word in [7, 8] {
        plain.write(0x0c, 0, SPI_HZ, 0);
        plain.complete(word, SPI_HZ);
    }
    assert_eq!(plain.read(0x08) & OVERRUN, OVERRUN);
    assert_eq!(plain.read(0x0c), 7);
    let mut other = spi_with_fifos(SPI_ON, 0);
    for word in 1..=5 {
        other.write(0x0c, (0, 1), SPI_HZ, 0);
        other.complete(word, SPI_HZ);
    }
    assert_eq!(other.read(0x08, 4) & OVERRUN, OVERRUN);
    let received = [(); 4].map(|()| other.read(0x0c, 1));
    assert_eq!(received, [1, 2, 3, 4]);
}

#[test]
fn a_running_watchdog_is_not_fed_by_its_start_key() {
    const HZ: u64 = 32_000;
    let mut watchdog = Watchdog::new(HZ);
    watchdog.write(0x00, 0xcccc, 0);
    let expires = watchdog.expires();
    watchdog.write(0x00, 0xcccc, MILLISECOND);
    assert_eq!(watchdog.expires(), expires);
    watchdog.write(0x00, 0xaaaa, MILLISECOND);
    assert_eq!(watchdog.expires(), expires + MILLISECOND);
    assert!(is_refused(|| watchdog.write(0x10, 7, MILLISECOND)));
}

/// A count takes 1 ms, then 2 ms.
#[test]
fn a_window_watchdog_counts_on_at_another_pace() {
    const HZ: u64 = 4_096_000;
    let mut watchdog = WindowWatchdog::new(7, 2);
    watchdog.write(0x00, 0xff, HZ, 0);
    assert_eq!(watchdog.expires(), 64 * MILLISECOND);
    watchdog.write(0x04, 1 << 7 | 0x7f, HZ, 32 * MILLISECOND);
    assert_eq!(watchdog.expires(), 96 * MILLISECOND);
}

#[test]
fn a_wrong_key_for_the_flash_is_refused() {
    let mut taken = 0;
    assert!(!take_key(CONTROL_KEYS, &mut taken, CONTROL_KEYS[0]));
    assert!(is_refused(|| take_key(
        CONTROL_KEYS,
        &mut taken,
        CONTROL_KEYS[0]
    )));
}

#[test]
fn writing_the_flash_takes_its_longest_time() {
    const BUSY: u32 = 1 << 16;
    let mut f405 = powered::<Stm32f4<Nothing>>();
    let mut g474 = powered::<Stm32g4<Nothing>>();
    for key in CONTROL_KEYS {
        f405.write(0x4002_3c04, 4, key, 0);
        g474.write(0x4002_2008, 4, key, 0);
    }
    f405.write(0x4002_3c10, 4, 0x201, 0);
    f405.write(0x080c_0000, 4, 7, 0);
    // Without the data cache.
    g474.write(0x4002_2000, 4, 0, 0);
    g474.write(0x4002_2014, 4, 1, 0);
    g474.write(0x0807_f000, 4, 7, 0);
    g474.write(0x0807_f004, 4, 7, 0);
    let mut is_busy = |now| {
        [
            f405.read(0x4002_3c0c, 4, now) & BUSY != 0,
            g474.read(0x4002_2010, 4, now) & BUSY != 0,
        ]
    };
    assert_eq!(is_busy(90 * MICROSECOND), [true, true]);
    assert_eq!(is_busy(99 * MICROSECOND), [true, false]);
    assert_eq!(is_busy(100 * MICROSECOND), [false, false]);
    // A page of the STM32G474, in the second bank.
    g474.write(
        0x4002_2014,
        4,
        1 << 16 | 1 << 11 | 126 << 3 | 2,
        MILLISECOND,
    );
    assert!(g474.read(0x4002_2010, 4, 25 * MILLISECOND) & BUSY != 0);
    assert!(g474.read(0x4002_2010, 4, 26 * MILLISECOND) & BUSY == 0);
}

/// From the internal oscillator to the crystal.
#[test]
fn the_system_clock_changes_later_than_it_is_told() {
    const CRYSTAL_ON: u32 = 1 << 16;
    let crystal = 3 * MILLISECOND;
    let mut rcc = stm32f4::Rcc::new();
    rcc.write(0x00, CRYSTAL_ON, 0);
    rcc.write(0x08, 1, crystal);
    assert_eq!((rcc.read(0x08, crystal), rcc.core_hz()), (1, 16_000_000));
    assert!(rcc.next_event() > crystal + MICROSECOND);
    assert!(rcc.advance(rcc.next_event()));
    assert_eq!((rcc.read(0x08, crystal), rcc.core_hz()), (5, 8_000_000));

    let mut rcc = stm32g4::Rcc::new();
    rcc.write(0x00, CRYSTAL_ON, 0);
    rcc.write(0x08, 2, crystal);
    assert_eq!((rcc.read(0x08, crystal), rcc.core_hz()), (6, 16_000_000));
    assert!(rcc.next_event() > crystal + MICROSECOND);
    assert!(rcc.advance(rcc.next_event()));
    assert_eq!((rcc.read(0x08, crystal), rcc.core_hz()), (10, 24_000_000));
}

/// The divider of the STM32G474's bus clock goes a microsecond after the change, not after the order.
#[test]
fn the_divider_stays_until_the_clock_has_changed() {
    const LOOP: u32 = 1 << 24 | 85 << 8 | 3 << 4 | 2;
    let (loops, divided, undivided) = (MILLISECOND, 0x83, 0x03);
    let mut switching = stm32g4::Rcc::new();
    switching.write(0x0c, LOOP, 0);
    switching.write(0x00, 1 << 24, 0);
    switching.write(0x08, divided, loops);
    let mut early = switching.clone();
    early.write(0x08, undivided, loops + MICROSECOND);
    assert!(is_refused(|| early.advance(early.next_event())));
    let changed = switching.next_event();
    assert!(switching.advance(changed));
    assert_eq!(switching.core_hz(), 85_000_000);
    let mut early = switching.clone();
    assert!(is_refused(|| early.write(0x08, undivided, changed)));
    switching.write(0x08, undivided, changed + MICROSECOND);
    assert_eq!(switching.core_hz(), 170_000_000);
}

#[test]
fn a_narrow_store_changes_the_whole_register() {
    let registers = Registers::parse("WWDG 40002c00 0=ff 4=3ff\nGPIOA 48000000 18=ffffffff\n");
    assert_eq!(registers.on_the_bus(0x4000_2c04, 1, 0xa5), 0x1a5);
    assert_eq!(registers.on_the_bus(0x4000_2c04, 2, 0x2a5), 0x2a5);
    assert_eq!(registers.on_the_bus(0x4800_0018, 4, 1), 1);
    for (address, size) in [(0x4000_2c05, 1), (0x4800_0018, 2)] {
        assert!(is_refused(|| registers.on_the_bus(address, size, 1)));
    }
}

/// A channel that waits for a trigger would not give what is written to it.
#[test]
fn a_trigger_of_the_converter_is_refused() {
    let mut f405 = powered::<Stm32f4<Nothing>>();
    f405.write(0x4002_3840, 4, 1 << 29, 0);
    f405.write(0x4000_7400, 4, 3, 0);
    assert!(is_refused(|| f405.write(0x4000_7400, 4, 7, 0)));
    let mut g474 = powered::<Stm32g4<Nothing>>();
    g474.write(0x4002_104c, 4, 1 << 16, 0);
    g474.write(0x5000_0800, 4, 1, 0);
    assert!(is_refused(|| g474.write(0x5000_0800, 4, 3, 0)));
}
