//! Cost of the link: the exchange of a sensor frame and an actuator frame between two processes,
//! alone and as part of a lockstep tick, with the plant at one end and the controller at the other.
//!
//! Besides criterion's time per round trip it prints round trips per second and their percentiles.
//! The maximum depends on the scheduler more than on the link.
//!
//! Each process is pinned to a processor of its own. Then both share one, as on a busy machine, beside
//! two processes that wake each other with a bare eventfd: the least that a change of process costs there.
//! All measurements take turns, so that they see the same machine.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::process::{Child, Command, ExitCode};
use std::time::{Duration, Instant};

use criterion::Criterion;
use hdrhistogram::Histogram;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::sys::eventfd::EventFd;
use nix::unistd::Pid;
use painleve_link::lockstep::Lockstep;
use painleve_link::{BusName, ControllerEnd, LinkError, Pacing, PlantEnd, Received, Session};
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

/// Environment variable of the second process: the bus on which it answers.
const BUS: &str = "PAINLEVE_BENCH_BUS";
/// Its value where the second process answers on its standard input and output.
const STANDARD_STREAMS: &str = "-";
/// Turns of each measurement, and round trips of a turn.
const TURNS: usize = 5;
const ROUND_TRIPS: u32 = 100_000;
/// Long enough for criterion's analysis, during which no frames are sent.
const PATIENCE: Duration = Duration::from_secs(60);

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    let outcome = match std::env::var(BUS) {
        Ok(bus) if bus == STANDARD_STREAMS => answer_events(),
        Ok(bus) => answer_all(&bus),
        Err(_) => bench(),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn bench() -> Outcome<()> {
    let processors = Processors::of_this_process()?;
    let shared = Processors {
        peers: processors.own,
        ..processors
    };
    pin(Pid::this(), processors.own)?;
    // `cargo test` runs benches once, without `--bench`.
    if std::env::args().any(|argument| argument == "--bench") {
        let (mut alone, mut lockstep) = (RoundTrips::new()?, RoundTrips::new()?);
        let (mut events, mut crowded) = (RoundTrips::new()?, RoundTrips::new()?);
        for _ in 0..TURNS {
            let mut ping_pong = PingPong::start(&processors)?;
            alone.add_turn(|| ping_pong.round_trip())?;
            ping_pong.end()?;
            add_lockstep_turn(&mut lockstep, &processors)?;
            add_event_turn(&mut events, &shared)?;
            add_lockstep_turn(&mut crowded, &shared)?;
        }
        println!("bare ping-pong of the frames: {alone}");
        println!("lockstep run, plant included: {lockstep}");
        println!("eventfd on one processor: {events}");
        println!("lockstep run on one processor: {crowded}\n");
    }
    let mut ping_pong = PingPong::start(&processors)?;
    let mut criterion = Criterion::default().configure_from_args();
    let mut failure = None;
    criterion.bench_function("link/ping_pong", |bencher| {
        bencher.iter(|| {
            if failure.is_none() {
                failure = ping_pong.round_trip().err();
            }
        })
    });
    criterion.final_summary();
    match failure {
        Some(error) => Err(error.into()),
        None => ping_pong.end(),
    }
}

/// A processor for each of the two processes.
struct Processors {
    own: usize,
    peers: usize,
}

impl Processors {
    /// Returns the last two that this process may use, or twice the only one.
    fn of_this_process() -> Outcome<Self> {
        let allowed = sched_getaffinity(Pid::this())?;
        let may_use = |it: &usize| allowed.is_set(*it).unwrap_or(false);
        let mut last = (0..CpuSet::count()).rev().filter(may_use);
        let own = last.next().unwrap_or_default();
        Ok(Self {
            own,
            peers: last.next().unwrap_or(own),
        })
    }
}

/// Keeps a process on one processor; threads that it has started already stay where they are.
fn pin(process: Pid, processor: usize) -> Outcome<()> {
    let mut only = CpuSet::new();
    only.set(processor)?;
    Ok(sched_setaffinity(process, &only)?)
}

/// Runs the default scenario against the program's own controller process.
fn add_lockstep_turn(round_trips: &mut RoundTrips, processors: &Processors) -> Outcome<()> {
    let scenario = Scenario::load(built_in::DEFAULT, &["run.duration_s=1000".into()])?;
    let bus = BusName::unique();
    let session = Session::new(&scenario, Pacing::Lockstep)?;
    let mut plant = PlantEnd::create(&bus, None, &session, &Interrupt::default())?;
    let mut controller = AnsweringProcess(
        Command::new(env!("CARGO_BIN_EXE_painleve"))
            .args(["controller", "--wait-s", "5", "--bus", bus.as_str()])
            .spawn()?,
    );
    controller.pin(processors)?;
    plant.wait_for_controller(Duration::from_secs(5))?;
    let mut closed_loop = ClosedLoop::new(
        Simulation::new(&scenario)?,
        Lockstep {
            end: plant,
            skip: Duration::ZERO,
        },
    );
    round_trips.add_turn(|| closed_loop.tick(&mut ()))?;
    closed_loop.finish().1.end.end()?;
    controller.0.wait()?;
    Ok(())
}

/// Exchanges events with a second process that answers each.
fn add_event_turn(round_trips: &mut RoundTrips, processors: &Processors) -> Outcome<()> {
    let (questions, answers) = (EventFd::new()?, EventFd::new()?);
    let shared = |event: &EventFd| event.as_fd().try_clone_to_owned();
    let mut echo = AnsweringProcess(
        Command::new(std::env::current_exe()?)
            .env(BUS, STANDARD_STREAMS)
            .stdin(shared(&questions)?)
            .stdout(shared(&answers)?)
            .spawn()?,
    );
    echo.pin(processors)?;
    round_trips.add_turn(|| {
        questions.write(1)?;
        answers.read().map(|_| ())
    })?;
    // Two events at once end the process.
    questions.write(2)?;
    echo.0.wait()?;
    Ok(())
}

/// Answers every event on standard input with one on standard output.
fn answer_events() -> Outcome<()> {
    let mut questions = File::from(std::io::stdin().as_fd().try_clone_to_owned()?);
    let mut answers = File::from(std::io::stdout().as_fd().try_clone_to_owned()?);
    let mut event = [0; 8];
    loop {
        questions.read_exact(&mut event)?;
        if u64::from_ne_bytes(event) > 1 {
            return Ok(());
        }
        answers.write_all(&event)?;
    }
}

/// The exchange of frames with a second process that echoes them.
struct PingPong {
    plant: PlantEnd,
    echo: AnsweringProcess,
    tick: u32,
}

impl PingPong {
    fn start(processors: &Processors) -> Outcome<Self> {
        let bus = BusName::unique();
        let session = Session {
            tick_hz: 1000,
            pacing: Pacing::Lockstep,
            configuration: Vec::new(),
        };
        let mut plant = PlantEnd::create(&bus, None, &session, &Interrupt::default())?;
        let echo = AnsweringProcess::start(&bus)?;
        echo.pin(processors)?;
        plant.wait_for_controller(Duration::from_secs(5))?;
        Ok(Self {
            plant,
            echo,
            tick: 0,
        })
    }

    fn round_trip(&mut self) -> Result<(), LinkError> {
        self.tick = self.tick.wrapping_add(1);
        self.plant.exchange(&SensorFrame {
            tick: self.tick,
            sequence: self.tick,
            ..SensorFrame::default()
        })?;
        Ok(())
    }

    fn end(mut self) -> Outcome<()> {
        self.plant.end()?;
        self.echo.0.wait()?;
        Ok(())
    }
}

/// The answering process; killed if the bench fails.
struct AnsweringProcess(Child);

impl AnsweringProcess {
    fn start(bus: &BusName) -> Outcome<Self> {
        let echo = Command::new(std::env::current_exe()?)
            .env(BUS, bus.as_str())
            .spawn()?;
        Ok(Self(echo))
    }

    fn pin(&self, processors: &Processors) -> Outcome<()> {
        pin(Pid::from_raw(self.0.id().try_into()?), processors.peers)
    }
}

impl Drop for AnsweringProcess {
    fn drop(&mut self) {
        // Both calls fail only if the process has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn answer_all(bus: &str) -> Outcome<()> {
    let (mut controller, _) = ControllerEnd::open(
        &bus.parse()?,
        None,
        Duration::from_secs(5),
        PATIENCE,
        &Interrupt::default(),
    )?;
    while let Received::Frame(frame) = controller.receive()? {
        controller.send(&ActuatorFrame {
            tick: frame.tick,
            sequence: frame.sequence,
            ..ActuatorFrame::default()
        })?;
    }
    Ok(())
}

/// The times of many round trips.
struct RoundTrips {
    /// Round trips per second of each turn.
    rates_per_s: Vec<f64>,
    latency_ns: Histogram<u32>,
}

impl RoundTrips {
    fn new() -> Outcome<Self> {
        Ok(Self {
            rates_per_s: Vec::new(),
            latency_ns: Histogram::new(3)?,
        })
    }

    fn add_turn<E: std::error::Error + 'static>(
        &mut self,
        mut round_trip: impl FnMut() -> Result<(), E>,
    ) -> Outcome<()> {
        for _ in 0..ROUND_TRIPS / 10 {
            round_trip()?;
        }
        let start = Instant::now();
        let mut last = start;
        for _ in 0..ROUND_TRIPS {
            round_trip()?;
            let now = Instant::now();
            self.latency_ns.record((now - last).as_nanos() as u64)?;
            last = now;
        }
        let rate_per_s = f64::from(ROUND_TRIPS) / start.elapsed().as_secs_f64();
        self.rates_per_s.push(rate_per_s);
        Ok(())
    }

    fn median_per_s(&self) -> f64 {
        let mut rates = self.rates_per_s.clone();
        rates.sort_by(f64::total_cmp);
        rates.get(rates.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

impl std::fmt::Display for RoundTrips {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let us = |quantile| self.latency_ns.value_at_quantile(quantile) as f64 * 1e-3;
        write!(
            f,
            "{:.0} round trips/s, in µs: p50 {:.2}, p99 {:.2}, p99.9 {:.2}, max {:.1}",
            self.median_per_s(),
            us(0.5),
            us(0.99),
            us(0.999),
            self.latency_ns.max() as f64 * 1e-3
        )
    }
}
