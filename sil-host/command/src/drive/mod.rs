//! `painleve drive`: a real arm with a board's own sensors and torque stages.

mod history;
mod operator;
mod stored;
mod view;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use painleve_board::BoardError;
use painleve_board::arm::{ArmEvent, ConnectedArm, Measured};
use painleve_commission::{identification, set_down};
use painleve_files::input_file;
use painleve_plant::scenario::{Scenario, ScenarioError, built_in};
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_record::mcap_log::Source;
use painleve_record::{McapLog, Recorder};
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::FrameSource;
use painleve_shared::mounting::SensorParts;
use painleve_shared::range;
use serde::Serialize;

use self::operator::OperatorCommand;
pub use self::operator::{Ended, Operator};
use self::view::View;
use super::distinct_files::check_distinct;
use super::output::{complete, keep_partial};
use super::output_error::{InputError, output};
use super::process_error::ProcessError;
use super::{CommandError, say};

/// Longest wait for the board before checking for operator commands and signals.
const PATIENCE: Duration = Duration::from_millis(20);

/// Time between two requests for the board's counters.
const HEALTH_INTERVAL: Duration = Duration::from_secs(1);

/// Options of `painleve drive`.
#[derive(Debug, Args)]
pub struct DriveArguments {
    /// Built-in scenario or TOML file with the arm's configuration.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT, hide_default_value = true)]
    #[arg(required_unless_present_any = ["stored", "forget"])]
    scenario: String,
    /// Override one key, for example controller.torque_limit_nm=0.5; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE", conflicts_with_all = ["stored", "forget"])]
    overrides: Vec<String>,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH")]
    port: PathBuf,
    /// Run the controller on the arm's sensors with the torque stages off.
    #[arg(long)]
    dry_run: bool,
    /// Store the configuration in the board's flash instead of driving: from then on the board starts with it
    /// and needs no host.
    #[arg(long, conflicts_with_all = ["dry_run", "stored", "forget"])]
    store: bool,
    /// Print whether the board has a configuration of its own.
    #[arg(long, conflicts_with_all = ["dry_run", "forget"])]
    stored: bool,
    /// Erase the board's own configuration.
    #[arg(long, conflicts_with = "dry_run")]
    forget: bool,
    /// Stop after this time on the board's clock; by default, run until Ctrl-C or the command
    /// `stop`.
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds, conflicts_with_all = ["store", "stored", "forget"])]
    duration: Option<f64>,
    /// Record of every tick, for Foxglove and PlotJuggler.
    #[arg(long, value_name = "PATH", default_value = "out/drive.mcap", conflicts_with_all = ["store", "stored", "forget"])]
    record: PathBuf,
    /// Do not write a record.
    #[arg(long, conflicts_with = "record")]
    no_record: bool,
    /// Print one JSON object on stdout at the end instead of the table.
    #[arg(long)]
    json: bool,
}

/// Summary of a drive.
#[derive(Debug, Default, Serialize)]
struct DriveReport {
    scenario: String,
    dry_run: bool,
    /// Ticks received.
    ticks: u64,
    /// Ticks that the line lost.
    lost_ticks: u64,
    /// Ticks in a state in which torque may be applied.
    active_ticks: u64,
    /// The supervisor's last state.
    state: &'static str,
    /// Number of the latched fault, 0 for none.
    fault: u8,
}

impl DriveReport {
    /// Returns the ticks of the board's clock.
    fn elapsed_ticks(&self) -> u64 {
        self.ticks + self.lost_ticks
    }
}

/// Connects to the board, configures it, and monitors it until the operator stops it.
///
/// # Errors
/// [`CommandError`] if the scenario is invalid, the board fails or latches a fault, or a file cannot be written.
pub fn run(arguments: &DriveArguments) -> Result<(), CommandError> {
    let scenario = Scenario::load(&arguments.scenario, &arguments.overrides)?;
    check_rate(&scenario)?;
    check_overrides(&scenario, &arguments.overrides)?;
    if arguments.store || arguments.stored || arguments.forget {
        return stored::run(arguments, &scenario);
    }
    let interrupt = Interrupt::catch()?;
    let mut recorder = recorder(arguments, &scenario)?;
    let mut drive = Drive::open(arguments, &scenario)?;
    let watched = drive.watch(arguments, &interrupt, &mut recorder);
    // Remove the torque in every case; a board that cannot be reached stops by itself.
    let stopped = drive.arm.stop();
    drive.view.finish();
    if let Err(error) = watched.and(stopped.map_err(CommandError::from)) {
        if let Some(recorder) = recorder {
            keep_partial(recorder, &error.to_string());
        }
        return Err(error);
    }
    let written = recorder.map_or(Ok(()), |recorder| complete(recorder).1);
    let report = drive.report;
    say(if arguments.json {
        serde_json::to_string(&report).map_err(output)?
    } else {
        format!(
            "{}: {} ticks, {} of them active, {} lost on the line; last state: {}",
            report.scenario, report.ticks, report.active_ticks, report.lost_ticks, report.state
        )
    })?;
    written?;
    painleve_shared::status::Fault::from_code(report.fault)
        .map_or(Ok(()), |fault| Err(CommandError::Faulted(fault)))
}

/// Opens the record, so that an unwritable path is reported before anything moves.
fn recorder(
    arguments: &DriveArguments,
    scenario: &Scenario,
) -> Result<Option<Recorder>, CommandError> {
    if arguments.no_record {
        return Ok(None);
    }
    // Its lines are commands.
    input_file::remember_standard_input()?;
    check_distinct(&[("--record", &arguments.record)])?;
    let log = McapLog::create(&arguments.record, scenario, Source::Arm).map_err(output)?;
    let configuration = scenario.controller_configuration();
    Recorder::start(&configuration, vec![Box::new(log)])
        .map(Some)
        .map_err(output)
}

/// A running board and its record.
struct Drive {
    arm: ConnectedArm,
    measured: Measured,
    view: View,
    report: DriveReport,
    last_sequence: Option<u32>,
    tick_hz: f64,
}

impl Drive {
    fn open(arguments: &DriveArguments, scenario: &Scenario) -> Result<Self, CommandError> {
        let range = |source| ScenarioError::range(&scenario.name, source);
        let configuration = scenario.controller_configuration();
        let measured = Measured::new(&configuration).map_err(range)?;
        let source = if arguments.dry_run {
            FrameSource::DryRun
        } else {
            FrameSource::Sensors
        };
        if !arguments.dry_run {
            check_commissioned(scenario)?;
        }
        let arm = ConnectedArm::open(&arguments.port, &configuration, source)?;
        warn_of_single_sensors(scenario);
        if let Err(error) = arm.compare_sources() {
            warn(error);
        }
        for line in history::lines(&arm.black_box) {
            warn(line);
        }
        warn(format_args!(
            "connected: build {:016x}, sources {:016x}, scenario {}{}; commands: arm, disarm, stop",
            painleve_plant::law_choice::build(),
            painleve_firmware::SOURCES,
            scenario.name,
            if arguments.dry_run {
                ", torque stages off"
            } else {
                ""
            },
        ));
        warn(set_down::advice(scenario).map_err(range)?);
        Ok(Self {
            arm,
            measured,
            view: View::new(),
            report: DriveReport {
                scenario: scenario.name.clone(),
                dry_run: arguments.dry_run,
                ..DriveReport::default()
            },
            last_sequence: None,
            tick_hz: f64::from(configuration.tick_hz),
        })
    }

    /// Passes commands to the board and records its ticks, until a command, a signal or the time
    /// limit ends it.
    fn watch(
        &mut self,
        arguments: &DriveArguments,
        interrupt: &Interrupt,
        recorder: &mut Option<Recorder>,
    ) -> Result<(), CommandError> {
        let operator = Operator::listen()?;
        let limit = arguments.duration.map(|limit_s| limit_s * self.tick_hz);
        let mut health = Instant::now();
        while !interrupt.is_requested() {
            match operator.order() {
                None | Some(OperatorCommand::Confirm | OperatorCommand::End) => {}
                Some(OperatorCommand::Arm) => self.arm.permit_arming(true)?,
                Some(OperatorCommand::Disarm) => self.arm.permit_arming(false)?,
                Some(OperatorCommand::Stop) => return Ok(()),
                Some(OperatorCommand::Unknown(text)) => {
                    warn(format_args!(
                        "unknown command {text:?}: arm, disarm or stop"
                    ));
                }
            }
            if health.elapsed() >= HEALTH_INTERVAL {
                health = Instant::now();
                self.arm.ask_for_health()?;
            }
            match self.next_event()? {
                None => {}
                Some(ArmEvent::Permission(permitted)) => self.view.show_permission(permitted),
                Some(ArmEvent::Health(health)) => self.view.show_health(&health, self.arm.line()),
                Some(ArmEvent::Tick { sensor, answer }) => {
                    self.take(sensor, &answer, recorder)?;
                    if limit.is_some_and(|limit| self.report.elapsed_ticks() as f64 >= limit) {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }

    fn next_event(&mut self) -> Result<Option<ArmEvent>, BoardError> {
        self.arm.next_event(PATIENCE)
    }

    /// Counts, records and shows a tick.
    fn take(
        &mut self,
        sensor: Option<SensorFrame>,
        answer: &ActuatorFrame,
        recorder: &mut Option<Recorder>,
    ) -> Result<(), CommandError> {
        if !answer.is_understood() {
            return Err(ProcessError::NotUnderstood {
                state: answer.state,
                fault: answer.fault,
            }
            .into());
        }
        let state = answer.supervisor_state().unwrap_or_default();
        self.report.state = state.name();
        self.report.fault = answer.fault;
        let Some(sensor) = sensor else {
            self.view.show_answer(answer);
            return Ok(());
        };
        let before = self.last_sequence.replace(sensor.sequence);
        self.report.ticks += 1;
        self.report.lost_ticks += before.map_or(0, |before| lost_between(before, sensor.sequence));
        self.report.active_ticks += u64::from(state.drives());
        let sample = self.measured.sample(&sensor, answer);
        if let Some(recorder) = recorder {
            recorder.push(&sample).map_err(output)?;
        }
        self.view.show(&sample);
        Ok(())
    }
}

/// Highest control rates at which the emulated boards read their sensors in time, Hz: one on each channel, and two.
const FASTEST_HZ: [f64; 2] = [7500.0, 2500.0];

/// Lowest control rate of a scenario, Hz.
const SLOWEST_HZ: f64 = 10.0;

/// Refuses a control rate at which the board cannot read the sensors at every tick.
///
/// # Errors
/// [`ScenarioError`] with the range.
pub(crate) fn check_rate(scenario: &Scenario) -> Result<(), ScenarioError> {
    let [one, two] = FASTEST_HZ;
    let fastest_hz = match scenario.converters.mounting.sensors {
        SensorParts::Both => two,
        SensorParts::First | SensorParts::Second => one,
    };
    let hz = f64::from(scenario.run.tick_hz);
    range::check("run.tick_hz", hz, SLOWEST_HZ, fastest_hz)
        .map_err(|source| ScenarioError::range(&scenario.name, source))
}

/// Refuses a scenario that has been written in a rehearsal, and warns of one that has not been commissioned: the directions of
/// the real arm's parts may be others.
///
/// # Errors
/// [`InputError::Rehearsed`].
fn check_commissioned(scenario: &Scenario) -> Result<(), InputError> {
    check_not_rehearsed(scenario)?;
    if identification::is_new(scenario) {
        warn(InputError::NotCommissioned);
    }
    Ok(())
}

/// Refuses a scenario that has been written in a rehearsal: what it says of the arm is that of a simulated one.
///
/// # Errors
/// [`InputError::Rehearsed`].
pub(crate) fn check_not_rehearsed(scenario: &Scenario) -> Result<(), InputError> {
    if scenario.knowledge.is_rehearsed() {
        return Err(InputError::Rehearsed(scenario.knowledge.source.clone()));
    }
    Ok(())
}

/// Refuses overrides of `arm`, which describes a simulated one, if the controller has a model of its own.
///
/// # Errors
/// [`InputError::OfSimulatedArm`].
pub(crate) fn check_overrides(scenario: &Scenario, overrides: &[String]) -> Result<(), InputError> {
    let of_arm = overrides.iter().find(|it| it.starts_with("arm."));
    match of_arm {
        Some(of_arm) if scenario.arm_model.is_some() => {
            Err(InputError::OfSimulatedArm(of_arm.clone()))
        }
        _ => Ok(()),
    }
}

/// Tells the operator of an arm with one sensor on each channel what the board cannot detect within two ticks.
fn warn_of_single_sensors(scenario: &Scenario) {
    if scenario.converters.mounting.sensors != SensorParts::Both {
        warn(
            "one sensor on each channel: the board detects a frozen encoder or a stuck force cell only after up to a second, \
             in which the arm moves on; two sensors on each channel take the torque off within two ticks of a wrong \
             reading (converters.mounting.sensors = \"both\")",
        );
    }
}

/// Returns the number of ticks lost between two sequence numbers. A board that was configured again counts
/// anew: a step backwards loses none.
fn lost_between(before: u32, now: u32) -> u64 {
    let step = now.wrapping_sub(before);
    if step > u32::MAX / 2 {
        0
    } else {
        u64::from(step.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::{DriveReport, lost_between};

    #[test]
    fn a_board_that_counts_anew_has_lost_no_ticks() {
        assert_eq!(lost_between(7, 8), 0);
        assert_eq!(lost_between(7, 10), 2);
        assert_eq!(lost_between(u32::MAX, 1), 1);
        assert_eq!(lost_between(7, 3), 0);
        assert_eq!(lost_between(7, 7), 0);
    }

    #[test]
    fn lost_ticks_have_passed_on_the_boards_clock() {
        let report = DriveReport {
            ticks: 70,
            lost_ticks: 30,
            ..DriveReport::default()
        };
        assert_eq!(report.elapsed_ticks(), 100);
    }
}
