//! The bounds of the control interrupt and of the update after it, and the paths that attain them.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use painleve_drivers::encoders::EncoderDriver;
use painleve_drivers::exchange::{Dialogue, SelectTiming};
use painleve_drivers::force_cell::ForceCellDriver;
use serde::Serialize;

use crate::cycles::Chip;
use crate::image::Image;
use crate::loops::{EVALUATES, Limits, NOT_CALLED, STARTS, panics};
use crate::sections::{self, Section};
use crate::values::{Program, Values};
use crate::worst::{Analysis, Loop, Visit, Worst};
use crate::{BoundError, ImageError};

/// Handler of the control timer.
pub const CONTROL_INTERRUPT: &str = "TIM2";

/// Handler of the update after it.
pub const UPDATE_INTERRUPT: &str = "TIM3";

/// A sensor's bus.
struct SensorBus {
    handler: &'static str,
    timing: SelectTiming,
    /// Exchanges in a tick, with every reading disturbed and repeated as often as its driver allows: with one sensor
    /// on each channel, and with two.
    exchanges: [u32; 2],
    /// Interrupts of an exchange, one for each word.
    words: u32,
    /// The function that takes the readings of a complete set, once in a tick: a set is started at a tick, and only
    /// its last word's interrupt calls this.
    takes: &'static str,
}

/// Handlers of the sensors' buses.
pub const SENSOR_INTERRUPTS: [&str; 2] = [SENSOR_BUSES[0].handler, SENSOR_BUSES[1].handler];

const SENSOR_BUSES: [SensorBus; 2] = [
    SensorBus {
        handler: "SPI1",
        timing: EncoderDriver::TIMING,
        exchanges: EncoderDriver::MOST_EXCHANGES,
        words: 1,
        takes: "::take_encoders",
    },
    SensorBus {
        handler: "SPI2",
        timing: ForceCellDriver::TIMING,
        exchanges: ForceCellDriver::MOST_EXCHANGES,
        words: 3,
        takes: "::take_forces",
    },
];

/// Bounds on the interrupts of a tick.
#[derive(Clone, Debug, Serialize)]
pub struct Bound {
    /// The chip.
    #[serde(serialize_with = "name")]
    pub chip: &'static Chip,
    /// The control interrupt.
    pub control: HandlerBound,
    /// The update after it.
    pub update: HandlerBound,
    /// Cycles of both in a tick; less than their sum, because the update is short after the longest control interrupt,
    /// which starts the estimates.
    pub tick_cycles: u32,
    /// Cycles per tick of the interrupts that read the sensors for the next tick.
    pub sensor_cycles: u32,
    /// The same with two sensors on each channel.
    pub sensor_cycles_of_both: u32,
    /// Cycles of the longest of these interrupts, which may delay the control interrupt.
    pub longest_sensor_cycles: u32,
    /// Sections of other tasks that mask the control interrupt, the longest last.
    pub sections: Vec<Section>,
    /// Highest control rate at which all interrupts of a tick end before the next one, Hz, even if the longest of `sections`
    /// delays them. The serial port's interrupt, which has the update's priority and comes when the host sends, is left out.
    pub proves_hz: u32,
    /// The same with two sensors on each channel, Hz.
    pub proves_hz_with_both: u32,
    /// Functions that the bounds leave out: those that end the program, and [`NOT_CALLED`].
    #[serde(skip)]
    pub not_called: BTreeSet<u32>,
    /// The function whose call in a control interrupt shows that the tick starts the estimates ([`EVALUATES`]).
    #[serde(skip)]
    pub evaluates: u32,
    /// Functions that such a tick does not call ([`STARTS`]).
    #[serde(skip)]
    pub not_called_at_start: BTreeSet<u32>,
    /// Loops of the interrupts, including those of the sensors, and of the functions that they call.
    #[serde(skip)]
    pub loops: Vec<Loop>,
    /// Addresses of all instructions, including those of the sensors' interrupts, that are charged with the wait for a
    /// peripheral.
    #[serde(skip)]
    pub peripheral_accesses: BTreeSet<u32>,
}

fn name<S: serde::Serializer>(chip: &&Chip, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(chip.name)
}

/// A bound on one interrupt.
#[derive(Clone, Debug, Serialize)]
pub struct HandlerBound {
    /// Cycles from the request of the interrupt to the return from it.
    pub cycles: u32,
    /// The same at the core's clock, µs.
    pub microseconds: f64,
    /// Cycles of the entry to the interrupt and of the exit from it.
    pub around_cycles: u32,
    /// Instructions on the worst path.
    pub instructions: u32,
    /// The path, in order of execution.
    pub path: Vec<PathStretch>,
}

/// A part of the path within one source function.
#[derive(Clone, Debug, Serialize)]
pub struct PathStretch {
    /// The innermost function of the project.
    pub function: String,
    /// File of the function.
    pub file: String,
    /// Source lines named by the compiler.
    pub lines: BTreeSet<u32>,
    /// Cycles.
    pub cycles: u32,
}

impl Bound {
    /// Computes the bounds of an image.
    ///
    /// # Errors
    /// [`BoundError`] naming the file or the code that cannot be bounded.
    pub fn of(image: &Image) -> Result<Self, BoundError> {
        let chip = image.chip;
        let address_of = |handler: &str| {
            let entry = image.function(handler);
            entry.ok_or_else(|| BoundError::Image {
                path: image.path.clone(),
                source: ImageError::NoFunction(handler.to_owned()),
            })
        };
        let handlers = [CONTROL_INTERRUPT, UPDATE_INTERRUPT].into_iter();
        let handlers = handlers.chain(SENSOR_INTERRUPTS).map(address_of);
        let handlers = handlers.collect::<Result<Vec<_>, _>>()?;
        let entries = handlers.iter().map(|it| (*it, Values::new())).collect();
        let panics = panics(image);
        let program = Program::of(image, entries, &panics)?;
        let with_entry = |worst: &Worst| worst.cycles + chip.around(worst.entry, worst.uses_float);
        let worst_of = |handler: &str, analysis: &mut Analysis<'_>| {
            let entry = address_of(handler)?;
            let worst = analysis.of(entry)?;
            worst.ok_or(BoundError::NeverReturns { address: entry })
        };
        let out_of_line = |function: &str| {
            let address = image.only_function(function);
            address.ok_or_else(|| BoundError::Image {
                path: image.path.clone(),
                source: ImageError::NotOneFunction(function.to_owned()),
            })
        };
        let limits = Limits::of_tick(chip);
        let mut not_called = panics;
        for (function, _) in NOT_CALLED {
            not_called.insert(out_of_line(function)?);
        }
        let of_handler = |handler: &str, analysis: &mut Analysis<'_>| {
            let worst = worst_of(handler, analysis)?;
            let cycles = with_entry(&worst);
            Ok::<_, BoundError>(HandlerBound {
                cycles,
                microseconds: chip.microseconds(cycles),
                around_cycles: cycles - worst.cycles,
                instructions: worst.instructions,
                path: stretches(image, handler, &analysis.path_with_calls(&worst)),
            })
        };
        let left_out = |functions: &BTreeSet<u32>| -> BTreeSet<u32> {
            not_called.union(functions).copied().collect()
        };
        let without = |functions: &BTreeSet<u32>| {
            Analysis::new(&program, &limits).without(&left_out(functions))
        };
        let mut analysis = without(&BTreeSet::new());
        let update = of_handler(UPDATE_INTERRUPT, &mut analysis)?;
        // A tick either starts the estimates, or continues them.
        let evaluates = out_of_line(EVALUATES)?;
        let mut continuing = without(&BTreeSet::from([evaluates]));
        let continues = of_handler(CONTROL_INTERRUPT, &mut continuing)?;
        let mut not_called_at_start = BTreeSet::new();
        for (function, _) in STARTS {
            not_called_at_start.insert(out_of_line(function)?);
        }
        let mut starting = without(&not_called_at_start);
        let starts = of_handler(CONTROL_INTERRUPT, &mut starting)?;
        let update_at_start = of_handler(UPDATE_INTERRUPT, &mut starting)?;
        let tick_cycles =
            (continues.cycles + update.cycles).max(starts.cycles + update_at_start.cycles);
        let control = if starts.cycles > continues.cycles {
            starts
        } else {
            continues
        };
        // For loops and accesses: of all paths.
        worst_of(CONTROL_INTERRUPT, &mut analysis)?;
        let accesses = |analysis: &Analysis<'_>| -> BTreeSet<u32> {
            let functions = analysis.functions();
            functions
                .flat_map(|it| it.peripheral_accesses.iter().copied())
                .collect()
        };
        let mut peripheral_accesses = accesses(&analysis);
        let loops = |analysis: &Analysis<'_>| -> Vec<Loop> {
            let functions = analysis.functions();
            functions.flat_map(|it| it.loops.iter().cloned()).collect()
        };
        let mut all_loops = loops(&analysis);
        let (mut sensor_cycles, mut longest_sensor_cycles) = ([0; 2], 0);
        for (bus, bus_hz) in SENSOR_BUSES.into_iter().zip(chip.bus_hz) {
            let limits = Limits::of_sensor_bus(chip, bus.timing, bus_hz);
            let takes = BTreeSet::from([out_of_line(bus.takes)?]);
            let mut of_last_word = Analysis::new(&program, &limits).without(&not_called);
            let mut of_word = Analysis::new(&program, &limits).without(&left_out(&takes));
            let last = with_entry(&worst_of(bus.handler, &mut of_last_word)?);
            let other = with_entry(&worst_of(bus.handler, &mut of_word)?);
            peripheral_accesses.append(&mut accesses(&of_last_word));
            all_loops.append(&mut loops(&of_last_word));
            for (sum, exchanges) in sensor_cycles.iter_mut().zip(bus.exchanges) {
                *sum += (exchanges * bus.words - 1) * other + last;
            }
            longest_sensor_cycles = longest_sensor_cycles.max(last);
        }
        let [sensor_cycles, sensor_cycles_of_both] = sensor_cycles;
        let sections = sections::of(image, &handlers)?;
        let longest_section = sections.last().map_or(0, |it| it.cycles);
        let proves_hz = |sensor_cycles: u32| {
            let all = longest_section + tick_cycles + sensor_cycles;
            (chip.core_hz / f64::from(all)) as u32
        };
        Ok(Self {
            chip,
            sensor_cycles,
            sensor_cycles_of_both,
            longest_sensor_cycles,
            sections,
            proves_hz: proves_hz(sensor_cycles),
            proves_hz_with_both: proves_hz(sensor_cycles_of_both),
            control,
            update,
            tick_cycles,
            not_called,
            evaluates,
            not_called_at_start,
            peripheral_accesses,
            loops: all_loops,
        })
    }

    /// Returns the most cycles by which another interrupt or a section that masks the control interrupt delays it, with
    /// its entry. One of them is executed when the timer asks for the control interrupt, which has precedence over the others.
    pub fn release_cycles(&self) -> u32 {
        let sections = self.sections.iter().map(|it| it.cycles);
        let longest = sections.max().unwrap_or(0).max(self.longest_sensor_cycles);
        longest + self.control.around_cycles
    }

    /// Returns the report as text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        for (name, handler) in [
            ("control interrupt", &self.control),
            ("update after it", &self.update),
        ] {
            handler.write_path(&mut text);
            let _ = writeln!(
                text,
                "Bound of the {name}: {} cycles, {:.1} µs at {} MHz, with {} instructions on the worst path.\n",
                handler.cycles,
                handler.microseconds,
                self.chip.core_hz / 1e6,
                handler.instructions,
            );
        }
        let both = self.tick_cycles;
        let microseconds = |cycles| self.chip.microseconds(cycles);
        let _ = write!(
            text,
            "Both in a tick: {both} cycles, {:.1} µs. After the longest control interrupt, which starts the estimates, the update \
             is short.\n\
             Interrupts that read the sensors for the next tick, two on each channel: {} cycles, {:.1} µs in a tick, \
             {:.1} µs each at most.\n\
             Together, and with the longest section below, they prove control rates up to {} Hz, without the serial port's interrupt.\n\
             With one sensor on each channel: {} cycles, {:.1} µs in a tick, and up to {} Hz.\n\
             Not a measurement: cycles by the documents of ARM and ST, every line read from flash a miss.\n\n\
             Sections of other tasks that mask the interrupts and may delay the control interrupt, the longest last:\n",
            microseconds(both),
            self.sensor_cycles_of_both,
            microseconds(self.sensor_cycles_of_both),
            microseconds(self.longest_sensor_cycles),
            self.proves_hz_with_both,
            self.sensor_cycles,
            microseconds(self.sensor_cycles),
            self.proves_hz,
        );
        for section in &self.sections {
            let _ = writeln!(text, "{section}");
        }
        text
    }
}

impl HandlerBound {
    fn write_path(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:>7}  function  file and lines", "cycles");
        for stretch in &self.path {
            let (cycles, function) = (stretch.cycles, &stretch.function);
            let _ = write!(text, "{cycles:>7}  {function}  {}", stretch.file);
            let _ = match (stretch.lines.first(), stretch.lines.last()) {
                (Some(first), Some(last)) if first < last => writeln!(text, ":{first}-{last}"),
                (Some(line), _) => writeln!(text, ":{line}"),
                (None, _) => writeln!(text),
            };
        }
        let around = self.around_cycles;
        let _ = writeln!(text, "{around:>7}  entry to and exit from the interrupt");
    }
}

fn stretches(image: &Image, handler: &str, path: &[Visit]) -> Vec<PathStretch> {
    let mut all: Vec<PathStretch> = Vec::new();
    let mut rest = 0.0;
    for visit in path {
        let frames = image.frames(visit.block);
        let ours = frames
            .iter()
            .find(|frame| frame.function.contains("painleve"));
        let function = plain(ours.map_or(handler, |frame| &frame.function));
        let (file, line) = ours.map_or(("", 0), |frame| (frame.file.as_str(), frame.line));
        // Whole cycles that add up to the total.
        let exact = visit.cycles + rest;
        let cycles = exact.round();
        rest = exact - cycles;
        let cycles = cycles as u32;
        match all.last_mut() {
            Some(last) if last.function == function => {
                last.cycles += cycles;
                last.lines.extend((line > 0).then_some(line));
            }
            _ => all.push(PathStretch {
                function,
                file: file.to_owned(),
                lines: BTreeSet::from_iter((line > 0).then_some(line)),
                cycles,
            }),
        }
    }
    all
}

/// Returns a function's name without the project's crate and type parameters.
fn plain(name: &str) -> String {
    name.replace("painleve_firmware::", "")
        .replace("painleve_shared::", "")
}
