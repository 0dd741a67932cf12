//! `painleve run`: plant and controller as two processes, started, monitored and ended together.

use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use clap::{Args, ValueEnum};
use painleve_board::{emulator, serial};
use painleve_files::input_file;
use painleve_link::{BusName, Pacing, Pair};
use painleve_plant::scenario::Scenario;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_record::report::RunReport;
use painleve_view::access::Token;

use super::bridge::{
    BridgeArguments, BridgeTarget, BusArguments, ImageArguments, SensorLineArguments,
};
use super::controller::ControllerArguments;
use super::distinct_files::{check_distinct, try_out};
use super::fail_on::{self, FailOn};
use super::join::JoinArguments;
use super::live;
use super::output::OutputArguments;
use super::output_error::InputError;
use super::patience::PatienceArguments;
use super::plan::Plan;
use super::plant::{self, PlantArguments};
use super::process_error::ProcessError;
use super::run_process::{RunProcess, WATCH, complaint};
use super::scenario::ScenarioArguments;
use super::system_path::SystemPath;
use super::{CommandError, DEADLINES_MISSED, INTERNAL_ERROR, INTERRUPTED, PEER_FAILED, UNWRITABLE};

/// Where the controller runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Host {
    /// The firmware's controller in its own process.
    #[default]
    Native,
    /// The controller behind the board's sensor drivers, over models of the sensors' chips.
    Drivers,
    /// The image of the flash target under QEMU.
    Qemu,
    /// A flashed board behind the serial port --port.
    Serial,
}

impl Host {
    /// Returns the name of the host on the command line.
    pub fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Refuses options that have no effect with this host: each with whether it is given, and the hosts that it is
    /// meant for.
    ///
    /// # Errors
    /// [`InputError::WithoutEffect`].
    pub fn check_options(
        self,
        options: &[(&'static str, bool, &[Self])],
    ) -> Result<(), InputError> {
        for &(option, is_given, hosts) in options {
            if is_given && !hosts.contains(&self) {
                let hosts: Vec<_> = hosts.iter().map(|host| host.name()).collect();
                return Err(InputError::WithoutEffect {
                    option,
                    host: self.name(),
                    hosts: hosts.join(", "),
                });
            }
        }
        Ok(())
    }
}

/// Options of `painleve run`.
#[derive(Clone, Debug, Args)]
pub struct RunArguments {
    #[command(flatten)]
    scenario: ScenarioArguments,
    /// Bus on which plant and controller meet; unique by default.
    #[arg(long)]
    bus: Option<BusName>,
    /// Where the controller runs.
    #[arg(long, value_enum, default_value_t)]
    host: Host,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH", required_if_eq("host", "serial"))]
    port: Option<SystemPath>,
    #[command(flatten)]
    image: ImageArguments,
    #[command(flatten)]
    lines: SensorLineArguments,
    #[command(flatten)]
    patience: PatienceArguments,
    #[command(flatten)]
    output: OutputArguments,
    /// Exit with code 6 if one of these events happened; the report is still complete.
    #[arg(long, value_enum, value_name = "EVENTS", value_delimiter = ',')]
    fail_on: Vec<FailOn>,
    /// Watch and steer the run from a page in the browser or from Foxglove, on this machine. It runs
    /// in one process, writes no files, and continues until Ctrl-C.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8765")]
    #[arg(value_parser = super::port)]
    #[arg(conflicts_with_all = ["bus", "port", "fail_on", "record", "plot", "html", "csv"])]
    #[arg(conflicts_with_all = ["no_record", "no_plot", "no_html"])]
    #[arg(conflicts_with_all = ["timing", "verbose", "quiet", "json", "pacing", "silence_limit_s"])]
    live: Option<u16>,
    /// With --live: let every user of this machine watch and steer the run, also without the token in the
    /// printed address.
    #[arg(long)]
    no_token: bool,
    /// With --live: let pages of this origin connect as Foxglove does, for example
    /// http://localhost:8080, or file:// for Foxglove's desktop app; may be repeated.
    #[arg(long, value_name = "ORIGIN", value_parser = super::origin)]
    live_origin: Vec<String>,
    /// Print errors and warnings only.
    #[arg(short, long, conflicts_with_all = ["json", "verbose"])]
    quiet: bool,
    /// Print one JSON object on stdout instead of the table.
    #[arg(long)]
    json: bool,
}

/// Start-up time of a child, s. The processes of a run notice each other's end, so this can be
/// generous.
const START_WAIT_S: f64 = 10.0;

/// Time for the plant to notice and report that the controller is gone.
const PLANT_NOTICE: Duration = Duration::from_millis(1000);

/// Time for the plant to complete its files, whatever it is asked. All processes end within 5 s, even if it is killed then.
const PLANT_END: Duration = Duration::from_millis(3000);

/// Time beyond the silence limit for which a child may be stopped, so that its peer reports the
/// silence first.
const STOPPED_MARGIN: Duration = Duration::from_millis(200);

/// Time for the controller to end after the plant.
const CONTROLLER_END: Duration = Duration::from_millis(1700);

/// Time for the controller to end after the plant has reported it missing.
const CONTROLLER_NOTICE: Duration = Duration::from_millis(300);

/// Runs a scenario that is watched and steered from a page; `command` runs it, too.
fn live(
    arguments: &RunArguments,
    scenario: &Scenario,
    command: String,
    port: u16,
) -> Result<(), CommandError> {
    if arguments.host != Host::Native {
        return Err(InputError::LiveHost.into());
    }
    let token = match arguments.no_token {
        true => None,
        false => Some(Token::draw()?),
    };
    let interrupt = Interrupt::catch()?;
    let origins = &arguments.live_origin;
    live::run(scenario, command, port, token, origins, &interrupt)
}

impl RunArguments {
    fn check_options(&self) -> Result<(), InputError> {
        use Host::{Drivers, Native, Qemu, Serial};
        let image = &self.image;
        let of_live = [
            ("--no-token", self.no_token),
            ("--live-origin", !self.live_origin.is_empty()),
        ];
        InputError::check_needed("--live", self.live.is_some(), &of_live)?;
        let deadlines = "--fail-on missed-deadline";
        let fails_on_them = self.fail_on.contains(&FailOn::MissedDeadline);
        let is_realtime = self.scenario.pacing == Pacing::Realtime;
        InputError::check_needed(
            "--pacing realtime",
            is_realtime,
            &[(deadlines, fails_on_them)],
        )?;
        self.host.check_options(&[
            ("--timing", image.timing.is_some(), &[Drivers, Qemu, Serial]),
            ("--elf", image.elf.is_some(), &[Qemu]),
            ("--log", image.log, &[Qemu]),
            ("--port", self.port.is_some(), &[Serial]),
            ("--bit-errors", self.lines.bit_errors != 0.0, &[Drivers]),
            // The board's timer sets the pace: the plant has no deadlines.
            (deadlines, fails_on_them, &[Native, Drivers, Qemu]),
        ])
    }
}

/// Runs a scenario as two processes and reports.
///
/// # Errors
/// [`CommandError`] if an option is invalid, a process of the run fails, or a condition of `--fail-on` is met.
pub fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    let mut arguments = arguments.clone();
    // As it was given: the copy of standard input does not outlive the run.
    let command = arguments.scenario.command();
    let _standard_input = arguments.scenario.copy_standard_input()?;
    let arguments = &arguments;
    // Validate before any process starts, so that an error is reported once.
    let scenario = arguments.scenario.load()?;
    arguments.check_options()?;
    warn_of_rehearsal(&scenario);
    if let Some(port) = arguments.live {
        return live(arguments, &scenario, command, port);
    }
    if arguments.host == Host::Qemu {
        // From now on it is known as an input.
        let _ = input_file::open(&arguments.image.path());
    }
    let timing = arguments
        .image
        .timing
        .as_deref()
        .map(|path| ("--timing", path));
    check_distinct(&[arguments.output.files(), Vec::from_iter(timing)].concat())?;
    if arguments.host == Host::Qemu {
        emulator::check(&arguments.image.path(), arguments.image.log)?;
    }
    // Beyond the end of the processes, which use them.
    let _new_folders = timing.map(|(_, path)| try_out(path)).transpose()?;
    if let (Host::Serial, Some(port)) = (arguments.host, &arguments.port) {
        serial::check(port)?;
    }
    let interrupt = Interrupt::catch()?;
    let (mut plant, mut controller) = start(arguments, &scenario)?;

    let status = watch(
        &mut plant,
        &mut controller,
        arguments.patience.peer(),
        &interrupt,
    )?;
    let report = report(&mut plant, &mut controller, status)?;
    if !arguments.quiet {
        plant::print(&report, arguments.json)?;
    }
    if let Some(missed) = report.missed_deadlines.filter(|missed| *missed > 0) {
        warn(format_args!(
            "real time was missed: {missed} of {} ticks came a whole tick or more late; end other programs \
             or lower run.tick_hz",
            report.ticks
        ));
    }
    if is_told(status) {
        return Err(failure(status));
    }
    fail_on::check(&arguments.fail_on, &report)
}

/// Starts the processes of plant and controller.
fn start(
    arguments: &RunArguments,
    scenario: &Scenario,
) -> Result<(RunProcess, RunProcess), CommandError> {
    let bus = arguments.bus.clone().unwrap_or_else(BusName::unique);
    let pair = Pair::unique();
    let plan = Plan::Plant(PlantArguments {
        scenario: arguments.scenario.clone(),
        bus: bus.clone(),
        output: arguments.output.clone(),
        json: true,
        wait_s: START_WAIT_S,
        patience: arguments.patience.clone(),
        host_name: arguments.host.name(),
        board_keeps_time: arguments.host == Host::Serial,
        pair: Some(pair),
        quiet: arguments.quiet,
    });
    let mut plant = RunProcess::start(&plan, Stdio::inherit())?;
    plant.child.set_grace(PLANT_END);
    // The controller's messages are shown only if the plant has none; a log is shown at once.
    let stderr = if arguments.image.log {
        Stdio::inherit()
    } else {
        Stdio::piped()
    };
    let join = JoinArguments {
        bus,
        wait_s: START_WAIT_S,
        patience: arguments.patience.clone(),
        pair: Some(pair),
        quiet: arguments.quiet,
    };
    let controller = RunProcess::start(&controller_plan(arguments, scenario, join), stderr)?;
    Ok((plant, controller))
}

/// Returns the report of a plant that has ended, once the controller has ended, too.
fn report(
    plant: &mut RunProcess,
    controller: &mut RunProcess,
    status: ExitStatus,
) -> Result<RunReport, CommandError> {
    if !status.success() && !is_told(status) {
        if status.code() == Some(i32::from(PEER_FAILED)) {
            return Err(peer_failure(plant, controller, status)?);
        }
        return Err(failure(status));
    }
    let text = plant.stdout.text();
    if is_told(status) && text.is_empty() {
        return Err(failure(status));
    }
    match controller.wait(CONTROLLER_END)? {
        Some(status) if status.success() => {}
        Some(status) => {
            let text = controller.stderr.text();
            let complaint = complaint(&text);
            let failed = || ProcessError::Failed { status, complaint }.into();
            return Err(failure_of_its_own(status, &text).unwrap_or_else(failed));
        }
        None => {
            return Err(ProcessError::Outlived.into());
        }
    }
    let remarks = controller.stderr.text();
    if !remarks.is_empty() {
        warn(remarks.trim_end());
    }
    Ok(serde_json::from_str(&text).map_err(ProcessError::NoReport)?)
}

/// Whether the plant has printed why it failed, and its report if the run is complete.
fn is_told(status: ExitStatus) -> bool {
    [DEADLINES_MISSED, UNWRITABLE]
        .into_iter()
        .any(|code| status.code() == Some(i32::from(code)))
}

/// Warns of a model that a rehearsal has identified: the arm that it simulated is not the one that runs.
fn warn_of_rehearsal(scenario: &Scenario) {
    let knowledge = &scenario.knowledge;
    if knowledge.is_rehearsed() && scenario.arm_model.is_some() {
        warn(format_args!(
            "arm_model and encoder corrections are those of another simulated arm (knowledge.source: {}); this run's arm is \
             that of [arm]",
            knowledge.source
        ));
    }
}

/// Exit code of a process whose input cannot be used.
const INVALID: u8 = 2;

/// Returns the failure of a controller's process that is this command's as well: a setting that its host cannot use, an output
/// that it could not write, or a bug.
fn failure_of_its_own(status: ExitStatus, text: &str) -> Option<CommandError> {
    let code = u8::try_from(status.code()?).ok()?;
    [INVALID, UNWRITABLE, INTERNAL_ERROR]
        .contains(&code)
        .then(|| match cause(text) {
            Some(cause) => CommandError::Reported {
                code,
                message: cause.into(),
            },
            // With --log, it has been shown.
            None => CommandError::Told { code },
        })
}

/// Returns the failure of a plant whose peer has failed. The plant only knows that the controller has
/// gone; the controller or the bridge of a board knows why.
fn peer_failure(
    plant: &mut RunProcess,
    controller: &mut RunProcess,
    status: ExitStatus,
) -> Result<CommandError, CommandError> {
    let message = plant.stdout.text();
    if let Some(status) = controller
        .wait(CONTROLLER_NOTICE)?
        .filter(|it| !it.success())
    {
        let text = controller.stderr.text();
        if let Some(failure) = failure_of_its_own(status, &text) {
            return Ok(failure);
        }
        if let Some(cause) = cause(&text) {
            return Ok(ProcessError::Reported(cause.into()).into());
        }
    }
    Ok(match message.trim() {
        "" => failure(status),
        message => ProcessError::Reported(message.into()).into(),
    })
}

/// Returns the first error among the messages of a failed controller, unless it only tells that its plant is gone or
/// that somebody has ended it.
fn cause(complaint: &str) -> Option<&str> {
    let mut lines = complaint.lines();
    let cause = lines.find_map(|line| line.strip_prefix("error: "))?;
    let is_consequence = cause.starts_with("the plant on bus `") || cause == "interrupted";
    (!is_consequence).then_some(cause)
}

/// Waits for the end of the plant, and stops it if necessary.
fn watch(
    plant: &mut RunProcess,
    controller: &mut RunProcess,
    silence_limit: Duration,
    interrupt: &Interrupt,
) -> Result<ExitStatus, CommandError> {
    loop {
        if let Some(status) = plant.child.ended()? {
            return Ok(status);
        }
        if interrupt.is_requested() {
            // The plant may keep a partial record and report its path, or may have completed everything.
            let ended = plant.child.stop().filter(ExitStatus::success);
            return ended.ok_or(CommandError::Interrupted);
        }
        if let Some(status) = controller.child.ended()?
            && !status.success()
        {
            // The plant normally notices this and reports it; otherwise it is reported here.
            if !plant.child.is_stopped()
                && let Some(plant_status) = plant.wait(PLANT_NOTICE)?
            {
                return Ok(plant_status);
            }
            if !plant.child.is_stopped() {
                // The plant may be completing the files of its run.
                if let Some(completed) = plant.child.stop().filter(ExitStatus::success) {
                    return Ok(completed);
                }
                let text = controller.stderr.text();
                let ended_early = || {
                    let error = ProcessError::EndedEarly {
                        process: "controller",
                        status,
                        complaint: complaint(&text),
                    };
                    error.into()
                };
                return Err(failure_of_its_own(status, &text).unwrap_or_else(ended_early));
            }
        }
        for (part, process) in [("plant", &mut *plant), ("controller", &mut *controller)] {
            if process.stopped_for(WATCH) >= silence_limit + STOPPED_MARGIN {
                return Err(ProcessError::Stopped {
                    process: part,
                    id: process.child.id(),
                }
                .into());
            }
        }
        std::thread::sleep(WATCH);
    }
}

/// Returns the plan of the process that runs the controller or leads to it.
fn controller_plan(arguments: &RunArguments, scenario: &Scenario, plant: JoinArguments) -> Plan {
    let bus = BusArguments {
        plant,
        scenario_name: scenario.name.clone(),
    };
    let image = arguments.image.clone();
    let target = match arguments.host {
        Host::Native => return Plan::Controller(ControllerArguments { plant: bus.plant }),
        Host::Drivers => BridgeTarget::Drivers {
            bus,
            lines: arguments.lines.clone(),
            timing: image.timing,
        },
        Host::Qemu => BridgeTarget::Qemu { bus, image },
        Host::Serial => BridgeTarget::Serial {
            bus,
            port: arguments.port.clone().unwrap_or_default(),
            timing: image.timing,
        },
    };
    Plan::Bridge(BridgeArguments { target })
}

/// Returns the error of an ended plant: one that exited with a code has printed its error, one that
/// was killed has not.
fn failure(status: ExitStatus) -> CommandError {
    match status.code().and_then(|code| u8::try_from(code).ok()) {
        Some(INTERRUPTED) => CommandError::Interrupted,
        Some(code) => CommandError::Told { code },
        None => CommandError::Process(ProcessError::EndedEarly {
            process: "plant",
            status,
            complaint: String::new(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_link::LinkError;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn a_run_ends_with_the_code_of_a_controller_that_has_a_bug_or_cannot_write() {
        for code in [INTERNAL_ERROR, UNWRITABLE, INVALID] {
            let status = ExitStatus::from_raw(i32::from(code) << 8);
            let failure = failure_of_its_own(status, "error: cause\n").unwrap();
            assert_eq!(
                (failure.exit_code(), &*failure.to_string()),
                (code, "cause")
            );
            let shown = failure_of_its_own(status, "").unwrap();
            assert_eq!((shown.exit_code(), &*shown.to_string()), (code, ""));
        }
        let lost = ExitStatus::from_raw(i32::from(PEER_FAILED) << 8);
        assert!(failure_of_its_own(lost, "error: cause\n").is_none());
    }

    #[test]
    fn the_cause_of_a_failure_is_no_consequence_of_it() {
        let bus: BusName = "b".parse().unwrap();
        let gone = LinkError::PlantGone { bus: bus.clone() };
        let silence = Duration::from_secs(2);
        let silent = LinkError::PlantSilent { bus, silence };
        for consequence in [gone, silent, LinkError::Interrupted] {
            assert_eq!(cause(&format!("error: {consequence}\n")), None);
        }
        let bug = "controller: real time\nerror: this is a bug in painleve\nerror: interrupted\n";
        assert_eq!(cause(bug), Some("this is a bug in painleve"));
        assert_eq!(cause(""), None);
    }
}
