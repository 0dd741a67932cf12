//! Too little shared memory, read-only disks, closed terminals, one core, a busy machine: a run
//! gives the same bits, or ends with one message and a documented exit code.

use std::process::{Command, Output};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use painleve_tests::{Bench, code, errors, program, skipped, unshared};

const SHORT: &str = "--set run.duration_s=0.05 --no-plot --json";
const SOON: Duration = Duration::from_secs(10);
const WITHOUT_STRACE: &str = "strace not found; on Debian: apt-get install strace";

/// Runs a shell command, in which `$P` is the program, in a separate mount namespace.
fn with_own_mounts(bench: &Bench, line: &str) -> Option<Output> {
    let mut shell = Command::new("bash");
    shell
        .args(["-c", line])
        .env("P", program())
        .current_dir(bench.path(""));
    unshared(&["--mount"], &mut shell)
}

/// Checks for a single error line that contains `part`.
fn assert_reported(output: &Output, exit: i32, part: &str) {
    let text = errors(output);
    assert_eq!(code(output.status), exit, "{output:?}");
    assert_eq!(text.trim().lines().count(), 1, "{text}");
    assert!(text.starts_with("error: ") && text.contains(part), "{text}");
}

#[test]
fn a_small_shared_memory_is_enough_or_is_reported() {
    let bench = Bench::new("small-shm");
    // Building the program, if it is not built yet, is not part of the time that is limited.
    program();
    let mut enough = 0;
    for kib in [4, 48, 128, 248, 256, 264, 300, 340, 400, 512, 1024] {
        let line =
            format!("mount -t tmpfs -o size={kib}k tmpfs /dev/shm && $P run --no-record {SHORT}");
        let start = Instant::now();
        let Some(output) = with_own_mounts(&bench, &line) else {
            return;
        };
        assert!(start.elapsed() < SOON, "{kib} KiB: {:?}", start.elapsed());
        if code(output.status) == 0 {
            enough += 1;
        } else {
            assert_eq!(enough, 0, "{kib} KiB is less than enough: {output:?}");
            assert_reported(&output, 3, "/dev/shm");
        }
    }
    assert!(enough > 0, "even 1 MiB is too little");
}

/// Another process fills the memory after the plant has checked the free space.
#[test]
fn a_shared_memory_that_fills_up_between_two_starts_ends_them() {
    let bench = Bench::new("filled-shm");
    let line = format!(
        "mount -t tmpfs -o size=1m tmpfs /dev/shm
         mkdir -m 700 runtime && export XDG_RUNTIME_DIR=$PWD/runtime
         $P plant --bus full --wait-s 2 --no-record {SHORT} 2>plant & plant=$!
         until ls runtime/painleve/full/*/ready; do sleep 0.01; done >/dev/null 2>&1
         cat /dev/zero >/dev/shm/filler 2>/dev/null
         $P controller --bus full; controller=$?
         wait $plant; echo $controller $?"
    );
    let Some(output) = with_own_mounts(&bench, &line) else {
        return;
    };
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "3 3\n",
        "{output:?}"
    );
    assert_reported(&output, 0, "/dev/shm");
    // The plant misses its controller, or needs memory for the connection to it.
    let plant = std::fs::read_to_string(bench.path("plant")).unwrap();
    assert!(plant.starts_with("error: "), "{plant}");
    assert_eq!(plant.trim().lines().count(), 1, "{plant}");
}

/// iceoryx2 does not tell what the system has refused it.
#[test]
fn what_the_system_refuses_is_named_with_its_remedy() {
    let bench = Bench::new("refused");
    for (limit, part) in [
        ("-f 4", "raise `ulimit -f`"),
        ("-n 16", "raise `ulimit -n`"),
    ] {
        let output = bench.shell(&format!("ulimit {limit}; $P run --no-record {SHORT}"));
        assert_reported(&output, 3, part);
    }
    let line = format!(
        "mkdir -m 700 runtime && mount -t tmpfs -o size=64k,mode=700 tmpfs runtime
         head -c 60k /dev/zero > runtime/filler
         XDG_RUNTIME_DIR=$PWD/runtime $P run --no-record {SHORT}"
    );
    if let Some(output) = with_own_mounts(&bench, &line) {
        assert_reported(&output, 3, "/runtime/painleve/");
        assert!(errors(&output).contains("No space left"), "{output:?}");
    }
}

#[test]
fn read_only_folders_are_reported() {
    let bench = Bench::new("read-only");
    std::fs::create_dir(bench.path("disk")).unwrap();
    let mounted = "mount -t tmpfs -o ro tmpfs disk && cd disk";
    let Some(no_record) = with_own_mounts(&bench, &format!("{mounted} && $P run {SHORT}")) else {
        return;
    };
    assert_reported(&no_record, 4, "Read-only");
    // The program is opened before: the workspace may be in one of the hidden folders.
    let line = format!(
        "exec 9< $P && {mounted} && XDG_RUNTIME_DIR= && mount -t tmpfs -o ro tmpfs /tmp && \
         if [ -d /run/user ]; then mount -t tmpfs -o ro tmpfs /run/user; fi && \
         exec /proc/self/fd/9 controller --bus b"
    );
    if let Some(no_bus) = with_own_mounts(&bench, &line) {
        assert_reported(&no_bus, 3, "Read-only");
    }
}

/// A power failure loses neither a reported file nor the new folders that lead to it.
#[test]
fn data_and_names_are_on_the_disk_before_a_file_is_reported() {
    let bench = Bench::new("power");
    let mut traced = Command::new("strace");
    traced
        .args(["-f", "-y", "-o", "trace"])
        .args(["-e", "trace=write,fsync,rename,renameat,renameat2"])
        .arg(program())
        .args(["run", "--record", "new/deeper/run.mcap"])
        .args(SHORT.split(' '))
        .current_dir(bench.path(""));
    let Ok(output) = traced.output() else {
        return skipped(WITHOUT_STRACE);
    };
    assert_eq!(code(output.status), 0, "{output:?}");
    let trace = std::fs::read_to_string(bench.path("trace")).unwrap();
    let calls: Vec<_> = trace.lines().collect();
    let folder = bench.path("").canonicalize().unwrap();
    let at = |call: &str, path: &str| {
        let path = format!("{}{path}", folder.display());
        calls
            .iter()
            .rposition(|line| line.contains(call) && line.contains(&path))
            .unwrap_or_else(|| panic!("no {call} of {path} in {trace}"))
    };
    let data = at("fsync(", "/new/deeper/.run.mcap.");
    let named = at("rename", "/new/deeper>, \"run.mcap\"");
    let name = at("fsync(", "/new/deeper>");
    let folders = [at("fsync(", "/new>"), at("fsync(", ">")];
    let reported = calls.iter().rposition(|line| line.contains("write(1<"));
    let reported = reported.expect("the report");
    assert!(data < named && named < name && name < reported, "{trace}");
    assert!(folders.iter().all(|folder| *folder < reported), "{trace}");
}

/// The second memory that a thread asks for is its stack for signals. Only the threads of the first process are refused it:
/// strace lets go of a process that executes a program, which would report a refusal of its own.
#[test]
fn memory_refused_to_a_new_thread_ends_a_run_with_one_message() {
    let bench = Bench::new("thread");
    let mut starved = Command::new("strace");
    starved
        .args(["-f", "-b", "execve", "-qq", "-o", "trace"])
        .args(["-e", "trace=mmap"])
        .args(["-e", "inject=mmap:error=ENOMEM:when=2"])
        .arg(program())
        .args(["run", "--no-record"])
        .args(SHORT.split(' '))
        .current_dir(bench.path(""));
    match starved.output() {
        Ok(output) => assert_reported(&output, 3, "refuses"),
        Err(_) => skipped(WITHOUT_STRACE),
    }
}

#[test]
fn closed_streams_do_not_disturb_a_run() {
    let bench = Bench::new("closed");
    let output = bench.shell(&format!("$P run {SHORT} <&- >&- 2>&-"));
    assert_eq!(code(output.status), 0, "{output:?}");
    // No output that was meant for a stream is in a file.
    let record = std::fs::read(bench.path("out/run.mcap")).unwrap();
    let summary = mcap::Summary::read(&record).unwrap().unwrap();
    assert!(summary.stats.unwrap().message_count > 0);
}

#[test]
fn one_core_and_a_busy_machine_give_the_same_bits() {
    let bench = Bench::new("one-core");
    let run = format!("$P run --no-record {SHORT} --silence-limit-s 30");
    let hash = |output: Output| {
        assert_eq!(code(output.status), 0, "{output:?}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        report["log_hash"].clone()
    };
    let idle = bench.shell(&run);
    let over = AtomicBool::new(false);
    let (busy, one_core) = std::thread::scope(|scope| {
        for _ in 0..2 * std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let outputs = (
            bench.shell(&run),
            bench.shell(&format!("taskset -c 0 {run}")),
        );
        over.store(true, Ordering::Relaxed);
        outputs
    });
    let idle = hash(idle);
    assert_eq!((hash(busy), hash(one_core)), (idle.clone(), idle));
}
