#![allow(clippy::unwrap_used)]
//! No executed tick exceeds the bound on the control interrupt under the same cost model: in closed
//! loops, with random frames and settings, and with those found by searches for the worst tick.
//!
//! `PAINLEVE_TICKS` sets the number of random frames and of search steps; random settings use all
//! processors.

use painleve_bound::image::Image;
use painleve_bound::loops::Limit;
use painleve_bound::profile::Profile;
use painleve_bound::report::{Bound, CONTROL_INTERRUPT, SENSOR_INTERRUPTS};
use painleve_bound::trace::{Executed, Tracer, rounds};
use painleve_flash_image::bench::{BoardBench, encoded, scenario};
use painleve_flash_image::board::{self, FlashedBoard};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::frame::{DigitalInputs, SensorFrame};
use painleve_shared::message::{FrameSource, Response};

mod random;

use random::{Random, mutated, with_random_settings};

fn tries(otherwise: u64) -> u64 {
    let asked = std::env::var("PAINLEVE_TICKS").ok();
    asked.and_then(|it| it.parse().ok()).unwrap_or(otherwise)
}

/// Compares executed interrupts with their bound.
struct BoundCheck<'a> {
    bound: &'a Bound,
    tracer: Tracer<'a>,
    worst: Executed,
    most_instructions: Executed,
    /// Addresses of the instructions of that interrupt.
    longest: Vec<u32>,
    ticks: u64,
}

impl<'a> BoundCheck<'a> {
    fn new(image: &'a Image, bound: &'a Bound) -> Self {
        Self {
            bound,
            tracer: Tracer::new(image).unwrap(),
            worst: Executed::default(),
            most_instructions: Executed::default(),
            longest: Vec::new(),
            ticks: 0,
        }
    }

    /// Returns the worst of the interrupts executed since the last call.
    fn look(&mut self, board: &mut FlashedBoard) -> Executed {
        let mut worst = Executed::default();
        for addresses in board.machine.take_traces() {
            let mut executed = addresses.iter();
            let left_out = executed.any(|it| self.bound.not_called.contains(it));
            assert!(!left_out, "a tick calls what the bound leaves out");
            let cost = self.tracer.cost(&addresses).unwrap();
            assert!(cost.cycles <= self.bound.cycles, "{cost:?}");
            for one in &self.bound.loops {
                if let Limit::Times(times) = one.limit {
                    let gone = rounds(one, &addresses);
                    assert!(gone <= times, "{gone} rounds of {one:?}");
                }
            }
            if cost.instructions > self.most_instructions.instructions {
                self.most_instructions = cost.clone();
                self.longest = addresses;
            }
            if cost.cycles > worst.cycles {
                worst = cost;
            }
            self.ticks += 1;
        }
        if worst.cycles > self.worst.cycles {
            self.worst = worst.clone();
        }
        worst
    }
}

fn with_bound(run: impl FnOnce(&mut BoundCheck<'_>)) {
    let image = Image::read(&board::image("painleve-f405")).unwrap();
    let bound = Bound::of(&board::image("painleve-f405")).unwrap_or_else(|error| panic!("{error}"));
    let mut watch = BoundCheck::new(&image, &bound);
    run(&mut watch);
    println!("{}", Profile::of(&image, &watch.longest).unwrap());
    println!(
        "{} interrupts, worst {} instructions, {} cycles by the model; bound {} cycles, which is {:.2} times as much",
        watch.ticks,
        watch.most_instructions.instructions,
        watch.worst.cycles,
        bound.cycles,
        f64::from(bound.cycles) / f64::from(watch.worst.cycles),
    );
    assert!(watch.ticks > 0);
}

fn traced(mut board: FlashedBoard) -> FlashedBoard {
    let handler = board.machine.symbol(CONTROL_INTERRUPT).unwrap();
    board.machine.trace(handler);
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
fn scenarios_stay_below_the_bound() {
    with_bound(|watch| {
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
    with_bound(|watch| {
        let mut bench = BoardBench::new(&scenario("hybrid-elbow-down"));
        let handler = bench.board.machine.symbol(CONTROL_INTERRUPT).unwrap();
        bench.board.machine.trace(handler);
        bench.drive();
        for _ in 0..50 {
            bench.tick();
            watch.look(&mut bench.board);
        }
    });
}

/// Ports of the pins, on a bus that runs at the core's clock (RM0090, sections 2.1 and 8.1).
const PORTS: std::ops::Range<u32> = 0x4002_0000..0x4002_2400;

/// The bound charges the wait for a peripheral where it knows the address. Executed interrupts access others only
/// where that is not needed.
#[test]
fn peripherals_at_addresses_computed_at_run_time_are_those_of_pins() {
    let bound = Bound::of(&board::image("painleve-f405")).unwrap_or_else(|error| panic!("{error}"));
    let mut charged = 0;
    let [encoders, force] = SENSOR_INTERRUPTS;
    for handler in [CONTROL_INTERRUPT, encoders, force] {
        let mut bench = BoardBench::new(&scenario("hybrid-elbow-down"));
        let handler = bench.board.machine.symbol(handler).unwrap();
        bench.board.machine.trace(handler);
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

/// Hill climbing with the board's own sensors: starts in the state before the worst tick of a closed loop, and
/// searches for readings and positions of the switch that make one of the next ticks more expensive.
#[test]
fn the_worst_readings_found_by_a_search_stay_below_the_bound() {
    with_bound(|watch| {
        let mut random = Random(4);
        for name in ["hybrid-elbow-down", "pid-elbow-down", "capture"] {
            let mut bench = BoardBench::new(&scenario(name));
            let handler = bench.board.machine.symbol(CONTROL_INTERRUPT).unwrap();
            bench.board.machine.trace(handler);
            bench.drive();
            watch.look(&mut bench.board);
            let mut start = (bench.snapshot(), 0);
            for _ in 0..50 {
                let before = bench.snapshot();
                bench.tick();
                let cycles = watch.look(&mut bench.board).cycles;
                if cycles > start.1 {
                    start = (before, cycles);
                }
            }
            bench.restore(&start.0);
            // The readings of the next ticks; each attempt disturbs those of one.
            let mut best = [bench.frame; 6];
            let mut most = 0;
            for _ in 0..tries(60) / 3 {
                let mut tried = best;
                let place = random.below(tried.len() as u64) as usize;
                tried[place] = mutated(&tried[place], &mut random);
                bench.restore(&start.0);
                let mut cycles = 0;
                for frame in tried {
                    bench.show(frame);
                    bench
                        .board
                        .enable(frame.inputs.contains(DigitalInputs::ENABLE));
                    bench.wait_for_tick();
                    cycles = cycles.max(watch.look(&mut bench.board).cycles);
                }
                if cycles >= most {
                    (most, best) = (cycles, tried);
                }
            }
        }
    });
}

/// Frames of a closed loop with random disturbances.
#[test]
fn random_frames_stay_below_the_bound() {
    with_bound(|watch| {
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
fn random_frames(watch: &mut BoundCheck<'_>, scenario: &Scenario, random: &mut Random) -> u32 {
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
    let mut most = 0;
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
        most = most.max(watch.look(&mut board).cycles);
        continues &= simulation.advance(answer.as_ref(), &mut statistics).is_ok();
    }
    most
}

/// Hill climbing on settings and frames: each attempt changes some settings of the worst so far, and executes
/// other random frames.
#[test]
fn the_worst_settings_found_by_a_search_stay_below_the_bound() {
    with_bound(|watch| {
        let mut random = Random(3);
        let names = ["edge", "pid-elbow-down", "capture"];
        let attempts = tries(600).div_ceil(FRAMES_PER_SETTINGS * names.len() as u64);
        for name in names {
            let (mut worst, mut most) = (scenario(name), 0);
            for _ in 0..attempts {
                let (tried, _) = with_random_settings(worst.clone(), &mut random);
                let cycles = random_frames(watch, &tried, &mut random);
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
fn random_settings_stay_below_the_bound() {
    let bound = Bound::of(&board::image("painleve-f405")).unwrap_or_else(|error| panic!("{error}"));
    let settings = tries(800).div_ceil(FRAMES_PER_SETTINGS);
    let threads = std::thread::available_parallelism().map_or(1, |it| it.get() as u64);
    // Ticks, most instructions, most cycles and the settings with these.
    let run = |thread: u64| {
        let image = Image::read(&board::image("painleve-f405")).unwrap();
        let mut watch = BoundCheck::new(&image, &bound);
        let mut worst = String::new();
        for number in (thread..settings).step_by(threads as usize) {
            let before = watch.worst.cycles;
            let name = random_settings(&mut watch, number);
            if watch.worst.cycles > before {
                worst = name;
            }
        }
        let most = watch.most_instructions.instructions;
        (watch.ticks, most, watch.worst.cycles, worst)
    };
    let found: Vec<_> = std::thread::scope(|scope| {
        let run = &run;
        let spawned: Vec<_> = (0..threads)
            .map(|thread| scope.spawn(move || run(thread)))
            .collect();
        let joined = spawned.into_iter().map(|it| it.join());
        joined.map(Result::unwrap).collect()
    });
    let ticks: u64 = found.iter().map(|it| it.0).sum();
    let instructions = found.iter().map(|it| it.1).max().unwrap();
    let (_, _, cycles, worst) = found.iter().max_by_key(|it| it.2).unwrap();
    println!(
        "{settings} settings, {ticks} interrupts, worst {instructions} instructions, {cycles} cycles by the model; bound {} cycles, which is {:.2} times as much\n{worst}",
        bound.cycles,
        f64::from(bound.cycles) / f64::from(*cycles),
    );
    assert!(ticks >= settings);
}

/// Hill climbing: starts in the state before the worst tick of a closed loop and searches for more
/// expensive frames.
#[test]
fn the_worst_frames_found_by_a_search_stay_below_the_bound() {
    with_bound(|watch| {
        let mut random = Random(2);
        for name in ["edge", "pid-elbow-down", "capture"] {
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
                let cycles = watch.look(&mut board).cycles;
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
                    cycles = cycles.max(watch.look(&mut board).cycles);
                }
                if cycles >= most {
                    (most, best) = (cycles, tried);
                }
            }
        }
    });
}
