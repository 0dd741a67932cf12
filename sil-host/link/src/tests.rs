//! Tests of both ends together: in threads for the exchange of messages, in processes for killed
//! peers.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use painleve_process::interrupt::Interrupt;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::place::{Place, SHARED_MEMORY};
use super::*;

mod exchange;
mod files;
mod peers;
mod real_time;
mod session_model;

/// Longer than any pause of a busy test machine.
const PATIENT: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(100);

/// A bus in its own folder, so that a test can see which files remain.
#[derive(Clone)]
struct TestBus {
    name: BusName,
    place: Place,
    pair: Option<Pair>,
    files: Option<Arc<Files>>,
}

/// The files of a test, removed at its end even if the test fails.
struct Files {
    folder: tempfile::TempDir,
    prefix: String,
}

impl Files {
    fn left(&self) -> Vec<PathBuf> {
        let mut left = Vec::new();
        find(Path::new(SHARED_MEMORY), &self.prefix, &mut left);
        find(self.folder.path(), "", &mut left);
        left
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        for path in self.left() {
            let _ = std::fs::remove_file(path);
        }
    }
}

impl TestBus {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bus = Self::named(BusName::unique(), folder.path().to_path_buf());
        let prefix = bus.place.prefix.clone();
        Self {
            files: Some(Arc::new(Files { folder, prefix })),
            ..bus
        }
    }

    fn named(name: BusName, folder: PathBuf) -> Self {
        let prefix = format!("iox2_test_{name}_");
        Self {
            name,
            place: Place { folder, prefix },
            pair: None,
            files: None,
        }
    }

    fn plant(&self) -> Result<PlantEnd, LinkError> {
        let mut plant = PlantEnd::create_in(
            self.place.clone(),
            &self.name,
            self.pair,
            &session(),
            &Interrupt::default(),
        )?;
        plant.set_silence_limit(PATIENT);
        Ok(plant)
    }

    fn controller(&self, timeout: Duration) -> Result<(ControllerEnd, Session), LinkError> {
        self.controller_with(PATIENT, timeout)
    }

    fn controller_with(
        &self,
        silence_limit: Duration,
        timeout: Duration,
    ) -> Result<(ControllerEnd, Session), LinkError> {
        ControllerEnd::open_in(
            self.place.clone(),
            &self.name,
            self.pair,
            timeout,
            silence_limit,
            &Interrupt::default(),
        )
    }

    /// Starts a controller in a thread that does this with its end and the session.
    fn spawn<T: Send + 'static>(
        &self,
        act: impl FnOnce(ControllerEnd, Session) -> T + Send + 'static,
    ) -> JoinHandle<T> {
        self.spawn_with(PATIENT, act)
    }

    /// The same with another limit of the plant's silence.
    fn spawn_with<T: Send + 'static>(
        &self,
        silence_limit: Duration,
        act: impl FnOnce(ControllerEnd, Session) -> T + Send + 'static,
    ) -> JoinHandle<T> {
        let bus = self.clone();
        thread::spawn(move || {
            let (controller, session) = bus.controller_with(silence_limit, PATIENT).unwrap();
            act(controller, session)
        })
    }

    /// Starts a controller in a thread; it answers every frame and returns their number.
    fn echo(&self) -> JoinHandle<Result<u32, LinkError>> {
        self.spawn(|controller, _| answer_all(controller))
    }

    /// A plant, and the [`echo`](Self::echo) that it has waited for.
    fn plant_and_echo(&self) -> (PlantEnd, JoinHandle<Result<u32, LinkError>>) {
        let mut plant = self.plant().unwrap();
        let controller = self.echo();
        plant.wait_for_controller(PATIENT).unwrap();
        (plant, controller)
    }

    /// Lets a controller join a plant, and expects their session to leave nothing behind.
    #[track_caller]
    fn assert_works(&self, mut plant: PlantEnd) {
        let controller = self.echo();
        plant.wait_for_controller(PATIENT).unwrap();
        finish(plant, controller);
        self.assert_nothing_left();
    }

    /// The bus as its ends use it.
    fn bus(&self) -> claim::Bus {
        claim::Bus {
            name: self.name.clone(),
            place: self.place.clone(),
        }
    }

    /// Starts this test binary again as one end in its own process.
    fn process(&self, role: &str) -> Process {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "tests::end_in_a_process"])
            .args(["--ignored", "--nocapture"])
            .env(ROLE, role)
            .env(BUS, self.name.as_str())
            .env(FOLDER, &self.place.folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Process(child)
    }

    #[track_caller]
    fn assert_nothing_left(&self) {
        let left = self.files.as_ref().unwrap().left();
        assert!(left.is_empty(), "left behind: {left:?}");
    }
}

/// Exchanges one frame, ends the session, and expects the controller to end with it.
#[track_caller]
fn finish(mut plant: PlantEnd, controller: JoinHandle<Result<u32, LinkError>>) {
    plant.exchange(&sensor(1)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
}

fn find(folder: &Path, prefix: &str, found: &mut Vec<PathBuf>) {
    // Another run may be removing its files; an unreadable file counts as removed.
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            find(&path, prefix, found);
        } else if entry.file_name().to_string_lossy().starts_with(prefix) {
            found.push(path);
        }
    }
}

/// Line that [`end_in_a_process`] prints once its end is open.
const OPEN: &str = "end is open";
const ROLE: &str = "PAINLEVE_TEST_ROLE";
const BUS: &str = "PAINLEVE_TEST_BUS";
const FOLDER: &str = "PAINLEVE_TEST_FOLDER";

/// Killed with SIGKILL when dropped.
struct Process(Child);

impl Process {
    fn wait_until_open(&mut self) {
        let said = BufReader::new(self.0.stdout.take().unwrap());
        assert!(
            said.lines().any(|line| line.unwrap().ends_with(OPEN)),
            "the process has failed to open its end"
        );
    }

    fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Not a test, but one end in the process that [`TestBus::process`] starts.
#[test]
#[ignore = "the other process of a test"]
fn end_in_a_process() {
    let Ok(role) = std::env::var(ROLE) else {
        return;
    };
    let bus = TestBus::named(
        std::env::var(BUS).unwrap().parse().unwrap(),
        std::env::var_os(FOLDER).unwrap().into(),
    );
    match role.as_str() {
        "controller" => {
            let (controller, _) = bus.controller(PATIENT).unwrap();
            println!("{OPEN}");
            answer_all(controller).unwrap();
        }
        "plant" => {
            let mut plant = bus.plant().unwrap();
            println!("{OPEN}");
            plant.wait_for_controller(PATIENT).unwrap();
            for tick in 0.. {
                plant.exchange(&sensor(tick)).unwrap();
            }
        }
        // A controller that holds the bus but never answers.
        "mute" => {
            let _end = bus.controller(PATIENT).unwrap();
            println!("{OPEN}");
            thread::sleep(PATIENT);
        }
        other => panic!("no role {other}"),
    }
}

fn session() -> Session {
    Session {
        tick_hz: 1000,
        pacing: Pacing::Lockstep,
        configuration: vec![1, 2, 3],
    }
}

fn sensor(tick: u32) -> SensorFrame {
    SensorFrame {
        tick,
        sequence: tick.wrapping_mul(3),
        ..SensorFrame::default()
    }
}

fn answer(frame: &SensorFrame) -> ActuatorFrame {
    ActuatorFrame {
        tick: frame.tick,
        sequence: frame.sequence,
        ..ActuatorFrame::default()
    }
}

fn answer_all(mut controller: ControllerEnd) -> Result<u32, LinkError> {
    let mut count = 0;
    while let Received::Frame(frame) = controller.receive()? {
        controller.send(&answer(&frame))?;
        count += 1;
    }
    Ok(count)
}
