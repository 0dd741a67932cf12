//! A live run under viewers that ask for too much, or for what is not theirs.

#![allow(clippy::unwrap_used, reason = "a run that fails fails its test")]

use std::fs;
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use painleve_tests::live::{LiveRun, UPGRADE};
use painleve_tests::{Bench, code};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// How long a test waits for anything.
const PATIENCE: Duration = Duration::from_secs(20);

/// A viewer as the page is one.
struct Viewer(WebSocket<TcpStream>);

impl Viewer {
    fn of(run: &LiveRun) -> Self {
        let stream = run.connect();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self(tungstenite::client(run.live(), stream).unwrap().0)
    }

    fn order(&mut self, order: &Value) {
        self.0.send(Message::text(order.to_string())).unwrap();
    }

    fn set(&mut self, key: &str, value: &str) {
        self.order(&json!({ "set": { "key": key, "value": value } }));
    }

    /// Returns the text of the next note or error.
    fn answer(&mut self) -> Result<String, String> {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Message::Text(text) = self.0.read().unwrap() {
                let message: Value = serde_json::from_str(&text).unwrap();
                let text = |key: &str| message[key].as_str().map(str::to_owned);
                if let Some(note) = text("note") {
                    return Ok(note);
                }
                if let Some(error) = text("error") {
                    return Err(error);
                }
            }
        }
        panic!("no answer");
    }
}

#[test]
fn ctrl_c_ends_a_live_run_plainly() {
    let run = LiveRun::start(&Bench::new("live-end"), &[]);
    let (status, _, printed) = run.interrupt();
    assert_eq!((code(status), printed.as_str()), (0, ""));
}

#[test]
fn a_flood_of_orders_is_refused_once_and_ctrl_c_is_obeyed_at_once() {
    let bench = Bench::new("live-flood");
    let run = LiveRun::start(&bench, &[]);
    let mut viewer = Viewer::of(&run);
    for round in 0..20_000 {
        let value = 0.3 + 1e-6 * f64::from(round);
        viewer.set("belt.friction", &value.to_string());
    }
    // Beyond the flood, the run goes on: its rows arrive.
    let (mut refusals, mut rows) = (0, 0);
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(500) {
        match viewer.0.read().unwrap() {
            Message::Text(text) => refusals += u32::from(text.contains("100 requests")),
            _ => rows += 1,
        }
    }
    assert!((1..=10).contains(&refusals), "{refusals}");
    assert!(rows > 10, "{rows}");
    let memory_mb = run.peak_memory_mb();
    let (status, took, _) = run.interrupt();
    assert_eq!(code(status), 0);
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert!(memory_mb < 200.0, "{memory_mb} MB");
}

/// What a client asks to be told is limited by what there is to tell.
#[test]
fn the_wishes_of_a_foxglove_client_take_little_memory() {
    let run = LiveRun::start(&Bench::new("live-wishes"), &[]);
    let mut request = run.foxglove.as_str().into_client_request().unwrap();
    let protocol = HeaderValue::from_static("foxglove.sdk.v1");
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", protocol);
    let (client, _) = tungstenite::client(request, run.connect()).unwrap();
    let mut client = Viewer(client);
    let padding = "x".repeat(15_000);
    for round in 0..20_000 {
        let name = format!("{padding}{round}");
        client.order(&json!({ "op": "subscribeParameterUpdates", "parameterNames": [name] }));
    }
    client
        .order(&json!({ "op": "getParameters", "parameterNames": ["belt.friction"], "id": "end" }));
    let start = Instant::now();
    while !client
        .0
        .read()
        .unwrap()
        .to_text()
        .is_ok_and(|text| text.contains("\"end\""))
    {
        assert!(start.elapsed() < PATIENCE, "no answer");
    }
    let memory_mb = run.peak_memory_mb();
    assert!(memory_mb < 200.0, "{memory_mb} MB");
}

/// Between two looks at the orders and at Ctrl-C lie few ticks if they take long, also after fast ones.
#[test]
fn a_run_with_slow_ticks_obeys_at_once() {
    let bench = Bench::new("live-slow");
    let slow = [
        ("controller.estimator.bandwidth_rad_s", "20"),
        ("run.tick_hz", "10"),
        ("solver.maximum_step_s", "1e-5"),
        ("solver.relative_tolerance", "1e-13"),
        ("solver.absolute_tolerance", "1e-14"),
    ];
    let run = LiveRun::start(&bench, &[]);
    let mut viewer = Viewer::of(&run);
    viewer.order(&json!({ "speed": { "factor": 0 } }));
    assert_eq!(viewer.answer().unwrap(), "");
    std::thread::sleep(Duration::from_millis(300));
    for (key, value) in slow {
        viewer.set(key, value);
        viewer.answer().unwrap();
    }
    viewer.order(&json!("reset"));
    assert_eq!(viewer.answer().unwrap(), "");
    let start = Instant::now();
    for _ in 0..10 {
        while !viewer.0.read().unwrap().is_binary() {}
    }
    let took = start.elapsed();
    assert!(took < Duration::from_secs(4), "{took:?} for 10 looks");
}

/// The last value of a setting that changes fast is the one that holds.
#[test]
fn the_last_value_of_a_setting_holds() {
    let bench = Bench::new("live-last");
    let run = LiveRun::start(&bench, &[]);
    let mut viewer = Viewer::of(&run);
    for hundredths in 0..90 {
        viewer.set("belt.friction", &format!("0.{hundredths:02}1"));
    }
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < PATIENCE, "the last value does not hold");
        if let Message::Text(text) = viewer.0.read().unwrap() {
            let message: Value = serde_json::from_str(&text).unwrap();
            assert!(message["error"].is_null(), "{message}");
            if message["status"]["settings"][0]["value"] == 0.891 {
                break;
            }
        }
    }
}

#[test]
fn nobody_sees_or_steers_a_run_without_its_token() {
    let bench = Bench::new("live-token");
    let run = LiveRun::start(&bench, &[]);
    let token = run.query().strip_prefix("?token=").unwrap();
    assert_eq!(token.len(), 32, "{token}");
    let mut wrong = token.to_owned();
    wrong.replace_range(31.., if token.ends_with('0') { "1" } else { "0" });
    let host = format!("Host: {}\r\n", run.authority());
    let socket = format!("{host}{UPGRADE}");
    let foxglove = format!("{socket}Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n");
    for (path, headers, welcome) in [
        ("/", &host, "200"),
        ("/live", &socket, "101"),
        ("/", &foxglove, "101"),
    ] {
        for (query, status) in [
            (String::new(), "403"),
            ("?token=".into(), "403"),
            (format!("?token={wrong}"), "403"),
            (format!("?token={token}0"), "403"),
            (format!("?token={token}"), welcome),
        ] {
            let answer = run.knock(&format!("{path}{query}"), headers);
            let status = format!("HTTP/1.1 {status}");
            assert!(answer.starts_with(&status), "{path}{query}: {answer}");
        }
    }
    let other = LiveRun::start(&bench, &[]);
    assert_ne!(other.query(), run.query());
    let open = LiveRun::start(&bench, &["--no-token"]);
    assert_eq!(open.query(), "");
    let answer = open.knock("/", &format!("Host: {}\r\n", open.authority()));
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
}

#[test]
fn a_viewer_cannot_name_a_file_and_no_message_quotes_one() {
    let bench = Bench::new("live-files");
    let secret = bench.path("secret");
    fs::write(&secret, "token-of-the-owner\n").unwrap();
    let belt = bench.path("belt.csv");
    fs::write(&belt, "time_s,speed_m_s\n0,-0.4\n9,-0.4\n").unwrap();
    let profile =
        |path: &std::path::Path| format!("{{ kind = 'file', path = '{}' }}", path.display());
    let set = format!("belt.profile={}", profile(&belt));
    let run = LiveRun::start(&bench, &["--set", &set]);
    let mut viewer = Viewer::of(&run);
    for (key, value) in [
        ("belt.profile", profile(&secret)),
        ("belt.profile.path", secret.display().to_string()),
        ("effects.friction", profile(&secret)),
        ("effects.friction", profile(&belt)),
        ("controller.reference", format!("'{}'", secret.display())),
        (
            "controller.reference",
            bench.path("missing").display().to_string(),
        ),
    ] {
        viewer.set(key, &value);
        let refusal = viewer.answer().unwrap_err();
        assert!(
            refusal.contains("a viewer cannot name a file"),
            "{key}: {refusal}"
        );
        assert!(!refusal.contains("owner"), "{key}: {refusal}");
    }
    // What the user has named stays, as it was read at the start.
    fs::write(&belt, "token-of-the-owner\n").unwrap();
    viewer.set("belt.friction", "0.5");
    assert_eq!(viewer.answer().unwrap(), "belt.friction: set");
    viewer.order(&json!("reset"));
    assert_eq!(viewer.answer().unwrap(), "");
    viewer.set("belt.profile", &profile(&belt));
    assert_eq!(viewer.answer().unwrap(), "belt.profile: set");
}

/// A scenario's check does not see where the tip would start; the reset that fails leaves the run as it is.
#[test]
fn a_run_outlives_settings_that_cannot_be_started() {
    let bench = Bench::new("live-unstartable");
    let run = LiveRun::start(&bench, &[]);
    let mut viewer = Viewer::of(&run);
    viewer.set("arm.height_m", "0.2");
    let note = "arm.height_m: set; takes effect at the next reset";
    assert_eq!(viewer.answer().unwrap(), note);
    viewer.order(&json!("reset"));
    let refusal = viewer.answer().unwrap_err();
    assert!(
        refusal.contains("initial.tip_m puts it on the belt"),
        "{refusal}"
    );
    viewer.set("belt.friction", "0.5");
    assert_eq!(viewer.answer().unwrap(), "belt.friction: set");
}

/// Connections that ask for nothing must not cost the run its time.
#[test]
fn a_lack_of_descriptors_costs_little_time() {
    let bench = Bench::new("live-descriptors");
    let run = LiveRun::start(&bench, &[]);
    let limited = Command::new("prlimit")
        .args(["--pid", &run.id().to_string(), "--nofile=24"])
        .status();
    assert!(limited.unwrap().success());
    let connections: Vec<TcpStream> = (0..40).map(|_| run.connect()).collect();
    let spent_s = || -> f64 {
        let threads = fs::read_dir(format!("/proc/{}/task", run.id())).unwrap();
        let spent = threads.flatten().filter_map(|thread| {
            let times = fs::read_to_string(thread.path().join("schedstat")).ok()?;
            times.split(' ').next()?.parse::<f64>().ok()
        });
        spent.sum::<f64>() * 1e-9
    };
    let before_s = spent_s();
    std::thread::sleep(Duration::from_secs(1));
    let spent_s = spent_s() - before_s;
    assert!(spent_s < 0.3, "{spent_s} s of processor time in 1 s");
    drop(connections);
    // It serves again.
    let start = Instant::now();
    let host = format!("Host: {}\r\n", run.authority());
    while !run
        .knock(&format!("/{}", run.query()), &host)
        .starts_with("HTTP/1.1 200")
    {
        assert!(start.elapsed() < PATIENCE);
    }
}
