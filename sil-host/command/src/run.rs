//! `painleve run`: plant and controller as two processes, started, monitored and ended together.

use std::ffi::OsString;
use std::io::Read;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use clap::{Args, ValueEnum};
use painleve_board::{emulator, serial};
use painleve_files::input_file;
use painleve_link::{BusName, Pacing, Pair};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::{self, warn};
use painleve_record::report::RunReport;
use painleve_study_quality::robustness::{self, Arms};
use painleve_view::access::Token;
use tempfile::NamedTempFile;

use super::bridge::{ImageArguments, SensorLineArguments};
use super::distinct_files::check_distinct;
use super::fail_on::{self, FailOn};
use super::live;
use super::output::OutputArguments;
use super::output_error::{InputError, output};
use super::patience::PatienceArguments;
use super::process_error::ProcessError;
use super::run_process::{RunProcess, WATCH};
use super::{CommandError, DEADLINES_MISSED, INTERRUPTED, PEER_FAILED, say};

/// A run of the robustness campaign.
#[derive(Clone, Copy, Debug)]
struct Replay {
    seed: u64,
    index: u64,
}

impl std::str::FromStr for Replay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split_once(':')
            .and_then(|(seed, index)| {
                Some(Self {
                    seed: seed.parse().ok()?,
                    index: index.parse().ok()?,
                })
            })
            .ok_or_else(|| {
                "expected the campaign's seed and the number of the run as SEED:INDEX, for example 1:42".into()
            })
    }
}

/// The scenario and its pacing.
#[derive(Clone, Debug, Args)]
pub struct ScenarioArguments {
    /// Built-in scenario or TOML file; `-` reads standard input.
    #[arg(value_name = "SCENARIO", default_value = built_in::DEFAULT)]
    name: String,
    /// Built-in scenario or TOML file, as an option instead of an argument.
    #[arg(long = "scenario", value_name = "SCENARIO", conflicts_with = "name")]
    option: Option<String>,
    /// Repeat run INDEX of `study robustness --seed SEED` instead of a scenario.
    #[arg(
        long,
        value_name = "SEED:INDEX",
        conflicts_with_all = ["name", "option"],
        allow_hyphen_values = true
    )]
    replay: Option<Replay>,
    /// With --replay: the study's option --arms.
    #[arg(long, value_enum, default_value = "paper", requires = "replay")]
    arms: Arms,
    /// Override one key, for example belt.friction=0.4; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// As fast as possible and deterministic, or in real time.
    #[arg(long, value_enum, default_value = "lockstep")]
    pub pacing: Pacing,
}

impl ScenarioArguments {
    fn name(&self) -> &str {
        self.option.as_deref().unwrap_or(&self.name)
    }

    /// Returns the scenario with its overrides, after validation.
    ///
    /// # Errors
    /// [`CommandError`] with one sentence for the user.
    pub fn load(&self) -> Result<Scenario, CommandError> {
        match self.replay {
            Some(Replay { seed, index }) => {
                let drawn = robustness::scenario(self.arms, seed, index)?;
                Ok(drawn.with_overrides("replayed run", &self.overrides)?)
            }
            None => Ok(Scenario::load(self.name(), &self.overrides)?),
        }
    }

    /// Copies a scenario from standard input, if it is requested as `-`, to a file that every process
    /// of the run can read, and which lasts as long as the returned handle.
    fn copy_standard_input(&mut self) -> Result<Option<NamedTempFile>, CommandError> {
        if self.replay.is_some() || self.name() != "-" {
            return Ok(None);
        }
        let mut file = tempfile::Builder::new()
            .prefix("painleve-standard-input-")
            .suffix(".toml")
            .tempfile()?;
        input_file::remember_standard_input()?;
        // As much as of a file, so that an endless input is refused as one.
        let input = std::io::stdin().lock().take(input_file::MOST_BYTES + 1);
        std::io::copy(&mut { input }, &mut file)?;
        self.option = Some(file.path().display().to_string());
        Ok(Some(file))
    }

    fn to_arguments(&self) -> Vec<OsString> {
        let mut arguments: Vec<OsString> = match self.replay {
            Some(Replay { seed, index }) => {
                let mut line = vec!["--replay".into(), format!("{seed}:{index}").into()];
                if self.arms == Arms::General {
                    line.extend(["--arms".into(), "general".into()]);
                }
                line
            }
            None => vec![self.name().into()],
        };
        for text in &self.overrides {
            arguments.extend(["--set".into(), text.into()]);
        }
        arguments.extend(["--pacing".into(), self.pacing.name().into()]);
        arguments
    }
}

/// Host of the controller.
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
    /// Host of the controller.
    #[arg(long, value_enum, default_value_t)]
    host: Host,
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH", required_if_eq("host", "serial"))]
    port: Option<PathBuf>,
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
    #[arg(conflicts_with_all = ["bus", "port", "fail_on", "record", "plot", "html", "csv"])]
    #[arg(conflicts_with_all = ["timing", "verbose", "quiet", "json"])]
    live: Option<u16>,
    /// With --live: let every user of this machine watch and steer the run, also without the token in the
    /// printed address.
    #[arg(long, requires = "live")]
    no_token: bool,
    /// With --live: let pages of this origin connect as Foxglove does, for example
    /// http://localhost:8080, or file:// for Foxglove's desktop app; may be repeated.
    #[arg(long, value_name = "ORIGIN", requires = "live")]
    live_origin: Vec<String>,
    /// Print errors and warnings only.
    #[arg(short, long, conflicts_with_all = ["json", "verbose"])]
    quiet: bool,
    /// Print one JSON object on stdout instead of the table.
    #[arg(long)]
    json: bool,
}

/// Time for the plant to notice and report that the controller is gone. Even with a forced stop
/// after that, all processes end within 2 s.
const PLANT_NOTICE: Duration = Duration::from_millis(1000);

/// Time beyond the silence limit for which a child may be stopped, so that its peer reports the
/// silence first.
const STOPPED_MARGIN: Duration = Duration::from_millis(200);

/// Time for the controller to end after the plant.
const CONTROLLER_END: Duration = Duration::from_millis(1700);

/// Time for a bridge to end after the plant has reported it missing.
const BRIDGE_END: Duration = Duration::from_millis(300);

/// Runs a scenario that is watched and steered from a page.
fn live(arguments: &RunArguments, scenario: &Scenario, port: u16) -> Result<(), CommandError> {
    if arguments.host != Host::Native {
        return Err(InputError::LiveHost.into());
    }
    let token = match arguments.no_token {
        true => None,
        false => Some(Token::draw()?),
    };
    let interrupt = Interrupt::catch()?;
    live::run(scenario, port, token, &arguments.live_origin, &interrupt)
}

impl RunArguments {
    fn check_options(&self) -> Result<(), InputError> {
        use Host::{Drivers, Qemu, Serial};
        let image = &self.image;
        self.host.check_options(&[
            ("--timing", image.timing.is_some(), &[Drivers, Qemu, Serial]),
            ("--elf", image.elf.is_some(), &[Qemu]),
            ("--log", image.log, &[Qemu]),
            ("--port", self.port.is_some(), &[Serial]),
            ("--bit-errors", self.lines.bit_errors != 0.0, &[Drivers]),
        ])
    }
}

/// Runs a scenario as two processes and reports.
///
/// # Errors
/// [`CommandError`] if an option is invalid, a process of the run fails, or a condition of `--fail-on` is met.
pub fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    let mut arguments = arguments.clone();
    let _standard_input = arguments.scenario.copy_standard_input()?;
    let arguments = &arguments;
    // Validate before any process starts, so that an error is reported once.
    let scenario = arguments.scenario.load()?;
    arguments.check_options()?;
    if let Some(port) = arguments.live {
        return live(arguments, &scenario, port);
    }
    if arguments.host == Host::Qemu {
        emulator::check(&arguments.image.path())?;
    }
    let timing = arguments
        .image
        .timing
        .as_deref()
        .map(|path| ("--timing", path));
    check_distinct(&[arguments.output.files(), Vec::from_iter(timing)].concat())?;
    if let (Host::Serial, Some(port)) = (arguments.host, &arguments.port) {
        serial::check(port)?;
    }
    let interrupt = Interrupt::catch()?;
    let bus = arguments.bus.clone().unwrap_or_else(BusName::unique);
    let pair = Pair::unique();

    let mut plant_arguments: Vec<OsString> = vec!["plant".into()];
    plant_arguments.extend(arguments.scenario.to_arguments());
    plant_arguments.extend(arguments.output.to_arguments());
    plant_arguments.extend(arguments.patience.to_arguments());
    plant_arguments.push("--json".into());
    plant_arguments.extend(["--host-name".into(), arguments.host.name().into()]);
    if arguments.host == Host::Serial {
        plant_arguments.push("--board-keeps-time".into());
    }
    let mut plant = RunProcess::start(plant_arguments, &bus, pair, Stdio::inherit())?;
    // The controller's messages are shown only if the plant has none; a log is shown at once.
    let stderr = if arguments.image.log {
        Stdio::inherit()
    } else {
        Stdio::piped()
    };
    let mut controller = RunProcess::start(controller_arguments(arguments), &bus, pair, stderr)?;

    let status = watch(
        &mut plant,
        &mut controller,
        arguments.patience.peer(),
        &interrupt,
    )?;
    let deadlines_missed = status.code() == Some(i32::from(DEADLINES_MISSED));
    if !status.success() && !deadlines_missed {
        if status.code() == Some(i32::from(PEER_FAILED)) {
            return Err(peer_failure(
                arguments.host,
                &mut plant,
                &mut controller,
                status,
            )?);
        }
        return Err(failure(status));
    }
    match controller.wait(CONTROLLER_END)? {
        Some(status) if status.success() => {}
        Some(status) => {
            let complaint = controller.complaint();
            return Err(ProcessError::Failed { status, complaint }.into());
        }
        None => {
            return Err(ProcessError::Outlived.into());
        }
    }
    let remarks = controller.stderr.text();
    if !remarks.is_empty() {
        warn(remarks.trim_end());
    }
    let text = plant.stdout.text();
    let report: RunReport = serde_json::from_str(&text).map_err(ProcessError::NoReport)?;
    if !arguments.quiet {
        print(&report, arguments.json)?;
    }
    if let Some(missed) = report.missed_deadlines.filter(|missed| *missed > 0) {
        warn(format_args!(
            "real time was missed: {missed} of {} ticks came a whole tick or more late; end other programs \
             or lower run.tick_hz",
            report.ticks
        ));
    }
    if deadlines_missed {
        return Err(failure(status));
    }
    fail_on::check(&arguments.fail_on, &report)
}

/// Returns the failure of a plant whose peer has failed. The plant only knows that the controller has
/// gone; the bridge of a board knows why.
fn peer_failure(
    host: Host,
    plant: &mut RunProcess,
    controller: &mut RunProcess,
    status: ExitStatus,
) -> Result<CommandError, CommandError> {
    let message = plant.stdout.text();
    if host != Host::Native
        && (controller.wait(BRIDGE_END)?).is_some_and(|status| !status.success())
    {
        let complaint = controller.stderr.text();
        let mut lines = complaint.lines();
        if let Some(cause) = lines.find_map(|line| line.strip_prefix("error: ")) {
            return Ok(ProcessError::Reported(cause.into()).into());
        }
    }
    Ok(match message.trim() {
        "" => failure(status),
        message => ProcessError::Reported(message.into()).into(),
    })
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
            // The plant may keep a partial record and report its path.
            plant.child.stop();
            return Err(CommandError::Interrupted);
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
                return Err(ProcessError::EndedEarly {
                    process: "controller",
                    status,
                    complaint: controller.complaint(),
                }
                .into());
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

fn controller_arguments(arguments: &RunArguments) -> Vec<OsString> {
    let image = &arguments.image;
    let patience = arguments.patience.to_arguments();
    let mut line: Vec<OsString> = match arguments.host {
        Host::Native => return ["controller".into()].into_iter().chain(patience).collect(),
        Host::Drivers => vec!["bridge".into(), "drivers".into()],
        Host::Qemu => vec!["bridge".into(), "qemu".into()],
        Host::Serial => vec!["bridge".into(), "serial".into()],
    };
    line.extend(patience);
    line.extend(["--scenario-name".into(), arguments.scenario.name().into()]);
    let paths: &[(&str, &Option<PathBuf>)] = match arguments.host {
        Host::Serial => &[("--port", &arguments.port), ("--timing", &image.timing)],
        Host::Drivers => &[("--timing", &image.timing)],
        Host::Native | Host::Qemu => &[],
    };
    for (option, path) in paths {
        if let Some(path) = path {
            line.extend([option.into(), path.into()]);
        }
    }
    if arguments.host == Host::Drivers {
        let probability = arguments.lines.bit_errors.to_string();
        line.extend(["--bit-errors".into(), probability.into()]);
    }
    if arguments.host == Host::Qemu {
        line.extend(image.to_arguments());
    }
    line
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

/// Prints a report as JSON or as a table.
///
/// # Errors
/// [`CommandError::Output`] if the report cannot be written.
pub fn print(report: &RunReport, json: bool) -> Result<(), CommandError> {
    let text = if json {
        serde_json::to_string(report).map_err(output)?
    } else {
        terminal::readable(report.table())
    };
    say(text)
}
