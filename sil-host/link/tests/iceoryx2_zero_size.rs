//! Minimal reproduction of the fault of iceoryx2-cal 0.9.3 (and 0.10.0) that the link contains:
//! opening a segment of size zero never ends, whatever the timeout. A process that dies between
//! `shm_open` and `ftruncate` leaves such a segment.
//!
//! If this test fails after an upgrade, the fault is fixed: `open_impl` in
//! `dynamic_storage/posix_shared_memory.rs` checks its timeout in the match arm
//! `MappingSizeIsZero`, and the removal of half-made segments in `run_files` and `guardian` can be
//! deleted.

use std::fs::{self, OpenOptions};
use std::time::Duration;

use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode, ipc,
};

/// Removes every segment with a given prefix when dropped; iceoryx2 leaves its management segment
/// behind.
struct Segments(String);

impl Drop for Segments {
    fn drop(&mut self) {
        for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.0) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

#[test]
fn opening_a_segment_of_size_zero_ends_only_when_it_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let prefix = format!("iox2_zero_{}_", std::process::id());
    // Declared before the nodes, so that it is dropped after them.
    let _segments = Segments(prefix.clone());
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix.as_bytes()).unwrap();
    let root = folder.path().to_str().unwrap();
    config
        .global
        .set_root_path(&Path::new(root.as_bytes()).unwrap());
    config.global.creation_timeout = Duration::from_millis(50);
    let node = || {
        NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .unwrap()
    };
    let name = "service".try_into().unwrap();
    let owner = node();
    let service = owner.service_builder(&name).publish_subscribe::<u64>();
    let _service = service.create().unwrap();
    let segment = fs::read_dir("/dev/shm")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| {
            let name = path.file_name().unwrap().to_string_lossy();
            name.starts_with(&prefix) && name.ends_with(".dynamic")
        })
        .unwrap();
    // The state after shm_open and before ftruncate.
    fs::remove_file(&segment).unwrap();
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&segment)
        .unwrap();

    std::thread::scope(|scope| {
        let opening = scope.spawn(|| {
            let other = node();
            let service = other.service_builder(&name).publish_subscribe::<u64>();
            service.open().is_err()
        });
        std::thread::sleep(20 * config.global.creation_timeout);
        assert!(!opening.is_finished(), "the call has checked its timeout");
        fs::remove_file(&segment).unwrap();
        assert!(opening.join().unwrap());
    });
}
