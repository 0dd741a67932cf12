//! What a command writes replaces nothing that it reads, nothing of another user's choice, and is never left half
//! written; what it reads may be anything.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, lchown, symlink};
use std::process::Output;
use std::time::Duration;

use nix::sys::stat::Mode;
use nix::unistd::{geteuid, mkfifo};
use painleve_tests::{Bench, code, errors, skipped};
use serde_json::{Value, json};

const SOON: Duration = Duration::from_secs(10);
const SHORT: [&str; 2] = ["--set", "run.duration_s=0.05"];
const CAMPAIGN: &str = "study = 'bifurcation'\nmu = 0.4\nv-belt = '-0.5:-0.3:0.1'\ninitial = 'a'\n\
    transient-s = 0.1\nrecord-s = 0.1\n";
/// A study that takes no time.
const STUDY: &str =
    "study bifurcation --mu 0.4 --v-belt=-0.4 --initial a --transient-s 0.1 --record-s 0.1";

fn run(bench: &Bench, line: &str) -> Output {
    bench.run(&line.split_whitespace().collect::<Vec<_>>())
}

/// Every file of a bench with its content.
fn contents(bench: &Bench) -> Vec<(String, Vec<u8>)> {
    let files = bench.files().into_iter();
    files
        .map(|name| {
            let bytes = fs::read(bench.path(&name)).unwrap_or_default();
            (name, bytes)
        })
        .collect()
}

const TUNE: &str = "tune s.toml --key controller.law.hybrid.velocity_gain_per_s=20:300 --trials 8";

/// A bench with a scenario, its files, a record and a finished sweep.
#[allow(clippy::unwrap_used)]
fn furnished(name: &str) -> Bench {
    let bench = Bench::new(name);
    fs::write(bench.path("belt.csv"), "time_s,speed_m_s\n0,-0.4\n1,-0.4\n").unwrap();
    fs::write(bench.path("friction.csv"), "time_s,change\n0,0\n1,0.1\n").unwrap();
    fs::write(
        bench.path("reference.csv"),
        "time_s,target_m\n0.1,0.01\n0.2,0.02\n",
    )
    .unwrap();
    fs::write(bench.path("campaign.toml"), CAMPAIGN).unwrap();
    let scenario = bench.run(&["scenarios", "edge"]).stdout;
    fs::write(bench.path("s.toml"), scenario).unwrap();
    for line in [
        "run edge --set run.duration_s=0.05 --no-plot --record r.mcap",
        "sweep plan campaign.toml --shards 2 --folder sw",
        "sweep run --all --folder sw",
    ] {
        assert!(run(&bench, line).status.success(), "{line}");
    }
    symlink("r.mcap", bench.path("link")).unwrap();
    // Figures need their extension.
    for (file, link) in [
        ("s.toml", "hard.toml"),
        ("s.toml", "s.svg"),
        ("friction.csv", "friction.svg"),
    ] {
        fs::hard_link(bench.path(file), bench.path(link)).unwrap();
    }
    bench
}

#[test]
fn no_output_replaces_an_input_or_another_output() {
    let bench = furnished("replace");
    let before = contents(&bench);
    let belt = "--set belt.profile={kind='file',path='belt.csv'}";
    let friction =
        "--set contact.kind=compliant --set effects.friction={kind='file',path='friction.csv'}";
    for (line, parts) in [
        ("export r.mcap --csv r.mcap", ["--csv", "r.mcap"]),
        ("export r.mcap --csv link", ["--csv", "r.mcap"]),
        ("export link --csv ./r.mcap", ["--csv", "link"]),
        ("export link --csv link", ["--csv", "link"]),
        ("run s.toml --record s.toml", ["--record", "s.toml"]),
        ("run s.toml --csv s.toml", ["--csv", "s.toml"]),
        ("run s.toml --html hard.toml", ["--html", "s.toml"]),
        ("run edge --record same --csv ./same", ["--record", "--csv"]),
        (
            "run edge --record new/same --plot new/x/../same",
            ["--record", "--plot"],
        ),
        (
            &format!("run edge {belt} --csv belt.csv"),
            ["--csv", "belt.csv"],
        ),
        (
            &format!("run edge {friction} --csv friction.csv"),
            ["--csv", "friction.csv"],
        ),
        (
            "run edge --set controller.reference=reference.csv --csv reference.csv",
            ["--csv", "reference.csv"],
        ),
        (
            "run edge --host drivers --record q.mcap --timing q.mcap",
            ["--record", "--timing"],
        ),
        (
            "run s.toml --host drivers --no-plot --timing s.toml",
            ["--timing", "s.toml"],
        ),
        (
            "run edge --host qemu --elf hard.toml --no-plot --record s.toml",
            ["--record", "hard.toml"],
        ),
        (
            "plant s.toml --bus b --record s.toml",
            ["--record", "s.toml"],
        ),
        (
            &format!("{STUDY} --csv same --svg same"),
            ["--csv", "--svg"],
        ),
        (
            &format!("{STUDY} --scenario s.toml --csv s.toml"),
            ["--csv", "s.toml"],
        ),
        (
            &format!("study robustness --runs 1 {friction} --svg friction.svg"),
            ["--svg", "friction.csv"],
        ),
        (
            "sweep merge --folder sw --csv sw/shard-0.csv",
            ["--csv", "sw/shard-0.csv"],
        ),
        (
            "sweep merge --folder sw --csv sw/manifest.toml",
            ["--csv", "sw/manifest.toml"],
        ),
        (
            "timing hard.toml --host native --svg s.svg",
            ["--svg", "hard.toml"],
        ),
        (
            "commission s.toml --rehearse --output s.toml",
            ["--output", "s.toml"],
        ),
        (
            "drive s.toml --port /dev/null --record s.toml",
            ["--record", "s.toml"],
        ),
        ("export r.mcap --ros2 link", ["--ros2", "r.mcap"]),
        ("compare r.mcap r.mcap --html link", ["--html", "r.mcap"]),
        (&format!("{TUNE} --out s.toml"), ["--out", "s.toml"]),
        (&format!("{TUNE} --table s.toml"), ["--table", "s.toml"]),
        (
            &format!("{TUNE} --out same --table same"),
            ["--out", "--table"],
        ),
    ] {
        let output = run(&bench, line);
        let message = errors(&output);
        assert_eq!(code(output.status), 2, "{line}: {message}");
        assert_eq!(message.trim().lines().count(), 1, "{line}: {message}");
        for part in parts {
            assert!(
                message.contains(part),
                "{line}: '{part}' is not in: {message}"
            );
        }
        assert!(contents(&bench) == before, "{line}: {:?}", bench.files());
    }
    for line in [
        "run - --no-plot --record s.toml",
        "drive edge --port /dev/null --record s.toml",
    ] {
        let output = bench.shell(&format!("$P {line} <hard.toml"));
        assert_eq!(code(output.status), 2, "{output:?}");
        assert!(errors(&output).contains("`standard input`"), "{output:?}");
    }
    assert!(contents(&bench) == before);
    // With shards missing, a job script would replace one that is there.
    fs::remove_file(bench.path("sw/shard-1.csv")).unwrap_or_default();
    let output = run(
        &bench,
        "sweep submit slurm --folder sw --out sw/shard-0.csv",
    );
    assert_eq!(code(output.status), 2, "{output:?}");
    // The same commands with other outputs.
    for line in [
        "export r.mcap --csv new.csv",
        "run s.toml --set run.duration_s=0.05 --no-plot --record new.mcap",
        &format!("{STUDY} --scenario s.toml --csv new2.csv"),
    ] {
        let output = run(&bench, line);
        assert!(output.status.success(), "{line}: {output:?}");
    }
}

#[test]
fn options_without_effect_are_refused() {
    let bench = Bench::new("no-effect");
    for (line, option) in [
        ("run edge --timing tim.json", "--timing"),
        ("run edge --elf x", "--elf"),
        ("run edge --host drivers --elf x", "--elf"),
        ("run edge --port /dev/ttyUSB0", "--port"),
        ("run edge --bit-errors 0.01", "--bit-errors"),
        ("run edge --log", "--log"),
        ("run edge --live 0 --elf x", "--elf"),
        ("run edge --live 0 --json", "--json"),
        ("run edge --live 0 --verbose", "--verbose"),
        ("run edge --live 0 --csv x.csv", "--csv"),
        ("run edge --live 0 --record x.mcap", "--record"),
        ("run edge --live 0 --no-record", "--no-record"),
        ("run edge --live 0 --no-plot", "--no-plot"),
        ("run edge --live 0 --no-html", "--no-html"),
        ("run edge --live 0 --pacing realtime", "--pacing"),
        ("run edge --live 0 --silence-limit-s 3", "--silence-limit-s"),
        (
            "run edge --arms general",
            "--arms has no effect without --replay",
        ),
        ("run --scenario edge --arms general", "--arms"),
        ("plant edge --bus b --arms general", "--arms"),
        (
            "run edge --no-token",
            "--no-token has no effect without --live",
        ),
        ("run edge --no-token --csv x.csv", "--no-token"),
        ("run edge --no-token --json", "--no-token"),
        ("run edge --no-token --quiet", "--no-token"),
        (
            "run edge --live-origin http://a --record x.mcap",
            "--live-origin",
        ),
        (
            "run edge --fail-on missed-deadline",
            "--fail-on missed-deadline has no effect without --pacing realtime",
        ),
        (
            "run edge --fail-on missed-deadline --pacing realtime --host serial --port x",
            "--fail-on missed-deadline",
        ),
        (
            "commission edge --port x --mistake belt-too-high",
            "--mistake",
        ),
        (
            "commission edge --port x --seed 4",
            "--seed has no effect without --rehearse",
        ),
        (
            "commission edge --rehearse --second-sensors --set converters.mounting.sensors=first",
            "converters.mounting.sensors = first",
        ),
        ("identify edge --port x --mistake bent-link", "--mistake"),
        ("identify --slide elbow-up=r.mcap --seed 3", "--seed"),
        // No board reads its sensors at 10 kHz.
        ("identify paper-gains --rehearse", "run.tick_hz = 10000"),
        (
            "scenarios --schema --diff",
            "--diff has no effect without SCENARIO",
        ),
        ("scenarios --schema --set belt.friction=0.4", "--set"),
        (
            "scenarios --keys frictoin",
            "--keys frictoin: no key contains",
        ),
        ("timing edge --host native --elf x", "--elf"),
        ("drive edge --port x --stored --record x", "--record"),
    ] {
        let output = run(&bench, line);
        assert_eq!(code(output.status), 2, "{line}: {output:?}");
        assert!(errors(&output).contains(option), "{line}: {output:?}");
        assert_eq!(bench.files(), [""; 0], "{line}");
    }
}

/// Whoever may write into a shared folder may not choose which file of another user an output replaces.
#[test]
#[allow(clippy::unwrap_used)]
fn links_of_another_user_are_not_followed() {
    const STRANGER: u32 = 23_002;
    if !geteuid().is_root() {
        return skipped("only root can make a link of another user");
    }
    let bench = furnished("stranger");
    let (home, shared) = (bench.path("home"), bench.path("shared"));
    fs::create_dir(&home).unwrap();
    fs::create_dir(&shared).unwrap();
    fs::set_permissions(&shared, fs::Permissions::from_mode(0o1777)).unwrap();
    fs::write(home.join("mine"), "mine").unwrap();
    let link = |name: &str, target: &str| {
        symlink(home.join(target), shared.join(name)).unwrap();
        lchown(shared.join(name), Some(STRANGER), Some(STRANGER)).unwrap();
    };
    link("file", "mine");
    link("folder", ".");
    link("new", "not-there");
    let mut lines = vec![
        "man shared/folder".to_owned(),
        "figures --draft --out shared/folder".to_owned(),
        "sweep plan campaign.toml --shards 2 --folder shared/folder".to_owned(),
    ];
    for path in [
        "shared/file",
        "shared/folder/mine",
        "shared/new",
        "shared/folder/new",
    ] {
        lines.extend([
            format!("run edge --set run.duration_s=0.05 --no-plot --record {path}"),
            format!("run edge --set run.duration_s=0.05 --no-plot --no-record --csv {path}"),
            format!("export r.mcap --csv {path}"),
            format!("{STUDY} --csv {path}"),
            format!("sweep merge --folder sw --csv {path}"),
            format!("commission edge --rehearse --output {path}"),
        ]);
    }
    for line in lines {
        let output = run(&bench, &line);
        assert_eq!(code(output.status), 4, "{line}: {output:?}");
        assert!(
            errors(&output).contains("link of another user"),
            "{line}: {output:?}"
        );
    }
    assert_eq!(fs::read(home.join("mine")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(&home).unwrap().count(), 1);
}

#[test]
#[allow(clippy::unwrap_used)]
fn links_that_lead_nowhere_are_named() {
    let bench = Bench::new("dangling");
    symlink("nowhere", bench.path("lost")).unwrap();
    for path in ["lost", "lost/run.mcap"] {
        let output = run(&bench, &format!("run edge --no-plot --record {path}"));
        assert_eq!(code(output.status), 4, "{output:?}");
        let message = errors(&output);
        assert!(
            message.contains("`lost` is a symbolic link that leads to no file"),
            "{message}"
        );
    }
    assert_eq!(bench.files(), ["lost"]);
}

#[test]
#[allow(clippy::unwrap_used)]
fn damaged_records_are_refused_and_what_is_whole_is_recovered() {
    let bench = Bench::new("damaged");
    let record = "run edge --set run.duration_s=1.5 --no-plot --record r.mcap --csv true.csv";
    assert!(run(&bench, record).status.success());
    let (bytes, table) = (
        fs::read(bench.path("r.mcap")).unwrap(),
        fs::read(bench.path("true.csv")).unwrap(),
    );
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    for (name, bytes) in [
        ("cut", &bytes[..bytes.len() * 2 / 3]),
        ("flipped", &flipped),
    ] {
        fs::write(bench.path(name), bytes).unwrap();
        let output = bench.run(&["export", name, "--csv", "x.csv"]);
        assert_eq!(code(output.status), 2, "{output:?}");
        assert!(
            errors(&output).contains("painleve export --csv --recover exports the "),
            "{output:?}"
        );
        assert!(!bench.path("x.csv").exists());
        let report = bench.report(&["export", name, "--recover", "--csv", "x.csv", "--json"]);
        let recovered = fs::read(bench.path("x.csv")).unwrap();
        fs::remove_file(bench.path("x.csv")).unwrap();
        assert!(table.starts_with(&recovered) && recovered.len() > table.len() / 4);
        assert!(recovered.len() < table.len());
        let rows = recovered.iter().filter(|&&byte| byte == b'\n').count() - 1;
        assert_eq!(report["rows"], rows);
        let damage = &report["damage"];
        assert_eq!(damage["bytes"], bytes.len());
        assert!(
            damage["whole_bytes"].as_u64() < damage["bytes"].as_u64(),
            "{damage}"
        );
    }
    // Of a whole record everything is exported.
    let report = bench.report(&["export", "r.mcap", "--recover", "--csv", "x.csv", "--json"]);
    assert_eq!(report["damage"], Value::Null);
    assert_eq!(fs::read(bench.path("x.csv")).unwrap(), table);
}

#[test]
#[allow(clippy::unwrap_used)]
fn pipes_and_devices_are_refused_at_once() {
    let bench = furnished("pipes");
    mkfifo(&bench.path("pipe"), Mode::S_IRWXU).unwrap();
    mkfifo(&bench.path("sw/shard-9.csv"), Mode::S_IRWXU).unwrap();
    let damaged = [&b"\x89MCAP0\r\n\x01"[..], &[0xff; 8]].concat();
    fs::write(bench.path("long.mcap"), damaged).unwrap();
    fs::write(bench.path("empty.mcap"), "").unwrap();
    let before = bench.files();
    for (line, exit, part) in [
        ("export pipe --csv x.csv", 2, "not a regular file"),
        ("export /dev/zero --csv x.csv", 2, "not a regular file"),
        ("export sw --csv x.csv", 2, "not a regular file"),
        ("export empty.mcap --csv x.csv", 2, "it is empty"),
        (
            "export long.mcap --csv x.csv",
            2,
            "not a complete MCAP file",
        ),
        (
            "sweep merge --folder sw",
            1,
            "shard-9.csv cannot be read: it is not a regular file",
        ),
    ] {
        let words: Vec<_> = line.split_whitespace().collect();
        let (output, _) = bench.start(&words).end(SOON);
        assert_eq!(code(output.status), exit, "{line}: {output:?}");
        assert!(errors(&output).contains(part), "{line}: {output:?}");
        assert_eq!(bench.files(), before, "{line}");
    }
    let status = bench.report(&["sweep", "status", "--folder", "sw", "--json"]);
    assert_eq!(status["unusable"][0]["file"], "sw/shard-9.csv");
    let output = bench.shell("timeout 10 $P run - </dev/zero");
    assert_eq!(code(output.status), 2, "{output:?}");
    assert!(errors(&output).contains("holds more than"), "{output:?}");
}

#[test]
#[allow(clippy::unwrap_used)]
fn names_that_are_not_text_are_used_as_they_are() {
    let bench = furnished("bytes");
    let name = |bytes: &[u8]| OsStr::from_bytes(bytes).to_owned();
    let run = |line: &str, more: &[&[u8]]| {
        let mut command = bench.command(&line.split_whitespace().collect::<Vec<_>>());
        let output = command.args(more.iter().map(|bytes| name(bytes))).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{line}: {output:?}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let text = "a\u{fffd}.mcap";
    let report = run(
        &format!("run edge {} --no-plot --json --record", SHORT.join(" ")),
        &[b"a\xff.mcap"],
    );
    assert_eq!(report["files"], json!([text]));
    let line = format!("run edge {} --no-record --json", SHORT.join(" "));
    let figure: &[&[u8]] = &[b"--plot", b"p\xff.svg", b"--html", b"p\xff.html"];
    let files = json!(["p\u{fffd}.svg", "p\u{fffd}.html"]);
    assert_eq!(run(&line, figure)["files"], files);
    run("study admissible --json --svg", &[b"s\xff.svg"]);
    assert!(bench.path("").join(name(b"s\xff.svg")).exists());
    let report = run("export --csv --json", &[b"--", b"a\xff.mcap"]);
    assert_eq!(report["record"], text);
    assert_eq!(report["files"], json!(["a\u{fffd}.csv"]));
    assert!(bench.path("").join(name(b"a\xff.csv")).exists());
    let first = "f\u{fffd}/painleve.1";
    assert_eq!(run("man --json", &[b"f\xff"])["first"], first);
    let folder: &[&[u8]] = &[b"--folder", b"s\xff"];
    let planned = run("sweep plan campaign.toml --shards 2 --json", folder);
    assert_eq!(planned["manifest"], "s\u{fffd}/manifest.toml");
    let finished = run("sweep run --all --json", folder);
    assert_eq!(finished["finished"][0]["file"], "s\u{fffd}/shard-0.csv");
    assert_eq!(
        run("sweep merge --json", folder)["files"][0],
        "s\u{fffd}/merged.csv"
    );
    let sweep = bench.path("").join(name(b"s\xff"));
    fs::copy(
        sweep.join("shard-0.csv"),
        sweep.join(name(b"shard-\xfe.csv")),
    )
    .unwrap();
    fs::write(sweep.join(name(b"shard-\xff.csv")), "").unwrap();
    let status = run("sweep status --json", folder);
    assert_eq!(
        status["unusable"][0]["file"],
        "s\u{fffd}/shard-\u{fffd}.csv"
    );
    assert_eq!(
        status["duplicates"][0]["files"][1],
        "s\u{fffd}/shard-\u{fffd}.csv"
    );
    let commissioned = run(
        "commission edge --rehearse --json --output",
        &[b"c\xff.toml"],
    );
    assert_eq!(commissioned["output"], "c\u{fffd}.toml");
    let refused = bench.command(&["run"]).arg(name(b"c\xff.toml")).output();
    let refused = refused.unwrap();
    assert_eq!(code(refused.status), 2, "{refused:?}");
    let message = errors(&refused);
    assert!(
        message.starts_with("error: \"c\\xFF.toml\": not UTF-8"),
        "{message}"
    );
}

#[test]
fn a_file_size_limit_costs_a_run_the_files_that_are_larger() {
    let bench = Bench::new("limits");
    // Page and figure of this run are smaller than its table.
    let whole = run(
        &bench,
        "run edge --set run.duration_s=0.6 --csv out/run.csv",
    );
    assert!(whole.status.success(), "{whole:?}");
    let size = |name: &str| fs::metadata(bench.path(name)).map_or(0, |file| file.len());
    let largest = "out/run.csv";
    for smaller in ["out/run.html", "out/run.svg", "out/run.mcap"] {
        assert!(
            size(smaller) < size(largest),
            "{smaller}: {}",
            size(smaller)
        );
    }
    let kib = size(largest) / 1024;
    fs::remove_dir_all(bench.path("out")).unwrap_or_default();
    for (kib, complete) in [
        (kib, &["out/run.html", "out/run.mcap", "out/run.svg"][..]),
        (kib / 5, &["out/run.svg"]),
        // Not even the head of the record, so that nothing runs.
        (1, &[]),
    ] {
        let line =
            format!("ulimit -f {kib}; $P run edge --set run.duration_s=0.6 --csv out/run.csv");
        let output = bench.shell(&line);
        assert_eq!(code(output.status), 4, "{kib}: {output:?}");
        let message = errors(&output);
        let lost = if kib == 1 { 1 } else { 4 - complete.len() };
        assert_eq!(message.trim().lines().count(), lost, "{kib}: {message}");
        let of_files = message.matches("cannot write `out/run.").count();
        assert_eq!(of_files, lost, "{kib}: {message}");
        // The report comes all the same.
        let report = String::from_utf8_lossy(&output.stdout);
        assert_eq!(report.contains("log hash"), kib > 1, "{kib}: {report}");
        let files = bench.files();
        let whole = files.iter().filter(|name| !name.contains("partial"));
        assert!(whole.eq(complete), "{kib} KiB: {files:?}");
        fs::remove_dir_all(bench.path("out")).unwrap_or_default();
    }
    // Also if a file fails long before the end.
    let long = bench
        .shell("ulimit -f 2048; $P run edge --set run.duration_s=12 --no-record --csv out/run.csv");
    assert_eq!(code(long.status), 4, "{long:?}");
    assert!(
        errors(&long).contains("cannot write `out/run.csv`"),
        "{long:?}"
    );
    let report = String::from_utf8_lossy(&long.stdout);
    assert!(
        report.contains("log hash") && report.contains("12.00 s"),
        "{report}"
    );
    assert_eq!(bench.files(), ["out/run.html", "out/run.svg"]);
    fs::remove_dir_all(bench.path("out")).unwrap_or_default();
    // Files of other commands appear together.
    for line in [
        "man manual".to_owned(),
        format!("{STUDY} --csv s.csv --svg s.svg"),
    ] {
        let output = bench.shell(&format!("ulimit -f 1; $P {line}"));
        assert_eq!(code(output.status), 4, "{line}: {output:?}");
        assert_eq!(bench.files(), [""; 0], "{line}");
    }
}

#[test]
fn a_run_that_fails_leaves_no_new_folder() {
    let bench = Bench::new("new-folder");
    let line = "run edge --host serial --port nowhere --timing new/costs.json";
    let output = run(&bench, line);
    assert_eq!(code(output.status), 3, "{output:?}");
    assert!(!bench.path("new").exists());
}

#[test]
fn help_that_cannot_be_written_is_an_error() {
    let bench = Bench::new("help");
    for line in ["--help", "--version", "run --help", "study bifurcation -h"] {
        let full = bench.shell(&format!("$P {line} >/dev/full"));
        assert_eq!(code(full.status), 4, "{line}: {full:?}");
        assert!(errors(&full).contains("stdout"), "{line}: {full:?}");
        let unread = bench.shell(&format!("$P {line} | true; exit ${{PIPESTATUS[0]}}"));
        assert_eq!(code(unread.status), 0, "{line}: {unread:?}");
        assert_eq!(code(run(&bench, line).status), 0, "{line}");
    }
    assert_eq!(code(run(&bench, "run --no-such-option").status), 2);
}
