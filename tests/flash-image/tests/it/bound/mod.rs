#![allow(clippy::unwrap_used)]
//! No executed tick exceeds the bounds on the control interrupt and on the update after it under the same cost model:
//! in closed loops, with random frames and settings, and with those found by searches for the worst tick.
//!
//! `PAINLEVE_TICKS` sets the number of random frames and of search steps; random settings use all
//! processors.

use painleve_bound::image::Image;
use painleve_bound::loops::Limit;
use painleve_bound::profile::Profile;
use painleve_bound::report::{
    Bound, CONTROL_INTERRUPT, HandlerBound, SENSOR_INTERRUPTS, UPDATE_INTERRUPT,
};
use painleve_bound::trace::{Executed, Tracer, rounds, without_waits};
use painleve_flash_image::bench::{Bench, BoardBench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, EmulatedBoard, F405, FlashedBoard, G474};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{FrameSource, Response};

pub mod random;
mod with_sensors;

use random::{Random, mutated, with_random_settings};

fn tries(otherwise: u64) -> u64 {
    let asked = std::env::var("PAINLEVE_TICKS").ok();
    asked.and_then(|it| it.parse().ok()).unwrap_or(otherwise)
}

/// The longest executions of one handler.
#[derive(Clone, Default)]
struct Longest {
    handler: u32,
    worst: Executed,
    most_instructions: Executed,
    /// Addresses of the instructions of that execution.
    addresses: Vec<u32>,
    executions: u64,
}

impl Longest {
    fn report(&self, name: &str, bound: &HandlerBound, image: &Image) {
        println!("{}", Profile::of(image, &self.addresses).unwrap());
        println!(
            "{name}: {} interrupts, worst {} instructions, {} cycles by the model; bound {} cycles, which is {:.2} times as much",
            self.executions,
            self.most_instructions.instructions,
            self.worst.cycles,
            bound.cycles,
            f64::from(bound.cycles) / f64::from(self.worst.cycles),
        );
        assert!(self.executions > 0);
    }
}

/// Most cycles found.
#[derive(Clone, Copy, Default)]
struct Found {
    control: u32,
    /// Of a control interrupt and the update after it.
    tick: u32,
}

/// What a search maximises, one after the other.
const OBJECTIVES: [fn(Found) -> u32; 2] = [|found| found.control, |found| found.tick];

/// Returns each scenario with each objective.
fn searches<'a>(names: &'a [&'a str]) -> impl Iterator<Item = (&'a str, fn(Found) -> u32)> {
    let with_objectives = |name: &&'a str| {
        let name = *name;
        OBJECTIVES.map(|of| (name, of))
    };
    names.iter().flat_map(with_objectives)
}

/// Compares executed interrupts with their bounds.
struct BoundCheck<'a> {
    bound: &'a Bound,
    tracer: Tracer<'a>,
    control: Longest,
    /// Control interrupts that start the estimates.
    starting: Longest,
    update: Longest,
    /// Most cycles and instructions of a control interrupt and the update after it.
    worst_tick: Executed,
    /// The last control interrupt.
    last_control: Executed,
    /// Whether it has started the estimates.
    starts: bool,
}

impl<'a> BoundCheck<'a> {
    fn new(image: &'a Image, bound: &'a Bound) -> Self {
        let longest = |handler: &str| Longest {
            handler: image.function(handler).unwrap(),
            ..Longest::default()
        };
        Self {
            bound,
            tracer: Tracer::new(image).unwrap(),
            control: longest(CONTROL_INTERRUPT),
            starting: longest(CONTROL_INTERRUPT),
            update: longest(UPDATE_INTERRUPT),
            worst_tick: Executed::default(),
            last_control: Executed::default(),
            starts: false,
        }
    }

    /// Returns the most cycles of the ticks executed since the last call.
    fn look<C: BoardChip>(&mut self, board: &mut EmulatedBoard<C>) -> Found {
        let mut found = Found::default();
        for addresses in board.machine.take_traces() {
            let mut executed = addresses.iter();
            let left_out = executed.any(|it| self.bound.not_called.contains(it));
            assert!(!left_out, "a tick calls what the bound leaves out");
            let cost = self.tracer.cost(&addresses).unwrap();
            for one in &self.bound.loops {
                if let Limit::Times(times) = one.limit {
                    let gone = rounds(one, &addresses);
                    assert!(gone <= times, "{gone} rounds of {one:?}");
                }
            }
            let is_control = addresses[0] == self.control.handler;
            if is_control {
                self.starts = addresses.contains(&self.bound.evaluates);
            }
            let mut executed = addresses.iter();
            let at_start = &self.bound.not_called_at_start;
            let left_out = self.starts && executed.any(|it| at_start.contains(it));
            assert!(
                !left_out,
                "a tick that starts calls what the bound leaves out"
            );
            let (longest, bound) = if is_control {
                self.last_control = cost.clone();
                found.control = found.control.max(cost.cycles);
                let longest = if self.starts {
                    &mut self.starting
                } else {
                    &mut self.control
                };
                (longest, &self.bound.control)
            } else {
                let tick = Executed {
                    cycles: self.last_control.cycles + cost.cycles,
                    instructions: self.last_control.instructions + cost.instructions,
                };
                found.tick = found.tick.max(tick.cycles);
                if tick.cycles > self.worst_tick.cycles {
                    self.worst_tick = tick;
                }
                (&mut self.update, &self.bound.update)
            };
            assert_eq!(addresses[0], longest.handler);
            assert!(
                cost.cycles <= bound.cycles,
                "{cost:?} of 0x{:x} is beyond {}",
                longest.handler,
                bound.cycles
            );
            longest.executions += 1;
            if cost.cycles > longest.worst.cycles {
                longest.worst = cost.clone();
            }
            if cost.instructions > longest.most_instructions.instructions {
                longest.most_instructions = cost;
                longest.addresses = addresses;
            }
        }
        found
    }
}

/// Returns the image of a board.
pub fn flashed<C: BoardChip>() -> Image {
    let path = painleve_tests::built_image(C::IMAGE);
    Image::of(&path, &std::fs::read(&path).unwrap()).unwrap()
}

fn with_bound<C: BoardChip>(run: impl FnOnce(&mut BoundCheck<'_>)) {
    let image = flashed::<C>();
    let bound = Bound::of(&image).unwrap_or_else(|error| panic!("{error}"));
    let mut watch = BoundCheck::new(&image, &bound);
    run(&mut watch);
    watch.update.report("update", &bound.update, &image);
    watch.control.report("control", &bound.control, &image);
    println!(
        "both in a tick: {} instructions, {} cycles by the model; bound {} cycles",
        watch.worst_tick.instructions, watch.worst_tick.cycles, bound.tick_cycles,
    );
    let started = &watch.starting;
    println!(
        "{} control interrupts have started the estimates, with at most {} instructions, {} cycles",
        started.executions, started.most_instructions.instructions, started.worst.cycles,
    );
    assert!(watch.worst_tick.cycles <= bound.tick_cycles);
}

/// Starts recording the control interrupt and the update.
fn trace_ticks<C: BoardChip>(board: &mut EmulatedBoard<C>) {
    let handler = |name| board.machine.symbol(name).unwrap();
    let handlers = [CONTROL_INTERRUPT, UPDATE_INTERRUPT].map(handler);
    board.machine.trace(&handlers);
}

fn traced(mut board: FlashedBoard) -> FlashedBoard {
    trace_ticks(&mut board);
    board
}

fn configured(scenario: &Scenario) -> FlashedBoard {
    let mut board = FlashedBoard::booted();
    board
        .configure(FrameSource::Lockstep, &encoded(scenario))
        .unwrap();
    traced(board)
}

/// Built-in scenarios with a simulated arm and frames over the serial line.
#[test]
#[ignore = "every scenario, as in QEMU"]
fn scenarios_stay_below_the_bound() {
    with_bound::<F405>(|watch| {
        for name in built_in::names() {
            let scenario = scenario(name);
            let mut simulation = Simulation::new(&scenario).unwrap();
            let mut statistics = Statistics::new(0.05);
            let mut board = configured(&scenario);
            let ticks = tries(300).min(scenario.run.ticks());
            for _ in 0..ticks {
                let frame = simulation.sample(&mut statistics).unwrap();
                let answer = board.exchange(&frame).expect("an answer in time");
                simulation.advance(Some(&answer), &mut statistics).unwrap();
                watch.look(&mut board);
            }
        }
    });
}

/// The arm on the board's own sensors.
#[test]
fn ticks_with_sensors_stay_below_the_bound() {
    ticks_with_sensors::<F405>();
}

#[test]
fn ticks_of_the_nucleo_stay_below_the_bound() {
    ticks_with_sensors::<G474>();
}

fn ticks_with_sensors<C: BoardChip>() {
    with_bound::<C>(|watch| {
        sensor_interrupts::<C>(watch.bound, &mut watch.tracer);
        let mut bench = Bench::<C>::new(&scenario("hybrid-elbow-down"));
        trace_ticks(&mut bench.board);
        bench.drive();
        for _ in 0..50 {
            bench.tick();
            watch.look(&mut bench.board);
        }
    });
}

/// Compares the interrupts that read the sensors, one on each channel and two, with their bounds.
fn sensor_interrupts<C: BoardChip>(bound: &Bound, tracer: &mut Tracer<'_>) {
    for (scenario, most) in [
        (with_one_sensor("hybrid-elbow-down"), bound.sensor_cycles),
        (scenario("hybrid-elbow-down"), bound.sensor_cycles_of_both),
    ] {
        let mut bench = Bench::<C>::new(&scenario);
        let handler = |name| bench.board.machine.symbol(name).unwrap();
        let handlers = SENSOR_INTERRUPTS.map(handler);
        bench.board.machine.trace(&handlers);
        bench.drive();
        bench.board.machine.take_traces();
        let (mut longest, mut worst_tick, mut executions) = (0, 0, 0);
        for _ in 0..50 {
            bench.tick();
            let traces = bench.board.machine.take_traces();
            let cycles = traces.iter().map(|it| {
                let busy = without_waits(&bound.loops, it);
                tracer.cost(&busy.addresses).unwrap().cycles + busy.waited_cycles
            });
            let cycles: Vec<u32> = cycles.collect();
            executions += cycles.len();
            worst_tick = worst_tick.max(cycles.iter().sum());
            longest = cycles.into_iter().fold(longest, u32::max);
        }
        println!(
            "{executions} interrupts of sensors, worst {longest} cycles by the model, {worst_tick} in a tick; bound {} cycles, {most} in a tick",
            bound.longest_sensor_cycles,
        );
        assert!(executions > 0);
        assert!(longest <= bound.longest_sensor_cycles && worst_tick <= most);
    }
}

/// Ports of the pins, on a bus that runs at the core's clock (RM0090, sections 2.1 and 8.1).
const PORTS: std::ops::Range<u32> = 0x4002_0000..0x4002_2400;

/// The bound charges the wait for a peripheral where it knows the address. Executed interrupts access others only
/// where that is not needed.
#[test]
fn peripherals_at_addresses_computed_at_run_time_are_those_of_pins() {
    let bound = Bound::of(&flashed::<F405>()).unwrap_or_else(|error| panic!("{error}"));
    let mut charged = 0;
    let [encoders, force] = SENSOR_INTERRUPTS;
    for handler in [CONTROL_INTERRUPT, UPDATE_INTERRUPT, encoders, force] {
        let mut bench = BoardBench::new(&scenario("hybrid-elbow-down"));
        let handler = bench.board.machine.symbol(handler).unwrap();
        bench.board.machine.trace(&[handler]);
        bench.drive();
        // The drive stops, too.
        bench.board.enable(false);
        (0..50).for_each(|_| bench.tick());
        let accesses = bench.board.machine.peripheral_accesses();
        assert!(!accesses.is_empty());
        let (known, others): (Vec<_>, Vec<_>) = accesses
            .into_iter()
            .partition(|(instruction, _)| bound.peripheral_accesses.contains(instruction));
        charged += known.len();
        // The core's own registers are on no bus.
        let others: Vec<_> = others
            .iter()
            .filter(|(_, address)| *address < 0xe000_0000 && !PORTS.contains(address))
            .collect();
        assert!(others.is_empty(), "not charged: {others:x?}");
    }
    assert!(charged > 0);
}

/// Frames of a closed loop with random disturbances.
#[test]
#[ignore = "a search for the worst tick"]
fn random_frames_stay_below_the_bound() {
    with_bound::<F405>(|watch| {
        let names: Vec<&str> = built_in::names().collect();
        let all = tries(400);
        let mut random = Random(1);
        for (place, name) in names.iter().enumerate() {
            let scenario = scenario(name);
            let mut simulation = Simulation::new(&scenario).unwrap();
            let mut statistics = Statistics::new(0.05);
            let mut board = configured(&scenario);
            for tick in 0..all / names.len() as u64 {
                let mut frame = simulation.sample(&mut statistics).unwrap();
                if random.below(4) == 0 {
                    frame = mutated(&frame, &mut random);
                }
                if place % 2 == 1 && tick % 50 == 49 {
                    board
                        .configure(FrameSource::Lockstep, &encoded(&scenario))
                        .unwrap();
                }
                let answer = board.exchange(&frame);
                simulation
                    .advance(answer.as_ref(), &mut statistics)
                    .unwrap();
                watch.look(&mut board);
            }
        }
    });
}

/// Frames under one set of random settings.
const FRAMES_PER_SETTINGS: u64 = 100;

/// Executes ticks with random valid settings and random frames, and returns the settings.
fn random_settings(watch: &mut BoundCheck<'_>, number: u64) -> String {
    let mut random = Random(number << 32);
    let names: Vec<&str> = built_in::names().collect();
    let name = names[(number % names.len() as u64) as usize];
    let (scenario, settings) = with_random_settings(scenario(name), &mut random);
    random_frames(watch, &scenario, &mut random);
    format!("{name}{settings}")
}

/// Executes ticks of a closed loop with random disturbances of the frames, and returns the most cycles.
fn random_frames(watch: &mut BoundCheck<'_>, scenario: &Scenario, random: &mut Random) -> Found {
    let mut board = FlashedBoard::booted();
    let response = board.configure(FrameSource::Lockstep, &encoded(scenario));
    assert!(
        matches!(response, Some(Response::Ready { .. })),
        "{response:?} to {scenario:?}"
    );
    let mut board = traced(board);
    let mut simulation = Simulation::new(scenario).unwrap();
    let mut statistics = Statistics::new(0.05);
    let mut last = SensorFrame::default();
    let mut continues = true;
    let mut most = Found::default();
    for _ in 0..FRAMES_PER_SETTINGS {
        // An arm that jams under random torques leaves its last frame to be disturbed.
        let sampled = continues.then(|| simulation.sample(&mut statistics).ok());
        let mut frame = sampled.flatten().unwrap_or(SensorFrame {
            tick: last.tick.wrapping_add(1),
            sequence: last.sequence.wrapping_add(1),
            ..last
        });
        last = frame;
        if !continues || random.below(4) == 0 {
            frame = mutated(&frame, random);
        }
        let answer = board.exchange(&frame);
        let found = watch.look(&mut board);
        most.control = most.control.max(found.control);
        most.tick = most.tick.max(found.tick);
        continues &= simulation.advance(answer.as_ref(), &mut statistics).is_ok();
    }
    most
}

/// Hill climbing on settings and frames: each attempt changes some settings of the worst so far, and executes
/// other random frames.
#[test]
#[ignore = "a search for the worst tick"]
fn the_worst_settings_found_by_a_search_stay_below_the_bound() {
    with_bound::<F405>(|watch| {
        let mut random = Random(3);
        let names = ["edge", "pid-elbow-down", "capture"];
        let attempts = tries(600).div_ceil(FRAMES_PER_SETTINGS * names.len() as u64);
        for (name, cycles_of) in searches(&names) {
            let (mut worst, mut most) = (scenario(name), 0);
            for _ in 0..attempts {
                let (tried, _) = with_random_settings(worst.clone(), &mut random);
                let cycles = cycles_of(random_frames(watch, &tried, &mut random));
                if cycles >= most {
                    (worst, most) = (tried, cycles);
                }
            }
        }
    });
}

/// Random valid settings of the controller, with frames of a closed loop with random disturbances.
/// The settings depend on their number alone, not on the number of threads.
#[test]
#[ignore = "a search for the worst tick"]
fn random_settings_stay_below_the_bound() {
    let bound = Bound::of(&flashed::<F405>()).unwrap_or_else(|error| panic!("{error}"));
    let settings = tries(800).div_ceil(FRAMES_PER_SETTINGS);
    let threads = std::thread::available_parallelism().map_or(1, |it| it.get() as u64);
    // What was found, and the settings with most cycles.
    let run = |thread: u64| {
        let image = flashed::<F405>();
        let mut watch = BoundCheck::new(&image, &bound);
        let mut worst = String::new();
        for number in (thread..settings).step_by(threads as usize) {
            let before = watch.worst_tick.cycles;
            let name = random_settings(&mut watch, number);
            if watch.worst_tick.cycles > before {
                worst = name;
            }
        }
        let BoundCheck {
            control,
            starting,
            update,
            worst_tick,
            ..
        } = watch;
        ([control, starting, update], worst_tick, worst)
    };
    let found: Vec<_> = std::thread::scope(|scope| {
        let run = &run;
        let spawned: Vec<_> = (0..threads)
            .map(|thread| scope.spawn(move || run(thread)))
            .collect();
        let joined = spawned.into_iter().map(|it| it.join());
        joined.map(Result::unwrap).collect()
    });
    let kinds = [
        ("control", &bound.control),
        ("control, starting the estimates", &bound.control),
        ("update", &bound.update),
    ];
    for (handler, (name, bound)) in kinds.into_iter().enumerate() {
        let of = || found.iter().map(|(handlers, ..)| &handlers[handler]);
        let executions: u64 = of().map(|it| it.executions).sum();
        let most = of().map(|it| it.most_instructions.instructions).max();
        let cycles = of().map(|it| it.worst.cycles).max().unwrap();
        println!(
            "{name} of {settings} settings: {executions} interrupts, worst {} instructions, {cycles} cycles by the model; bound {} cycles, which is {:.2} times as much",
            most.unwrap(),
            bound.cycles,
            f64::from(bound.cycles) / f64::from(cycles),
        );
        assert!(executions >= settings);
    }
    let (_, tick, worst) = found.iter().max_by_key(|(_, tick, _)| tick.cycles).unwrap();
    println!(
        "both in a tick: {} instructions, {} cycles by the model\n{worst}",
        tick.instructions, tick.cycles
    );
}

/// Hill climbing: starts in the state before the worst tick of a closed loop and searches for more
/// expensive frames.
#[test]
#[ignore = "a search for the worst tick"]
fn the_worst_frames_found_by_a_search_stay_below_the_bound() {
    with_bound::<F405>(|watch| {
        let mut random = Random(2);
        let names = ["edge", "pid-elbow-down", "capture"];
        for (name, cycles_of) in searches(&names) {
            let scenario = scenario(name);
            let mut simulation = Simulation::new(&scenario).unwrap();
            let mut statistics = Statistics::new(0.05);
            let mut board = configured(&scenario);
            let mut start = (board.snapshot(), SensorFrame::default(), 0);
            for _ in 0..150 {
                let frame = simulation.sample(&mut statistics).unwrap();
                let before = board.snapshot();
                let answer = board.exchange(&frame);
                simulation
                    .advance(answer.as_ref(), &mut statistics)
                    .unwrap();
                let cycles = cycles_of(watch.look(&mut board));
                if cycles > start.2 {
                    start = (before, frame, cycles);
                }
            }
            // A sequence of frames from that state; each attempt disturbs one of them.
            let mut best = vec![start.1; 6];
            for (place, frame) in best.iter_mut().enumerate() {
                frame.tick = frame.tick.wrapping_add(place as u32);
                frame.sequence = frame.sequence.wrapping_add(place as u32);
            }
            let mut most = 0;
            for _ in 0..tries(60) / 3 {
                let mut tried = best.clone();
                let place = random.below(tried.len() as u64) as usize;
                tried[place] = mutated(&tried[place], &mut random);
                board.restore(&start.0);
                let mut cycles = 0;
                for frame in &tried {
                    board.exchange(frame);
                    cycles = cycles.max(cycles_of(watch.look(&mut board)));
                }
                if cycles >= most {
                    (most, best) = (cycles, tried);
                }
            }
        }
    });
}
