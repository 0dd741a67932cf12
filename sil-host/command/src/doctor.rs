//! `painleve doctor`: leftovers of earlier runs, and the machine's capabilities.

use clap::Args;
use nix::sys::resource::{Resource, getrlimit};
use nix::sys::utsname::uname;
use painleve_board::emulator;
use painleve_firmware::SOURCES;
use painleve_link::{BusState, LinkError, SegmentState, Survey};
use painleve_plant::law_choice::build;
use painleve_process::free_space::free_bytes;
use painleve_process::realtime::request_realtime;
use painleve_process::terminal;

use super::{CommandError, say};

/// Options of `painleve doctor`.
#[derive(Debug, Args)]
pub struct DoctorArguments {
    /// Remove what killed processes left behind. Anything in use, or not provably dead, is kept.
    #[arg(long)]
    repair: bool,
    /// Print one JSON object on stdout instead of the table: the state of each item.
    #[arg(long)]
    json: bool,
}

/// Repairs first if requested, then surveys the machine and prints a table.
///
/// # Errors
/// [`CommandError`] if a leftover cannot be removed, or the output cannot be written.
pub fn run(arguments: &DoctorArguments) -> Result<(), CommandError> {
    if arguments.repair {
        Survey::repair()?;
    }
    let mut rows: Vec<[String; 2]> = Vec::new();
    let mut row = |what: &str, state: String| rows.push([what.into(), state]);
    row(
        "version",
        format!(
            "{}, build {:016x}, sources {SOURCES:016x}",
            env!("CARGO_PKG_VERSION"),
            build()
        ),
    );
    row("system", system());
    row("emulator, image", image());
    let survey = Survey::take();
    match &survey {
        Ok(survey) => {
            row("folder of the buses", survey.folder.display().to_string());
            for bus in &survey.buses {
                row(&format!("bus {}", bus.name), users(bus).into());
            }
            for segments in &survey.segments {
                let name = format!("/dev/shm/{}*", segments.prefix);
                row(&name, state(segments.state).into());
            }
        }
        Err(error) => row("folder of the buses", error.to_string()),
    }
    row("shared memory", free("/dev/shm"));
    row(
        "temporary files",
        free(&std::env::temp_dir().to_string_lossy()),
    );
    for (what, resource, least) in LIMITS {
        row(what, limit(resource, least));
    }
    row("scheduling", request_realtime().to_string());
    if arguments.json {
        let states = rows.into_iter().map(|[what, state]| (what, state.into()));
        say(serde_json::Value::Object(states.collect()))?;
    } else {
        let mut table = terminal::table(["item", "state"]);
        table.add_rows(rows);
        say(terminal::readable_table(table))?;
    }
    survey.map(|_| ()).map_err(LinkError::into)
}

fn users(bus: &BusState) -> &'static str {
    match (bus.has_plant, bus.has_controller) {
        (true, true) => "in use by plant and controller",
        (true, false) => "in use by a plant",
        (false, true) => "in use by a controller without its plant",
        (false, false) => "dead: the next start or --repair removes it",
    }
}

fn state(state: SegmentState) -> &'static str {
    match state {
        SegmentState::InUse => "in use",
        SegmentState::Dead => "dead: --repair removes it",
        SegmentState::Unknown => {
            "no lock file, so it is not provably dead: --repair keeps it; remove it \
             yourself when no run is going on"
        }
    }
}

fn system() -> String {
    match uname() {
        Ok(name) => format!(
            "{} {} {}",
            name.sysname().to_string_lossy(),
            name.release().to_string_lossy(),
            name.machine().to_string_lossy()
        ),
        Err(error) => error.to_string(),
    }
}

fn image() -> String {
    match emulator::check(&emulator::default_image(), false) {
        Ok(()) => "ready for --host qemu".into(),
        Err(error) => error.to_string(),
    }
}

/// Limits, and the smallest sufficient values. Those of real time are judged by [`request_realtime`] alone: root needs none.
const LIMITS: [(&str, Resource, u64); 2] = [
    ("open files (ulimit -n)", Resource::RLIMIT_NOFILE, 64),
    (
        "file size (ulimit -f), bytes",
        Resource::RLIMIT_FSIZE,
        1 << 30,
    ),
];

fn limit(resource: Resource, least: u64) -> String {
    match getrlimit(resource) {
        Ok((u64::MAX, _)) => "unlimited".into(),
        Ok((most, _)) if most < least => format!("{most}: less than the sufficient {least}"),
        Ok((most, _)) => most.to_string(),
        Err(error) => error.to_string(),
    }
}

fn free(folder: &str) -> String {
    match free_bytes(folder) {
        Ok(Some(free)) => format!("{folder}, {} MB free", free / 1_000_000),
        Ok(None) => format!("{folder}, unlimited"),
        Err(error) => format!("{folder}: {error}"),
    }
}
