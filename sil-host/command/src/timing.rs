//! `painleve timing`: the cost of control ticks, on every host of the controller.

use std::path::PathBuf;

use clap::Args;
use painleve_board::emulator::{self, Emulator};
use painleve_board::timing::figure;
use painleve_board::timing::{Cyclictest, CyclictestError, Metronome, TimingReport, Unit, report};
use painleve_board::{ConnectedBoard, Drivers, OnBoard, SILENCE_LIMIT, Serial};
use painleve_chart::picture;
use painleve_files::atomic_file;
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::{ControllerHost, InProcess};
use painleve_plant::scenario::{Scenario, ScenarioError, built_in};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_process::realtime::{FIFO_PRIORITY, request_realtime};
use painleve_process::terminal::warn;
use painleve_shared::message::FrameSource;
use painleve_shared::status::Fault;

use super::output_error::output;
use super::run::Host;
use super::{CommandError, distinct_files, say};

/// Options of `painleve timing`.
#[derive(Debug, Args)]
pub struct TimingArguments {
    /// Built-in scenarios or TOML files; by default all built-in ones.
    #[arg(value_name = "SCENARIO")]
    names: Vec<String>,
    /// Override one key in all of them, for example run.tick_hz=10000; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Where the controller runs: qemu counts instructions, serial the cycles of a board, native the
    /// wake-up latencies of this PC.
    #[arg(long, value_enum, default_value = "qemu")]
    host: Host,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH", required_if_eq("host", "serial"))]
    port: Option<PathBuf>,
    /// The controller's image; by default the workspace's own build.
    #[arg(long, value_name = "PATH")]
    elf: Option<PathBuf>,
    /// With --host native: run cyclictest (Debian's package rt-tests) beside each scenario, at the same rate
    /// and priority. Its row shows the latency of the machine itself.
    #[arg(long)]
    cyclictest: bool,
    /// Print JSON on stdout instead of the table.
    #[arg(long)]
    json: bool,
    /// Write histograms as a figure, an SVG, PNG or PDF file by its extension.
    #[arg(long, value_name = "PATH", value_parser = super::figure_path())]
    svg: Option<PathBuf>,
}

impl TimingArguments {
    /// Returns the path of the emulated image.
    fn image(&self) -> PathBuf {
        self.elf.clone().unwrap_or_else(emulator::default_image)
    }
}

/// Runs every scenario and reports the cost of its ticks.
///
/// # Errors
/// [`CommandError`] if a scenario or image cannot be used, a run ends early, or a file cannot be written.
pub fn run(arguments: &TimingArguments) -> Result<(), CommandError> {
    let names: Vec<&str> = match arguments.names.as_slice() {
        [] => built_in::names().collect(),
        names => names.iter().map(String::as_str).collect(),
    };
    // All errors of the scenarios are reported before the first of them runs.
    let scenarios = names
        .iter()
        .map(|name| Scenario::load(name, &arguments.overrides))
        .collect::<Result<Vec<_>, _>>()?;
    use Host::{Qemu, Serial};
    arguments.host.check_options(&[
        ("--elf", arguments.elf.is_some(), &[Qemu]),
        ("--port", arguments.port.is_some(), &[Serial]),
    ])?;
    if arguments.host == Qemu {
        emulator::check(&arguments.image(), false)?;
    }
    if let Some(path) = &arguments.svg {
        distinct_files::check(&[("--svg", path)])?;
    }
    let interrupt = Interrupt::catch()?;
    if arguments.cyclictest && arguments.host != Host::Native {
        return Err(CyclictestError::OtherHost.into());
    }
    let mut priority = None;
    if arguments.host == Host::Native {
        let status = request_realtime();
        warn(format_args!("controller: {status}"));
        priority = status.scheduling.is_ok().then_some(FIFO_PRIORITY);
    }
    let mut reports = Vec::new();
    for scenario in &scenarios {
        let beside = arguments
            .cyclictest
            .then(|| Cyclictest::start(scenario.run.tick_hz, scenario.run.ticks(), priority))
            .transpose()?;
        let report = measure(arguments, scenario, &interrupt)?;
        if let Some(fault) = report.fault {
            warn(format_args!(
                "{}: the controller has latched fault {fault}; later ticks do less work than those of a driven arm",
                scenario.name
            ));
        }
        reports.push(report);
        if let Some(beside) = beside {
            reports.push(beside.finish()?);
        }
    }
    if let Some(path) = &arguments.svg {
        let picture = picture::encoded(path, figure::svg(&reports)).map_err(output)?;
        atomic_file::write(path, &picture).map_err(output)?;
    }
    if arguments.json {
        let text = serde_json::to_string(&reports).map_err(output)?;
        say(text)
    } else {
        say(report::table(&reports))
    }
}

fn measure(
    arguments: &TimingArguments,
    scenario: &Scenario,
    interrupt: &Interrupt,
) -> Result<TimingReport, CommandError> {
    let configuration = scenario.controller_configuration();
    match (arguments.host, &arguments.port) {
        (Host::Serial, Some(port)) => {
            let board = Serial::open(port, &configuration, FrameSource::Realtime, SILENCE_LIMIT)?;
            on_board(scenario, board, interrupt)
        }
        (Host::Drivers, _) => {
            let board = Drivers::new(&configuration, 0.0)?;
            on_board(scenario, board, interrupt)
        }
        (Host::Native, _) => by_the_clock(scenario, interrupt),
        (Host::Qemu | Host::Serial, _) => {
            let board = Emulator::start(&arguments.image(), &configuration, false, SILENCE_LIMIT)?;
            on_board(scenario, board, interrupt)
        }
    }
}

fn on_board<B: ConnectedBoard>(
    scenario: &Scenario,
    board: B,
    interrupt: &Interrupt,
) -> Result<TimingReport, CommandError> {
    let (OnBoard { mut board, times }, fault) = drive(scenario, OnBoard::new(board), interrupt)?;
    let tick_hz = scenario.run.tick_hz;
    let report = TimingReport::of_board(&scenario.name, tick_hz, &times, &mut board)?;
    Ok(TimingReport {
        fault: fault.map(|fault| fault as u8),
        ..report
    })
}

fn by_the_clock(scenario: &Scenario, interrupt: &Interrupt) -> Result<TimingReport, CommandError> {
    let configuration = scenario.controller_configuration();
    let range = |source| ScenarioError::range(&scenario.name, source);
    let controller = InProcess::new(&configuration).map_err(range)?;
    let metronome = Metronome::start(controller, &configuration)?;
    let (metronome, fault) = drive(scenario, metronome, interrupt)?;
    let (name, unit) = (&scenario.name, Unit::Nanoseconds);
    let tick_hz = scenario.run.tick_hz;
    let host = &Host::Native.name();
    Ok(TimingReport {
        missed_deadlines: metronome.missed_deadlines,
        fault: fault.map(|fault| fault as u8),
        ..TimingReport::new(name, tick_hz, host, "wake-up", unit, &metronome.lateness_ns)
    })
}

fn drive<H: ControllerHost>(
    scenario: &Scenario,
    host: H,
    interrupt: &Interrupt,
) -> Result<(H, Option<Fault>), CommandError> {
    let range = |source| ScenarioError::range(&scenario.name, source);
    let simulation = Simulation::new(scenario).map_err(range)?;
    let mut closed_loop = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut ())?;
        if interrupt.is_requested() {
            return Err(CommandError::Interrupted);
        }
    }
    let (result, host) = closed_loop.finish();
    Ok((host, result.fault))
}
