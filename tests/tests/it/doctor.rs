//! `painleve doctor` removes dead buses and segments, and keeps live and undecidable ones.

#![allow(clippy::unwrap_used)]

use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use nix::unistd::getuid;
use painleve_tests::{Bench, code, errors, is_running, program, unshared};

const SOON: Duration = Duration::from_secs(20);

/// Buses in a separate folder.
struct Ward {
    bench: Bench,
    runtime: PathBuf,
}

impl Ward {
    fn new(name: &str) -> Self {
        let bench = Bench::new(name);
        let runtime = bench.path("runtime");
        let ward = Self { bench, runtime };
        private_folder(&ward.runtime);
        ward
    }

    /// Starts a plant and waits until it is ready for a controller.
    fn plant(&self, bus: &str) -> Child {
        let mut command = self.bench.command(&["plant", "--bus", bus, "--no-record"]);
        command
            .args(["--no-plot", "--wait-s", "60"])
            .env("XDG_RUNTIME_DIR", &self.runtime)
            .stderr(Stdio::null());
        let child = command.spawn().unwrap();
        let start = Instant::now();
        while !is_ready(&self.runtime.join("painleve").join(bus)) {
            assert!(start.elapsed() < SOON, "the plant does not get ready");
            std::thread::sleep(Duration::from_millis(5));
        }
        child
    }

    /// Returns the output of the doctor.
    fn doctor(&self, arguments: &[&str]) -> String {
        let mut command = self.bench.command(&[&["doctor"], arguments].concat());
        said(
            command
                .env("XDG_RUNTIME_DIR", &self.runtime)
                .output()
                .unwrap(),
        )
    }
}

fn private_folder(path: &Path) {
    fs::create_dir(path).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o700)).unwrap();
}

fn said(output: Output) -> String {
    assert_eq!(code(output.status), 0, "{output:?}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The folder of the bus's run, without the folders before it.
fn run_of(bus: &Path) -> Option<String> {
    let mut entries = fs::read_dir(bus).ok()?.flatten();
    let run = entries.find(|entry| entry.path().is_dir())?;
    Some(run.file_name().to_string_lossy().into_owned())
}

fn is_ready(bus: &Path) -> bool {
    run_of(bus).is_some_and(|run| bus.join(run).join("ready").exists())
}

/// The files of a run in shared memory.
fn segments(run: &str) -> Vec<PathBuf> {
    let prefix = format!("painleve_{}_{run}_", getuid());
    let entries = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix))
        .map(|entry| entry.path())
        .collect()
}

fn end(mut child: Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Shared memory is one for all tests, each of which may be a process of its own: a repair of one test would remove what
/// another left on purpose. Locked while the file is open.
fn alone() -> File {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("doctor.lock");
    let file = File::create(path).unwrap();
    file.lock().unwrap();
    file
}

#[test]
fn what_is_dead_is_removed_and_what_is_alive_stays() {
    let _alone = alone();
    let ward = Ward::new("doctor");
    let (dead, alive) = (ward.plant("dies"), ward.plant("lives"));
    end(dead);
    let found = ward.doctor(&[]);
    assert!(
        found.contains("bus dies") && found.contains("dead"),
        "{found}"
    );
    let repaired = ward.doctor(&["--repair"]);
    assert!(!repaired.contains("bus dies"), "{repaired}");
    assert!(repaired.contains("in use by a plant"), "{repaired}");
    assert!(is_running(i32::try_from(alive.id()).unwrap()));
    let run = run_of(&ward.runtime.join("painleve/lives")).unwrap();
    assert!(segments(&run).len() > 1);
    end(alive);
    ward.doctor(&["--repair"]);
    assert_eq!(segments(&run), [""; 0].map(PathBuf::from));
}

/// The bus of a run may be out of sight, in another runtime folder or another container.
#[test]
fn segments_are_judged_by_their_own_lock_when_their_bus_is_out_of_sight() {
    let _alone = alone();
    let (ward, other) = (Ward::new("seen"), Ward::new("unseen"));
    let plant = other.plant("elsewhere");
    let run = run_of(&other.runtime.join("painleve/elsewhere")).unwrap();
    let in_use = segments(&run).len();
    ward.doctor(&["--repair"]);
    assert_eq!(segments(&run).len(), in_use, "taken from a living plant");
    end(plant);
    assert!(ward.doctor(&[]).contains(&run));
    assert!(!ward.doctor(&["--repair"]).contains(&run));
    assert!(segments(&run).is_empty());
}

/// From another PID namespace the doctor cannot see the processes that use the memory.
#[test]
fn processes_of_another_pid_namespace_are_alive() {
    let _alone = alone();
    let ward = Ward::new("namespace");
    let plant = ward.plant("outside");
    let run = run_of(&ward.runtime.join("painleve/outside")).unwrap();
    let in_use = segments(&run).len();
    // With another runtime folder, too, only the memory is shared.
    for runtime in ["runtime", "inside"] {
        let runtime = ward.bench.path(runtime);
        if !runtime.exists() {
            private_folder(&runtime);
        }
        let mut doctor = Command::new(program());
        doctor
            .args(["doctor", "--repair"])
            .env("XDG_RUNTIME_DIR", &runtime);
        let Some(output) = unshared(&["--pid", "--fork", "--mount-proc"], &mut doctor) else {
            break;
        };
        let table = said(output);
        assert!(table.contains(&run) && table.contains("in use"), "{table}");
        assert_eq!(segments(&run).len(), in_use, "taken from a living plant");
        assert!(is_running(i32::try_from(plant.id()).unwrap()));
    }
    end(plant);
    ward.doctor(&["--repair"]);
    assert!(segments(&run).is_empty());
}

#[test]
fn what_cannot_be_proved_dead_is_named_and_left() {
    let _alone = alone();
    let ward = Ward::new("unknown");
    let run = "Zz0Zz0Zz0Zz0";
    let orphan = format!("/dev/shm/painleve_{}_{run}_x.data", getuid());
    fs::write(&orphan, "x").unwrap();
    let table = ward.doctor(&["--repair"]);
    let stays = Path::new(&orphan).exists();
    fs::remove_file(&orphan).unwrap();
    assert!(stays);
    assert!(
        table.contains(run) && table.contains("lock file"),
        "{table}"
    );
}

#[test]
fn a_folder_that_cannot_be_used_is_named_with_what_to_do() {
    let _alone = alone();
    let bench = Bench::new("no-folder");
    let blocked = bench.path("blocked");
    private_folder(&blocked);
    fs::write(blocked.join("painleve"), "a file").unwrap();
    let mut doctor = bench.command(&["doctor"]);
    let output = doctor.env("XDG_RUNTIME_DIR", &blocked).output().unwrap();
    assert_eq!(code(output.status), 3, "{output:?}");
    assert!(errors(&output).contains("blocked/painleve"), "{output:?}");
}

/// The doctor used to judge limits that root does not need, and contradicted the runs.
#[test]
fn the_doctor_and_a_run_say_the_same_about_real_time() {
    let ward = Ward::new("doctor-realtime");
    let state: serde_json::Value = serde_json::from_str(&ward.doctor(&["--json"])).unwrap();
    let scheduling = state["scheduling"].as_str().unwrap();
    // What follows depends on the size of the process.
    let verdict = scheduling.split(", memory").next().unwrap();
    assert!(verdict.starts_with("real time: "), "{verdict}");
    let mut rows = state.as_object().unwrap().keys();
    assert!(rows.all(|row| !row.contains("real-time")), "{state}");
    let run = ["run", "--pacing", "realtime", "--no-record", "--no-plot"];
    let short = ["--set", "run.duration_s=0.05"];
    let output = ward.bench.run(&[&run[..], &short].concat());
    assert!(errors(&output).contains(verdict), "{}", errors(&output));
    // What was granted is no warning; that a tick came late is the machine's.
    if scheduling == "real time: SCHED_FIFO priority 49, memory locked" {
        let output = ward.bench.run(&[&run[..], &short, &["--quiet"]].concat());
        let messages = errors(&output);
        let mut others = messages
            .lines()
            .filter(|line| !line.starts_with("real time was missed: "));
        assert_eq!(others.next(), None, "{messages}");
    }
}
