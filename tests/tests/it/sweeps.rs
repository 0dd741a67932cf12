//! `painleve sweep …` with real processes: shards, kills, broken files, mistakes.

use std::path::PathBuf;
use std::process::Output;
use std::time::Duration;

use nix::sys::signal::Signal;
use painleve_tests::{Bench, code, errors, signal};
use serde_json::Value;

/// 24 rows, most of which bounce.
const CAMPAIGN: &str = "study = 'bifurcation'\nmu = [0.4, 0.6]\nv-belt = '-0.5:-0.3:0.04'\n\
    initial = ['a', 'random:1']\nseed = 7\ntransient-s = 2\nrecord-s = 1\n";

fn planned(name: &str, campaign: &str, shards: &str) -> Bench {
    let bench = Bench::new(name);
    write(&bench, "campaign.toml", campaign);
    let output = bench.run(&["sweep", "plan", "campaign.toml", "--shards", shards]);
    assert!(output.status.success(), "{output:?}");
    bench
}

fn write(bench: &Bench, name: &str, text: &str) -> PathBuf {
    let path = bench.path(name);
    std::fs::write(&path, text).unwrap_or_else(|error| panic!("{error}"));
    path
}

fn read(bench: &Bench, name: &str) -> Vec<u8> {
    let path = bench.path(name);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn text(output: &Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

fn merged(bench: &Bench) -> Vec<u8> {
    text(&bench.run(&["sweep", "merge"]));
    read(bench, "out/sweep/merged.csv")
}

#[test]
fn any_number_of_shards_and_threads_merges_to_the_output_of_the_study() {
    let alone = Bench::new("sweep-alone");
    let study = "study bifurcation --mu 0.4,0.6 --v-belt=-0.5:-0.3:0.04 --initial a,random:1 \
        --seed 7 --transient-s 2 --record-s 1 --csv alone.csv";
    text(&alone.run(&study.split_whitespace().collect::<Vec<_>>()));
    let expected = read(&alone, "alone.csv");
    assert_eq!(expected.iter().filter(|&&byte| byte == b'\n').count(), 25);
    for (shards, threads) in [("1", "2"), ("2", "1"), ("5", "2")] {
        let bench = planned("sweep-shards", CAMPAIGN, shards);
        let count: usize = shards.parse().unwrap_or(0);
        for shard in (0..count).rev() {
            let shard = format!("{shard}/{shards}");
            text(&bench.run(&["sweep", "run", "--shard", &shard, "--threads", threads]));
        }
        assert_eq!(merged(&bench), expected, "{shards} shards");
    }
}

#[test]
#[ignore = "a campaign"]
fn campaigns_of_random_runs_are_merged_too() {
    for (study, options) in [
        (
            "robustness",
            &[
                ("runs", "7"),
                ("seed", "3"),
                ("without", "governor,disturbance"),
            ][..],
        ),
        ("capture", &[("runs", "5"), ("set", "run.tick_hz=500")]),
        ("lift-off", &[("runs", "4"), ("slide-s", "0.3")]),
        (
            "effects",
            &[("runs", "1"), ("effect", "joint-damping,force-resolution")],
        ),
    ] {
        let alone = Bench::new("sweep-random");
        let mut line = vec!["study".into(), study.into(), "--csv".into(), "a.csv".into()];
        let mut campaign = format!("study = '{study}'\n");
        for (option, value) in options {
            line.extend([format!("--{option}"), (*value).to_owned()]);
            campaign += &format!("{option} = '{value}'\n");
        }
        text(&alone.run(&line.iter().map(String::as_str).collect::<Vec<_>>()));
        let expected = read(&alone, "a.csv");
        assert!(expected.iter().filter(|&&byte| byte == b'\n').count() > 5);
        for shards in ["1", "3"] {
            let bench = planned("sweep-random-shards", &campaign, shards);
            text(&bench.run(&["sweep", "run", "--all"]));
            assert_eq!(merged(&bench), expected, "{study} in {shards} shards");
        }
    }
}

#[test]
fn rows_of_several_lines_are_merged_too() {
    let campaign = "study = 'poincare'\nv-belt = '-0.5:-0.3:0.05'\ntransient-s = 5\nrecord-s = 2";
    let bench = planned("sweep-lines", campaign, "3");
    text(&bench.run(&["sweep", "run", "--all"]));
    let study = "study poincare --v-belt=-0.5:-0.3:0.05 --transient-s 5 --record-s 2 --csv a.csv";
    text(&bench.run(&study.split_whitespace().collect::<Vec<_>>()));
    let expected = read(&bench, "a.csv");
    assert!(expected.iter().filter(|&&byte| byte == b'\n').count() > 20);
    assert_eq!(merged(&bench), expected);
}

#[test]
fn a_sweep_killed_at_any_moment_completes_with_the_same_bytes() {
    let campaign = CAMPAIGN.replace("transient-s = 2", "transient-s = 100");
    let whole = planned("sweep-whole", &campaign, "4");
    text(&whole.run(&["sweep", "run", "--all"]));
    let expected = merged(&whole);
    let bench = planned("sweep-killed", &campaign, "4");
    let mut kills = 0;
    for after_ms in [1, 4, 10, 20, 30, 50, 80, 120] {
        let running = bench.start(&["sweep", "run", "--all", "--threads", "1"]);
        std::thread::sleep(Duration::from_millis(after_ms));
        signal(running.id(), Signal::SIGKILL);
        let (output, _) = running.end(Duration::from_secs(10));
        kills += usize::from(code(output.status) == -1);
        // Every file with its final name is complete.
        let status = bench.report(&["sweep", "status", "--json"]);
        assert_eq!(status["unusable"], Value::Array(Vec::new()), "{status}");
    }
    assert!(kills > 0, "nothing was killed");
    text(&bench.run(&["sweep", "run", "--all"]));
    assert_eq!(merged(&bench), expected);
    let files = bench.files();
    assert!(
        !files.iter().any(|file| file.ends_with(".part")),
        "{files:?}"
    );
}

#[test]
fn finished_shards_are_skipped_and_broken_ones_computed_again() {
    let bench = planned("sweep-broken", CAMPAIGN, "5");
    let run = |shard: &str| bench.run(&["sweep", "run", "--shard", shard]);
    for shard in ["0/5", "1/5", "2/5", "4/5"] {
        text(&run(shard));
    }
    let missing = || text(&bench.run(&["sweep", "missing"]));
    assert_eq!(missing(), "3");
    assert!(text(&run("2")).contains("already finished"));
    let whole = read(&bench, "out/sweep/shard-2.csv");
    for broken in [
        &whole[..whole.len() / 2],
        b"",
        &[&whole[..40], b"9", &whole[41..]].concat(),
    ] {
        std::fs::write(bench.path("out/sweep/shard-2.csv"), broken).unwrap_or_default();
        assert_eq!(missing(), "2-3");
        let status = bench.report(&["sweep", "status", "--json"]);
        assert_eq!(
            status["unusable"].as_array().map(Vec::len),
            Some(1),
            "{status}"
        );
        let output = run("2/5");
        assert!(errors(&output).contains("computed again"), "{output:?}");
        assert_eq!(read(&bench, "out/sweep/shard-2.csv"), whole);
    }
    // A missing shard, then a duplicate one.
    let refused = |part: &str| {
        let output = bench.run(&["sweep", "merge"]);
        assert_eq!(code(output.status), 1, "{output:?}");
        assert!(errors(&output).contains(part), "{output:?}");
        assert!(!bench.path("out/sweep/merged.csv").exists());
    };
    refused("missing of 5 shards: 3");
    text(&run("3/5"));
    assert_eq!(missing(), "");
    write(
        &bench,
        "out/sweep/shard-2 (copy).csv",
        &String::from_utf8_lossy(&whole),
    );
    refused("shard 2 is present twice");
    std::fs::remove_file(bench.path("out/sweep/shard-2 (copy).csv")).unwrap_or_default();
    assert!(!merged(&bench).is_empty());
}

#[test]
fn schedulers_select_the_shard() {
    let bench = planned("sweep-scheduler", CAMPAIGN, "4");
    let run = |variables: &[(&str, &str)]| {
        let mut command = bench.command(&["sweep", "run"]);
        for name in [
            "SLURM_ARRAY_TASK_ID",
            "HQ_TASK_ID",
            "JOB_COMPLETION_INDEX",
            "OMPI_COMM_WORLD_RANK",
        ] {
            command.env_remove(name);
        }
        let output = command.envs(variables.iter().copied()).output();
        output.unwrap_or_else(|error| panic!("{error}"))
    };
    let rank = ("OMPI_COMM_WORLD_RANK", "3");
    assert!(text(&run(&[rank, ("HQ_TASK_ID", "1")])).starts_with("shard 1/4"));
    assert!(text(&run(&[rank, ("SLURM_ARRAY_TASK_ID", "0")])).starts_with("shard 0/4"));
    assert!(text(&run(&[rank, ("JOB_COMPLETION_INDEX", "2")])).starts_with("shard 2/4"));
    for (variables, part) in [
        (&[][..], "--shard K/N"),
        (&[("HQ_TASK_ID", "4")][..], "0 to 3"),
        (&[("HQ_TASK_ID", "x")][..], "HQ_TASK_ID=x"),
    ] {
        let output = run(variables);
        assert_eq!(code(output.status), 2, "{output:?}");
        assert!(errors(&output).contains(part), "{output:?}");
    }
    assert_eq!(text(&bench.run(&["sweep", "missing"])), "3");
    text(&bench.run(&[
        "sweep",
        "submit",
        "slurm",
        "--cpus",
        "2",
        "--option=--time=30",
    ]));
    let script = String::from_utf8_lossy(&read(&bench, "out/sweep/sweep.sbatch")).into_owned();
    for line in [
        "#SBATCH --array=3",
        "#SBATCH --requeue",
        "#SBATCH --time=30",
    ] {
        assert!(script.lines().any(|one| one == line), "{script}");
    }
    // Runs the script as Slurm would.
    let mut task = std::process::Command::new("sh");
    task.arg(bench.path("out/sweep/sweep.sbatch"));
    let output = task.env("SLURM_ARRAY_TASK_ID", "3").output();
    assert!(text(&output.unwrap_or_else(|error| panic!("{error}"))).starts_with("shard 3/4"));
}

#[test]
fn mistakes_are_reported_and_nothing_is_written() {
    let bench = Bench::new("sweep-mistakes");
    let refused = |arguments: &[&str], part: &str| {
        let before = bench.files();
        let output = bench.run(&[&["sweep"], arguments].concat());
        let message = errors(&output);
        assert_eq!(code(output.status), 2, "{arguments:?}: {message}");
        assert!(message.contains(part), "'{part}' is not in: {message}");
        assert_eq!(bench.files(), before);
    };
    let plan = ["plan", "campaign.toml", "--shards", "3"];
    refused(&plan, "campaign.toml");
    for step in [
        &["run", "--shard", "0/3"][..],
        &["status"],
        &["missing"],
        &["merge"],
    ] {
        refused(step, "plan the sweep first");
    }
    for (campaign, part) in [
        ("", "it is empty"),
        ("\n", "no study"),
        ("study = 'bifurcation'\nmoo = 1", "'moo'"),
        ("study = 'regions'", "cannot be computed in shards"),
        ("study = 'bifurcation'\nmu = '1:0:0.1'", "leads away"),
        ("study = 'bifurcation'\nmu = '0.4:0.6:-0.1'", "leads away"),
        ("study = 'sliding-range'\nposture = 'up'", "'up'"),
        ("study = ", "line 1"),
    ] {
        write(&bench, "campaign.toml", campaign);
        refused(&plan, part);
    }
    write(&bench, "campaign.toml", CAMPAIGN);
    refused(&["plan", "campaign.toml", "--shards", "25"], "1 to 24");
    refused(&["plan", "campaign.toml", "--shards", "0"], "--shards");
    text(&bench.run(&[&["sweep"], &plan[..]].concat()));
    let manifest = String::from_utf8_lossy(&read(&bench, "out/sweep/manifest.toml")).into_owned();
    for key in ["campaign_hash", "version", "git_revision", "[seeds]"] {
        assert!(manifest.contains(key), "{manifest}");
    }
    for (shard, part) in [
        ("3/3", "0 to 2"),
        ("0/4", "3 shards"),
        ("-1/3", "K/N"),
        ("x", "K/N"),
    ] {
        refused(&["run", "--shard", shard], part);
    }
    refused(
        &["plan", "campaign.toml", "--shards", "4"],
        "another sweep is planned here; choose another --folder, or delete the folder out/sweep",
    );
    for (from, to, part) in [
        ("format = 1", "format = 2", "another version"),
        ("version = \"", "version = \"9", "another version"),
        ("git_revision = \"", "git_revision = \"f", "another version"),
        (
            "campaign_hash = \"",
            "campaign_hash = \"0",
            "has been changed",
        ),
        ("\"0.6\"", "\"0.7\"", "has been changed"),
    ] {
        assert!(manifest.contains(from), "{manifest}");
        write(
            &bench,
            "out/sweep/manifest.toml",
            &manifest.replace(from, to),
        );
        refused(&["run", "--shard", "0/3"], part);
    }
    write(&bench, "out/sweep/manifest.toml", &manifest);
    text(&bench.run(&["sweep", "run", "--shard", "0/3"]));
}

/// Whichever of the campaign's options leads to it.
#[test]
fn a_table_changed_since_planning_is_detected() {
    let effect = "friction = {kind = 'file', path = 'friction.csv'}";
    let set = format!("set = [\"effects.{effect}\", 'contact.kind=compliant']\n");
    for (name, campaign) in [
        (
            "sweep-set",
            format!("study = 'robustness'\nruns = 2\n{set}"),
        ),
        (
            "sweep-table",
            "study = 'sliding-range'\ncontroller = 'mine.toml'\n".to_owned(),
        ),
    ] {
        let bench = Bench::new(name);
        let scenario = format!("[contact]\nkind = 'compliant'\n[effects]\n{effect}\n");
        write(&bench, "mine.toml", &scenario);
        write(&bench, "friction.csv", "time_s,change\n0,0.1\n1,0.2\n");
        write(&bench, "campaign.toml", &campaign);
        text(&bench.run(&["sweep", "plan", "campaign.toml", "--shards", "2"]));
        text(&bench.run(&["sweep", "run", "--shard", "0/2"]));
        write(&bench, "friction.csv", "time_s,change\n0,0.1\n1,0.3\n");
        let output = bench.run(&["sweep", "run", "--shard", "1/2"]);
        assert_eq!(code(output.status), 2, "{output:?}");
        let message = errors(&output);
        assert!(message.contains("friction.csv"), "{message}");
        assert!(
            message.contains("has been changed since the sweep was planned"),
            "{message}"
        );
    }
}

#[test]
fn a_scenario_changed_since_planning_is_detected() {
    let campaign = format!("{CAMPAIGN}scenario = 'mine.toml'\n");
    let bench = Bench::new("sweep-scenario");
    write(
        &bench,
        "mine.toml",
        "[arm]\ndamping_nms_rad = [0.006, 0.006]\n",
    );
    write(&bench, "campaign.toml", &campaign);
    text(&bench.run(&["sweep", "plan", "campaign.toml", "--shards", "2"]));
    text(&bench.run(&["sweep", "run", "--shard", "0/2"]));
    write(
        &bench,
        "mine.toml",
        "[arm]\ndamping_nms_rad = [0.007, 0.007]\n",
    );
    let output = bench.run(&["sweep", "run", "--shard", "1/2"]);
    assert_eq!(code(output.status), 2, "{output:?}");
    assert!(errors(&output).contains("mine.toml"), "{output:?}");
}
