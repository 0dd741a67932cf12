//! `painleve plant`: the simulated belt and arm in their own process.

use std::time::{Duration, Instant};

use clap::Args;
use painleve_firmware::supervise::lapses::Lapse;
use painleve_link::lockstep::Lockstep;
use painleve_link::paced::Paced;
use painleve_link::{BusName, Pacing, Pair, PlantEnd, Session};
use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::ControllerHost;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_process::realtime::request_realtime;
use painleve_record::report::{DurationPercentiles, RunReport};
use painleve_shared::status::Fault;
use serde::{Deserialize, Serialize};

use super::output::{Output, OutputArguments};
use super::output_error::output;
use super::patience::{PatienceArguments, WAIT_S};
use super::process_error::ProcessError;
use super::scenario::ScenarioArguments;
use super::{CommandError, INTERRUPTED, PEER_FAILED, or_interrupted, say};

/// Options of `painleve plant`.
#[derive(Debug, Args, Serialize, Deserialize)]
pub struct PlantArguments {
    #[command(flatten)]
    pub scenario: ScenarioArguments,
    /// Bus on which to wait for the controller.
    #[arg(long)]
    pub bus: BusName,
    #[command(flatten)]
    pub output: OutputArguments,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Longest wait for the controller, s.
    #[arg(long, value_name = "SECONDS", default_value_t = WAIT_S, value_parser = super::seconds)]
    pub wait_s: f64,
    #[command(flatten)]
    pub patience: PatienceArguments,
    /// Name of the controller's host in the report.
    #[arg(skip = "native".to_owned())]
    pub host_name: String,
    /// In real time, but paced by the board: wait for its answers.
    #[arg(skip)]
    pub board_keeps_time: bool,
    /// Set by `painleve run`: admit only the controller with the same mark, and leave the messages
    /// about an interruption and about the peer to `run`.
    #[arg(skip)]
    pub pair: Option<Pair>,
    /// Print errors and warnings only: set by `painleve run`.
    #[arg(skip)]
    pub quiet: bool,
}

/// Runs a scenario against the controller on the bus.
///
/// # Errors
/// [`CommandError`] if the scenario is invalid, the run ends early, or a file cannot be written.
pub fn run(arguments: &PlantArguments) -> Result<(), CommandError> {
    let interrupt = Interrupt::catch()?;
    let started_by_run = arguments.pair.is_some();
    match run_until(arguments, &interrupt) {
        Err(error) if started_by_run && error.exit_code() == INTERRUPTED => {
            Err(CommandError::Told { code: INTERRUPTED })
        }
        // The bridge of a board may know the cause: `run` prints one of the two messages.
        Err(error) if started_by_run && error.exit_code() == PEER_FAILED => {
            let message = error.to_string();
            if !message.is_empty() {
                say(message)?;
            }
            Err(CommandError::Told { code: PEER_FAILED })
        }
        other => other,
    }
}

fn run_until(arguments: &PlantArguments, interrupt: &Interrupt) -> Result<(), CommandError> {
    let scenario = arguments.scenario.load()?;
    let mut output = Output::open(&arguments.output, &scenario, interrupt.clone())?;
    match simulate(arguments, &scenario, interrupt, &mut output) {
        Ok(mut report) => {
            let (files, written) = output.finish();
            report.files = files;
            print(&report, arguments.json)?;
            written?;
            match report.fault.and_then(Fault::from_code) {
                Some(fault)
                    if arguments.scenario.pacing == Pacing::Realtime && is_of_deadlines(fault) =>
                {
                    Err(CommandError::DeadlinesMissed(fault))
                }
                _ => Ok(()),
            }
        }
        Err(error) => {
            let error = or_interrupted(Err(error), interrupt);
            if let Err(reason) = &error {
                output.keep_partial(&reason.to_string());
            }
            error
        }
    }
}

/// Returns whether a fault reports late or lost ticks rather than a problem of the arm.
fn is_of_deadlines(fault: Fault) -> bool {
    [Lapse::Overrun, Lapse::MissingFrame, Lapse::LostFrame]
        .into_iter()
        .any(|lapse| lapse.fault() == fault)
}

/// Runs the scenario to its end.
fn simulate(
    arguments: &PlantArguments,
    scenario: &Scenario,
    interrupt: &Interrupt,
    output: &mut Output,
) -> Result<RunReport, CommandError> {
    let range = |source| ScenarioError::range(&scenario.name, source);
    let simulation = Simulation::new(scenario).map_err(range)?;
    let pacing = arguments.scenario.pacing;
    let session = Session::new(scenario, pacing).map_err(ProcessError::Unsendable)?;
    let mut end = PlantEnd::create(&arguments.bus, arguments.pair, &session, interrupt)?;
    end.set_silence_limit(arguments.patience.peer());
    end.wait_for_controller(Duration::from_secs_f64(arguments.wait_s))?;

    let external = end.external_controller();
    let name = match &external {
        Some(_) => "external",
        None => arguments.host_name.as_str(),
    };
    let mut report = match pacing {
        Pacing::Realtime if !arguments.board_keeps_time => {
            request_realtime().tell("plant", arguments.quiet);
            let paced = Paced::start(end, scenario.run.tick_hz)?;
            let (result, host, wall) = drive(scenario, simulation, paced, output)?;
            host.end.end()?;
            RunReport {
                wake_up_us: DurationPercentiles::of_ns(&host.lateness_ns),
                missed_deadlines: Some(host.missed_deadlines),
                ..RunReport::new(scenario, name, pacing.name(), &result, wall)
            }
        }
        Pacing::Lockstep | Pacing::Realtime => {
            let skip = match pacing {
                Pacing::Lockstep => Duration::ZERO,
                Pacing::Realtime => Duration::from_secs(1) / scenario.run.tick_hz,
            };
            let (result, host, wall) = drive(scenario, simulation, Lockstep { end, skip }, output)?;
            host.end.end()?;
            RunReport::new(scenario, name, pacing.name(), &result, wall)
        }
    };
    if let Some(controller) = external {
        report.controller = controller;
    }
    Ok(report)
}

fn drive<H: ControllerHost>(
    scenario: &Scenario,
    simulation: Simulation,
    host: H,
    output: &mut Output,
) -> Result<(LoopResult, H, Duration), CommandError> {
    let mut closed_loop = ClosedLoop::new(simulation, host);
    let start = Instant::now();
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(output)?;
    }
    let wall = start.elapsed();
    let (result, host) = closed_loop.finish();
    Ok((result, host, wall))
}

/// Prints a report as JSON or as a table.
///
/// # Errors
/// [`CommandError::Output`] if the report cannot be written.
pub fn print(report: &RunReport, json: bool) -> Result<(), CommandError> {
    let text = if json {
        serde_json::to_string(report).map_err(output)?
    } else {
        report.table()
    };
    say(text)
}
