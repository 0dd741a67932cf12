//! Files of dead processes, and what the link leaves to the process.

use nix::sys::signal::Signal;

use super::*;

/// The place of a bus on which a controller died after it had joined and created a segment of size
/// zero.
fn dead_controller(bus: &TestBus) -> PathBuf {
    let bus = bus.bus();
    let run = run_files::RunFiles::ready(&bus.folder(), &bus.place, None).unwrap();
    assert!(run.join().unwrap());
    let prefix = run.config().unwrap().global.prefix.to_string();
    let segment = Path::new(SHARED_MEMORY).join(format!("{prefix}half-made"));
    std::fs::write(&segment, "").unwrap();
    segment
}

#[test]
fn the_next_run_removes_the_files_of_two_killed_processes() {
    let bus = TestBus::new();
    let mut plant = bus.process("plant");
    let mut mute = bus.process("mute");
    mute.wait_until_open();
    plant.kill();
    mute.kill();

    bus.assert_works(bus.plant().unwrap());
}

#[test]
fn files_of_a_controller_that_died_while_joining_do_not_block_the_next() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let segment = dead_controller(&bus);
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(!segment.exists());
    finish(plant, controller);
    bus.assert_nothing_left();
}

#[test]
fn a_dead_peers_half_made_segment_is_removed_and_a_live_peers_is_kept() {
    let test = TestBus::new();
    let bus = test.bus();
    let claim = bus.claim(lock_file::Role::Plant).unwrap().unwrap();
    let run = run_files::RunFiles::create(&bus.folder(), &bus.place).unwrap();
    run.set_ready(None).unwrap();
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
fn the_link_installs_no_signal_handlers() {
    let bus = TestBus::new();
    let (mut plant, controller) = bus.plant_and_echo();
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
