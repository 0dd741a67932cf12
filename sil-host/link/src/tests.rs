//! Tests of both ends together: in threads for the exchange of messages, in processes for killed
//! peers.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use nix::sys::signal::Signal;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_system::interrupt::Interrupt;

use super::place::{Place, SHARED_MEMORY};
use super::*;

mod session_model;

/// Longer than any pause of a busy test machine.
const PATIENT: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(100);

/// A bus in its own folder, so that a test can see which files remain.
#[derive(Clone)]
struct TestBus {
    name: BusName,
    place: Place,
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
            files: None,
        }
    }

    fn plant(&self) -> Result<PlantEnd, LinkError> {
        let mut plant = PlantEnd::create_in(
            self.place.clone(),
            &self.name,
            &session(),
            &Interrupt::default(),
        )?;
        plant.set_silence_limit(PATIENT);
        Ok(plant)
    }

    fn controller(&self, timeout: Duration) -> Result<(ControllerEnd, Session), LinkError> {
        let (mut controller, session) = ControllerEnd::open_in(
            self.place.clone(),
            &self.name,
            timeout,
            &Interrupt::default(),
        )?;
        controller.set_silence_limit(PATIENT);
        Ok((controller, session))
    }

    /// Starts a controller in a thread; it answers every frame and returns their number.
    fn echo(&self) -> thread::JoinHandle<Result<u32, LinkError>> {
        let bus = self.clone();
        thread::spawn(move || answer_all(bus.controller(PATIENT)?.0))
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

#[test]
fn every_frame_is_answered() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    let first = u32::MAX - 500;
    for n in 0..1000 {
        let frame = sensor(first.wrapping_add(n));
        assert_eq!(plant.exchange(&frame).unwrap(), answer(&frame));
    }
    plant.end().unwrap();
    assert_eq!(controller.join().unwrap().unwrap(), 1000);
    bus.assert_nothing_left();
}

#[test]
fn a_late_controller_receives_the_session_and_all_further_frames() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    for tick in 0..10 {
        plant.send(&sensor(tick)).unwrap();
    }
    let controller = {
        let bus = bus.clone();
        thread::spawn(move || {
            let (mut controller, session) = bus.controller(PATIENT).unwrap();
            (session, controller.receive().unwrap())
        })
    };
    plant.wait_for_controller(PATIENT).unwrap();
    plant.send(&sensor(10)).unwrap();
    let (learned, received) = controller.join().unwrap();
    assert_eq!(learned, session());
    assert_eq!(received, Received::Frame(sensor(10)));
    drop(plant);
    bus.assert_nothing_left();
}

#[test]
fn frames_sent_in_a_burst_arrive_in_order_and_before_the_end() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let (sent, all_sent) = std::sync::mpsc::channel();
    let controller = {
        let bus = bus.clone();
        thread::spawn(move || {
            let (mut controller, _) = bus.controller(PATIENT).unwrap();
            all_sent.recv().unwrap();
            let mut ticks = Vec::new();
            while let Received::Frame(frame) = controller.receive().unwrap() {
                ticks.push(frame.tick);
            }
            ticks
        })
    };
    plant.wait_for_controller(PATIENT).unwrap();
    let burst = FRAME_BUFFER as u32 + 6;
    for tick in 0..burst {
        plant.send(&sensor(tick)).unwrap();
    }
    plant.end().unwrap();
    sent.send(()).unwrap();
    // More than the buffer holds: the oldest six are dropped.
    assert_eq!(controller.join().unwrap(), (6..burst).collect::<Vec<_>>());
    bus.assert_nothing_left();
}

#[test]
fn answers_are_received_without_waiting() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    assert!(plant.try_receive().unwrap().is_none());
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    for tick in 0..3 {
        plant.send(&sensor(tick)).unwrap();
    }
    let mut answered = Vec::new();
    while answered.len() < 3 {
        match plant.try_receive().unwrap() {
            Some(frame) => answered.push(frame.tick),
            None => thread::yield_now(),
        }
    }
    assert_eq!(answered, [0, 1, 2]);
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
}

#[test]
fn a_second_plant_is_refused_and_the_first_continues() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let error = bus.plant().err().unwrap();
    assert!(matches!(&error, LinkError::BusInUse { bus: named } if *named == bus.name));
    assert!(error.to_string().contains(bus.name.as_str()));

    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(1)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn a_second_controller_is_refused_and_the_first_continues() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    let error = bus.controller(PATIENT).err().unwrap();
    assert!(matches!(&error, LinkError::ControllerInUse { bus: named } if *named == bus.name));

    plant.exchange(&sensor(1)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn simultaneous_buses_do_not_interfere() {
    let a = TestBus::new();
    let b = TestBus {
        name: BusName::unique(),
        ..a.clone()
    };
    let mut plants = [a.plant().unwrap(), b.plant().unwrap()];
    let controllers = [a.echo(), b.echo()];
    for (index, plant) in plants.iter_mut().enumerate() {
        plant.wait_for_controller(PATIENT).unwrap();
        for tick in 0..=index as u32 {
            plant.exchange(&sensor(tick)).unwrap();
        }
    }
    for plant in plants {
        plant.end().unwrap();
    }
    assert_eq!(controllers.map(|c| c.join().unwrap().unwrap()), [1, 2]);
    a.assert_nothing_left();
}

#[test]
fn the_error_about_a_missing_plant_names_the_command_to_start() {
    let bus = TestBus::new();
    let error = bus.controller(SHORT).err().unwrap();
    assert!(matches!(error, LinkError::PlantMissing { .. }));
    let advice = format!("painleve plant --bus {}", bus.name);
    assert!(error.to_string().contains(&advice), "{error}");
    bus.assert_nothing_left();
}

#[test]
fn the_error_about_a_missing_controller_names_the_command_to_start() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let error = plant.wait_for_controller(SHORT).unwrap_err();
    assert!(matches!(error, LinkError::ControllerMissing { .. }));
    let advice = format!("painleve controller --bus {}", bus.name);
    assert!(error.to_string().contains(&advice), "{error}");
    assert!(matches!(
        plant.exchange(&sensor(0)),
        Err(LinkError::ControllerGone { .. })
    ));
}

#[test]
fn a_plant_that_leaves_without_ending_the_session_is_detected() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(0)).unwrap();
    drop(plant);
    assert!(matches!(
        controller.join().unwrap(),
        Err(LinkError::PlantGone { .. })
    ));
    bus.assert_nothing_left();
}

#[test]
fn an_answer_to_a_wrong_tick_is_an_error() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = {
        let bus = bus.clone();
        thread::spawn(move || {
            let (mut controller, _) = bus.controller(PATIENT).unwrap();
            controller.receive().unwrap();
            controller.send(&answer(&sensor(6))).unwrap();
            controller.receive().unwrap()
        })
    };
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(matches!(
        plant.exchange(&sensor(7)),
        Err(LinkError::WrongTick {
            asked: 7,
            answered: 6,
            ..
        })
    ));
    plant.end().unwrap();
    assert_eq!(controller.join().unwrap(), Received::End);
}

#[test]
fn a_silent_live_controller_is_detected() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let _mute = bus.process("mute");
    plant.wait_for_controller(PATIENT).unwrap();
    plant.set_silence_limit(SHORT);
    assert!(matches!(
        plant.exchange(&sensor(0)),
        Err(LinkError::ControllerSilent { .. })
    ));
    plant.send(&sensor(1)).unwrap();
    let error = loop {
        match plant.try_receive() {
            Ok(_) => thread::sleep(Duration::from_millis(1)),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, LinkError::ControllerSilent { .. }));
}

#[test]
fn a_silent_live_plant_is_detected() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = {
        let bus = bus.clone();
        thread::spawn(move || {
            let (mut controller, _) = bus.controller(PATIENT).unwrap();
            controller.set_silence_limit(SHORT);
            controller.receive()
        })
    };
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(matches!(
        controller.join().unwrap(),
        Err(LinkError::PlantSilent { .. })
    ));
}

#[test]
fn a_killed_controller_is_detected_and_the_bus_can_be_used_again() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let mut killed = bus.process("controller");
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(0)).unwrap();
    killed.kill();
    // Well before the silence limit, which would give another error.
    assert!(matches!(
        plant.exchange(&sensor(1)),
        Err(LinkError::ControllerGone { .. })
    ));
    plant.send(&sensor(2)).unwrap();
    let error = loop {
        match plant.try_receive() {
            Ok(_) => thread::sleep(Duration::from_millis(1)),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, LinkError::ControllerGone { .. }));

    // The surviving plant can continue with another controller...
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(3)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn a_killed_plant_is_detected_and_the_bus_can_be_used_again() {
    let bus = TestBus::new();
    let mut killed = bus.process("plant");
    let (mut survivor, _) = bus.controller(PATIENT).unwrap();
    for _ in 0..100 {
        let Received::Frame(frame) = survivor.receive().unwrap() else {
            panic!("the plant has not ended the session");
        };
        survivor.send(&answer(&frame)).unwrap();
    }
    killed.kill();
    // A new plant starts while the surviving controller is still there.
    let restarted = {
        let bus = bus.clone();
        thread::spawn(move || {
            let mut plant = bus.plant().unwrap();
            plant.wait_for_controller(PATIENT).unwrap();
            plant.exchange(&sensor(0)).unwrap();
            plant.end().unwrap();
        })
    };
    let error = loop {
        match survivor.receive() {
            Ok(Received::Frame(frame)) => survivor.send(&answer(&frame)).unwrap(),
            Ok(Received::End) => panic!("the plant was killed before any end"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, LinkError::PlantGone { .. }), "{error}");
    drop(survivor);

    assert_eq!(bus.echo().join().unwrap().unwrap(), 1);
    restarted.join().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn the_next_run_removes_the_files_of_two_killed_processes() {
    let bus = TestBus::new();
    let mut plant = bus.process("plant");
    let mut mute = bus.process("mute");
    mute.wait_until_open();
    plant.kill();
    mute.kill();

    let mut plant = bus.plant().unwrap();
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(0)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn the_link_installs_no_signal_handlers() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(0)).unwrap();

    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let caught = u64::from_str_radix(caught.unwrap().trim(), 16).unwrap();
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        assert_eq!(caught >> (signal as u32 - 1) & 1, 0, "{signal} is caught");
    }
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
}

/// The place of a bus on which a controller died after it had joined and created a segment of size
/// zero.
fn dead_controller(bus: &TestBus) -> PathBuf {
    let bus = claim::Bus {
        name: bus.name.clone(),
        place: bus.place.clone(),
    };
    let run = run_files::RunFiles::ready(&bus.folder(), &bus.place).unwrap();
    assert!(run.join().unwrap());
    let prefix = run.config().unwrap().global.prefix.to_string();
    let segment = Path::new(SHARED_MEMORY).join(format!("{prefix}half-made"));
    std::fs::write(&segment, "").unwrap();
    segment
}

#[test]
fn files_of_a_controller_that_died_while_joining_do_not_block_the_next() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let segment = dead_controller(&bus);
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(!segment.exists());
    plant.exchange(&sensor(0)).unwrap();
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
    bus.assert_nothing_left();
}

#[test]
fn a_dead_peers_half_made_segment_is_removed_and_a_live_peers_is_kept() {
    let test = TestBus::new();
    let bus = claim::Bus {
        name: test.name.clone(),
        place: test.place.clone(),
    };
    let claim = bus.claim(lock_file::Role::Plant).unwrap().unwrap();
    let run = run_files::RunFiles::create(&bus.folder(), &bus.place).unwrap();
    run.set_ready().unwrap();
    let guardian = guardian::Guardian::start(&claim).unwrap();
    let segment = dead_controller(&test);
    // A live controller's segment stays, because the controller may still be creating it.
    let peer = bus.claim(lock_file::Role::Controller).unwrap().unwrap();
    guardian.during(|| thread::sleep(Duration::from_millis(1200)));
    assert!(segment.exists());
    drop(peer);
    // Waits as iceoryx2 does: until the name disappears.
    guardian.during(|| {
        while segment.exists() {
            thread::sleep(Duration::from_millis(1));
        }
    });
}

#[test]
fn an_interrupt_ends_a_wait() {
    let bus = TestBus::new();
    let interrupt = Interrupt::default();
    let mut plant =
        PlantEnd::create_in(bus.place.clone(), &bus.name, &session(), &interrupt).unwrap();
    interrupt.request();
    assert!(matches!(
        plant.wait_for_controller(PATIENT),
        Err(LinkError::Interrupted)
    ));
    drop(plant);
    let opened = ControllerEnd::open_in(bus.place.clone(), &bus.name, PATIENT, &interrupt);
    assert!(matches!(opened, Err(LinkError::Interrupted)));
    bus.assert_nothing_left();
}
