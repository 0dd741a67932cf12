//! The page of a run, and the labels of pictures, in headless Chromium, if the machine has Node and Chromium.

#![allow(
    clippy::unwrap_used,
    reason = "a run that does not start fails its test"
)]

use std::path::Path;
use std::process::Command;

use painleve_tests::live::LiveRun;
use painleve_tests::{Bench, skipped};

/// Returns the name of the first program that starts; prints a notice if there is none.
fn program(names: &[&'static str]) -> Option<&'static str> {
    let starts = |name: &&&str| {
        let version = Command::new(name).arg("--version").output();
        version.is_ok_and(|output| output.status.success())
    };
    let found = names.iter().find(starts).copied();
    if found.is_none() {
        skipped(&format!(
            "{names:?} not found; on Debian: apt-get install nodejs chromium"
        ));
    }
    found
}

/// The programs that run the scripts of `browser/`.
struct Browser {
    node: &'static str,
    chromium: &'static str,
}

impl Browser {
    /// Returns what the machine has; prints a notice if something is missing.
    fn find() -> Option<Self> {
        Some(Self {
            node: program(&["node"])?,
            chromium: program(&["chromium", "chromium-browser", "google-chrome"])?,
        })
    }

    /// Runs a script and shows what it printed if it fails.
    fn run(&self, name: &str, arguments: &[&str]) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("browser")
            .join(name);
        let output = Command::new(self.node)
            .arg(script)
            .arg(self.chromium)
            .args(arguments)
            .output()
            .unwrap_or_else(|error| panic!("cannot start {}: {error}", self.node));
        let [stdout, stderr] =
            [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        assert!(output.status.success(), "{stdout}\n{stderr}");
        println!("{stdout}");
    }
}

#[test]
#[ignore = "needs a browser"]
fn the_page_of_a_run_plays_zooms_and_has_no_error() {
    let Some(browser) = Browser::find() else {
        return;
    };
    let bench = Bench::new("page");
    for scenario in ["edge", "open-loop-bounce"] {
        let file = format!("{scenario}.html");
        let path = bench.path(&file);
        bench.report(&["run", scenario, "--json", "--no-record", "--html", &file]);
        browser.run("page.mjs", &[path.to_str().unwrap()]);
    }
}

#[test]
#[ignore = "needs a browser"]
fn a_live_run_is_watched_paused_stepped_set_pushed_and_reset() {
    watch_live(&Bench::new("live"), &[], "live.mjs");
}

/// Operates the page of a live run.
fn watch_live(bench: &Bench, arguments: &[&str], script: &str) {
    if let Some(browser) = Browser::find() {
        let run = LiveRun::start(bench, arguments);
        browser.run(script, &[&run.page]);
    }
}

#[test]
#[ignore = "needs a browser"]
fn a_higher_friction_throws_the_tip_off_while_the_run_is_watched() {
    let bench = Bench::new("live-friction");
    let set = ["open-loop-bounce", "--set", "belt.friction=0.3"];
    watch_live(&bench, &set, "friction.mjs");
}

#[test]
#[ignore = "needs a browser"]
fn a_page_without_pictures_or_connection_and_one_too_many_lose_nothing_that_matters() {
    let bench = Bench::new("live-adversity");
    watch_live(&bench, &["open-loop-bounce"], "adversity.mjs");
}

#[test]
#[ignore = "needs a browser"]
fn the_page_of_a_long_run_is_small() {
    let bench = Bench::new("long-page");
    let options = ["run", "--set", "run.duration_s=60", "--json", "--no-record"];
    bench.report(&options);
    let bytes = std::fs::metadata(bench.path("out/run.html")).unwrap().len();
    assert!(bytes < 2_000_000, "{bytes}");
}

#[test]
#[ignore = "needs a browser"]
fn no_label_of_a_picture_overlaps_another_or_is_cut_off_or_too_small() {
    let Some(browser) = Browser::find() else {
        return;
    };
    let bench = Bench::new("pictures");
    let images = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/images");
    let entries = std::fs::read_dir(images).unwrap();
    let mut pictures: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    pictures.retain(|path| path.extension().is_some_and(|extension| extension == "svg"));
    // Those of the book do not show every panel, nor a study of one cell.
    for scenario in ["pid-elbow-up", "open-loop-bounce"] {
        bench.report(&["run", scenario, "--json", "--no-record"]);
        let path = bench.path(&format!("{scenario}.svg"));
        std::fs::rename(bench.path("out/run.svg"), &path).unwrap();
        pictures.push(path);
    }
    for study in [
        &["regions", "--mu", "0.6"][..],
        &["bifurcation", "--mu", "0.6", "--v-belt=-0.4"],
        &[
            "poincare",
            "--v-belt=-0.4",
            "--transient-s",
            "10",
            "--record-s",
            "10",
        ],
        &["closed-loop-bifurcation", "--v-belt=-0.4"],
    ] {
        let file = format!("{}.svg", study[0]);
        let command = [&["study"], study, &["--json", "--svg", &file]].concat();
        bench.report(&command);
        pictures.push(bench.path(&file));
    }
    let pictures: Vec<_> = pictures.iter().map(|path| path.to_str().unwrap()).collect();
    browser.run("pictures.mjs", &pictures);
}
