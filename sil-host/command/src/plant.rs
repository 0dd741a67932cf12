//! `painleve plant`: the simulated belt and arm in a process of its own.

use std::time::{Duration, Instant};

use clap::Args;
use painleve_link::lockstep::Lockstep;
use painleve_link::paced::Paced;
use painleve_link::{BusName, Pacing, PlantEnd, Session};
use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::ControllerHost;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_record::report::{Percentiles, RunReport};
use painleve_system::interrupt::Interrupt;
use painleve_system::lifetime;
use painleve_system::realtime::request_realtime;

use super::CommandError;
use super::output::{Output, OutputArguments};
use super::run::ScenarioArguments;

/// Options of `painleve plant`.
#[derive(Debug, Args)]
pub struct PlantArguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    /// Bus on which to wait for the controller.
    #[arg(long)]
    bus: BusName,
    #[command(flatten)]
    output: OutputArguments,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    json: bool,
    /// How long to wait for the controller, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.8, value_parser = super::seconds)]
    wait_s: f64,
    /// What to call the controller's host in the report.
    #[arg(long, hide = true, default_value = "native")]
    host_name: String,
    /// By the clock, but the clock is a board's: wait for its answers.
    #[arg(long, hide = true)]
    board_keeps_time: bool,
    /// End when the process that started this one does.
    #[arg(long, hide = true)]
    end_with_parent: bool,
}

/// Runs a scenario against the controller on the bus.
pub fn run(arguments: &PlantArguments) -> Result<(), CommandError> {
    if arguments.end_with_parent {
        lifetime::end_with_parent()?;
    }
    let scenario = arguments.scenario.load()?;
    let interrupt = Interrupt::catch().map_err(|error| CommandError::Process(error.to_string()))?;
    let mut output = Output::open(&arguments.output, &scenario, interrupt)?;
    let simulation = Simulation::new(&scenario).map_err(|source| ScenarioError::Range {
        origin: scenario.name.clone(),
        source,
    })?;
    let pacing = arguments.scenario.pacing;
    let session = session(&scenario, pacing)?;
    let mut end = PlantEnd::create(&arguments.bus, &session)?;
    end.wait_for_controller(Duration::from_secs_f64(arguments.wait_s))?;

    let name = &arguments.host_name;
    let report = match pacing {
        Pacing::Realtime if !arguments.board_keeps_time => {
            eprintln!("plant: {}", request_realtime());
            let paced = Paced::start(end, scenario.run.tick_hz)?;
            let (result, host, wall) = drive(&scenario, simulation, paced, &mut output)?;
            let (lateness_ns, missed, end) = host.finish();
            end.end()?;
            RunReport {
                wake_up_us: Some(Percentiles::of_ns(&lateness_ns)),
                missed_deadlines: Some(missed),
                ..RunReport::new(&scenario, name, pacing.name(), &result, wall)
            }
        }
        Pacing::Lockstep | Pacing::Realtime => {
            let (result, host, wall) = drive(&scenario, simulation, Lockstep(end), &mut output)?;
            host.0.end()?;
            RunReport::new(&scenario, name, pacing.name(), &result, wall)
        }
    };
    output.finish()?;
    super::run::print(&report, arguments.json)
}

fn session(scenario: &Scenario, pacing: Pacing) -> Result<Session, CommandError> {
    let configuration = postcard::to_stdvec(&scenario.controller_configuration())
        .map_err(|error| CommandError::Process(error.to_string()))?;
    Ok(Session {
        tick_hz: scenario.run.tick_hz,
        pacing,
        configuration,
    })
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
