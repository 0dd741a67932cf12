use std::time::{Duration, SystemTime};

use super::*;
use std::fs;
use std::path::Path;

use boon::{Compiler, Schemas};
use painleve_plant::Snapshot;
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::sample::Sample;
use painleve_plant::simulation::Simulation;
use serde_json::{Value, json};

use crate::csv_table::CsvTable;
use crate::export::ticks_to_csv;
use crate::messages::event_schema;
use crate::recorder::Recorder;

pub(crate) fn scenario(name: &str, overrides: &[&str]) -> Scenario {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.into()).collect();
    Scenario::load(name, &overrides).unwrap()
}

/// Records a scenario as MCAP and CSV and returns the files' contents.
pub(crate) fn record(folder: &Path, scenario: &Scenario) -> (Vec<u8>, String) {
    let (mcap, csv) = (folder.join("out/run.mcap"), folder.join("out/run.csv"));
    let sinks: Vec<Box<dyn Sink>> = vec![
        Box::new(McapLog::create(&mcap, scenario, Source::Simulation).unwrap()),
        Box::new(CsvTable::to(AtomicFile::create(&csv).unwrap()).unwrap()),
    ];
    let configuration = scenario.controller_configuration();
    let mut recorder = Recorder::start(&configuration, sinks).unwrap();
    let host = InProcess::new(&configuration).unwrap();
    let mut closed_loop = ClosedLoop::new(Simulation::new(scenario).unwrap(), host);
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut recorder).unwrap();
    }
    assert!(recorder.finish().failures.is_empty());
    (fs::read(mcap).unwrap(), fs::read_to_string(csv).unwrap())
}

/// Returns a file with these messages of one topic: their times, ns, and their JSON.
pub(crate) fn of_messages(topic: &str, messages: &[(u64, &str)]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    let channel_id = writer
        .add_channel(0, topic, "json", &BTreeMap::new())
        .unwrap();
    for &(log_time, json) in messages {
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        writer
            .write_to_known_channel(&header, json.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// Messages of a file as topic, time and JSON.
fn messages(bytes: &[u8]) -> Vec<(String, u64, Value)> {
    mcap::MessageStream::new(bytes)
        .unwrap()
        .map(|message| {
            let message = message.unwrap();
            let json = serde_json::from_slice(&message.data).unwrap();
            (message.channel.topic.clone(), message.log_time, json)
        })
        .collect()
}

fn of_topic<'a>(messages: &'a [(String, u64, Value)], topic: &str) -> Vec<&'a Value> {
    let of_topic = messages.iter().filter(|(name, _, _)| name == topic);
    of_topic.map(|(_, _, json)| json).collect()
}

#[test]
fn every_message_satisfies_its_schema_also_without_a_reference() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["open-loop-bounce", "capture", "edge"] {
        let scenario = scenario(name, &["run.duration_s=0.3", "run.enable_at_s=0.1"]);
        let (bytes, _) = record(folder.path(), &scenario);
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let mut schemas = Schemas::new();
        let mut compiler = Compiler::new();
        let mut compiled = BTreeMap::new();
        for channel in summary.channels.values() {
            let schema = channel.schema.as_ref().unwrap();
            assert_eq!(
                (schema.encoding.as_str(), channel.message_encoding.as_str()),
                ("jsonschema", "json")
            );
            let mut json: Value = serde_json::from_slice(&schema.data).unwrap();
            // The message has no fields beyond the schema.
            if schema.name.starts_with("painleve") {
                json["additionalProperties"] = json!(false);
            }
            let location = format!("{}.json", channel.topic);
            compiler.add_resource(&location, json).unwrap();
            let index = compiler.compile(&location, &mut schemas).unwrap();
            compiled.insert(channel.topic.clone(), index);
        }
        assert_eq!(compiled.len(), 7);
        for (topic, time, json) in messages(&bytes) {
            if let Err(error) = schemas.validate(&json, compiled[&topic]) {
                panic!("{name} {topic} at {time}: {error}");
            }
        }
    }
}

#[test]
fn every_tick_is_recorded_with_its_values_and_the_csv_file_has_the_same() {
    let folder = tempfile::tempdir().unwrap();
    // More than one buffer.
    let scenario = scenario("hybrid-elbow-down", &["run.duration_s=3"]);
    let (bytes, csv_text) = record(folder.path(), &scenario);
    let messages = messages(&bytes);
    for topic in TOPICS {
        let ticks = of_topic(&messages, &format!("/{}", topic.name));
        assert_eq!(ticks.len(), 3000, "{}", topic.name);
    }
    for topic in ["/tf", "/scene"] {
        assert_eq!(of_topic(&messages, topic).len(), 3 * 60, "{topic}");
    }
    let plant = of_topic(&messages, "/plant");
    let estimates = of_topic(&messages, "/estimates");
    let near = |a: &Value, b: &Value| (a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 2e-4;
    assert!(near(&plant[2999]["tip_t_m"], &estimates[2999]["tip_t_m"]));
    let friction = estimates[2999]["friction"].as_f64().unwrap();
    let deviation = estimates[2999]["friction_deviation"].as_f64().unwrap();
    assert!(
        (friction - 0.6).abs() < 4.0 * deviation + 0.01,
        "{friction} {deviation}"
    );

    let mut exported = Vec::new();
    ticks_to_csv(&bytes[..], &mut exported).unwrap();
    let exported = String::from_utf8(exported).unwrap();
    assert_eq!(exported.lines().count(), 3001);
    for (row, (a, b)) in exported.lines().zip(csv_text.lines()).enumerate() {
        assert_eq!(a, b, "row {row}");
    }
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    assert_eq!(metadata.metadata["scenario"], "hybrid-elbow-down");
    let start_ns: u64 = metadata.metadata["start_unix_ns"].parse().unwrap();
    let age = SystemTime::UNIX_EPOCH + Duration::from_nanos(start_ns);
    assert!(age.elapsed().unwrap() < Duration::from_secs(600));
}

/// Returns every value of a key in a document.
fn values_of<'a>(key: &str, json: &'a Value, found: &mut Vec<&'a str>) {
    match json {
        Value::Object(map) => map.iter().for_each(|(name, value)| match value.as_str() {
            Some(text) if name == key => found.push(text),
            _ => values_of(key, value, found),
        }),
        Value::Array(list) => list.iter().for_each(|value| values_of(key, value, found)),
        _ => {}
    }
}

#[test]
fn every_curve_of_the_layout_is_recorded() {
    let layout = include_str!("../../../../docs/foxglove-layout.json");
    let layout: Value = serde_json::from_str(layout).unwrap();
    let mut curves = Vec::new();
    values_of("value", &layout, &mut curves);
    assert!(curves.len() > 10);
    for curve in curves {
        let (topic, field) = curve.trim_start_matches('/').split_once('.').unwrap();
        let is_recorded = TOPICS
            .iter()
            .filter(|known| known.name == topic)
            .any(|known| known.fields.iter().any(|known| known.name == field));
        let is_event = topic == "events" && event_schema()["properties"][field].is_object();
        assert!(is_recorded || is_event, "{curve}");
    }
}

#[test]
fn a_bounce_leaves_its_impacts_and_lift_offs_as_events() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = scenario("open-loop-bounce", &["run.duration_s=0.5"]);
    let (bytes, _) = record(folder.path(), &scenario);
    let messages = messages(&bytes);
    let events = of_topic(&messages, "/events");
    let of_kind = |kind: &str| events.iter().filter(|event| event["kind"] == kind).count();
    assert_eq!(events[0]["kind"], "impact-without-collision");
    assert!(events[0]["impulse_n_ns"].as_f64().unwrap() > 0.0);
    assert!(
        of_kind("impact") > 0 && of_kind("lift-off") > 0,
        "{events:?}"
    );
    assert!(
        events
            .windows(2)
            .all(|pair| pair[0]["time_s"].as_f64() <= pair[1]["time_s"].as_f64())
    );
}

#[test]
fn estimates_end_where_the_answers_are_another_controllers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let scenario = scenario("hybrid-elbow-down", &[]);
    let configuration = scenario.controller_configuration();
    let log = McapLog::create(&path, &scenario, Source::Simulation).unwrap();
    let mut recorder = Recorder::start(&configuration, vec![Box::new(log)]).unwrap();
    let mut sample = Sample {
        delivered: true,
        answered: true,
        ..Sample::default()
    };
    sample.actuator.torques[0].0 = 77;
    recorder.push(&sample).unwrap();
    assert!(recorder.finish().failures.is_empty());
    let messages = messages(&fs::read(&path).unwrap());
    assert!(of_topic(&messages, "/estimates").is_empty());
    assert_eq!(of_topic(&messages, "/events")[0]["kind"], "estimates-end");
}

/// Starts a recording of samples at time zero in a file with this much room, if it is limited.
fn start(path: &Path, room: Option<u64>) -> Result<Recorder, RecordError> {
    let scenario = scenario("open-loop-bounce", &[]);
    let mut file = AtomicFile::create(path).unwrap();
    if let Some(room) = room {
        file.room = room as _;
    }
    let log = McapLog::to(file, &scenario, Source::Simulation)?;
    Recorder::start(&scenario.controller_configuration(), vec![Box::new(log)])
}

#[test]
fn values_that_are_not_finite_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut recorder = start(&path, None).unwrap();
    let plant = Snapshot {
        b_m_s2: f64::NAN,
        normal_force_n: f64::INFINITY,
        ..Snapshot::default()
    };
    recorder
        .push(&Sample {
            plant,
            ..Sample::default()
        })
        .unwrap();
    assert!(recorder.finish().failures.is_empty());
    let messages = messages(&fs::read(&path).unwrap());
    let plant = of_topic(&messages, "/plant")[0];
    assert!(plant.get("b_m_s2").is_none() && plant.get("normal_force_n").is_none());
    assert_eq!(plant["p_per_kg"], 0.0);
}

#[test]
fn an_empty_recording_is_a_valid_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let recorded = start(&path, None).unwrap().finish();
    assert_eq!(recorded.complete, std::slice::from_ref(&path));
    assert!(messages(&fs::read(&path).unwrap()).is_empty());
}

#[test]
fn a_recorder_dropped_unfinished_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut recorder = start(&path, None).unwrap();
    for _ in 0..3000 {
        recorder.push(&Sample::default()).unwrap();
    }
    assert!(!path.exists());
    drop(recorder);
    assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
}

#[test]
fn an_unwritable_path_is_refused_at_once_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let scenario = scenario("open-loop-bounce", &[]);
    let error = McapLog::create(file.join("run.mcap"), &scenario, Source::Simulation)
        .err()
        .unwrap();
    assert!(error.to_string().contains("file/run.mcap"), "{error}");
}

#[test]
fn a_full_disk_leaves_what_has_been_written_and_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let partial = folder.path().join("run.partial.mcap");
    let is_reported = |error: &RecordError| {
        let text = error.to_string();
        assert!(text.contains("run.mcap"), "{text}");
        assert!(text.contains("no storage space"), "{text}");
    };

    // At the start …
    is_reported(&start(&path, Some(0)).unwrap_err());
    assert!(fs::read_dir(folder.path()).unwrap().next().is_none());

    // … while running …
    let mut recorder = start(&path, Some(300_000)).unwrap();
    let mut sample = Sample::default();
    let error = (0..)
        .find_map(|tick| {
            sample.plant.time_s = f64::from(tick) * 1e-3;
            recorder.push(&sample).err()
        })
        .unwrap();
    is_reported(&error);
    let RecordError::Partial { path: kept, .. } = error else {
        panic!("{error}");
    };
    assert_eq!(kept, partial);
    let recorded = recorder.finish_partial("no space");
    assert!(
        recorded.failures.is_empty() && recorded.partial.is_empty(),
        "{recorded:?}"
    );
    let recovered = ticks_to_csv(&fs::read(&partial).unwrap()[..], std::io::sink()).unwrap();
    assert!(recovered.damage.is_some() && recovered.rows > 0);
    fs::remove_file(&partial).unwrap();

    // … or, in a short run, at the end.
    let mut recorder = start(&path, Some(45_000)).unwrap();
    recorder.push(&Sample::default()).unwrap();
    let recorded = recorder.finish();
    let [error] = recorded.failures.as_slice() else {
        panic!("{recorded:?}");
    };
    is_reported(error);
    assert!(recorded.complete.is_empty() && partial.exists() && !path.exists());
}

#[test]
fn a_file_that_fails_leaves_the_others_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = scenario("edge", &[]);
    let file = |name: &str| AtomicFile::create(folder.path().join(name)).unwrap();
    let mut full = file("run.csv");
    full.room = 10_000;
    let sinks: Vec<Box<dyn Sink>> = vec![
        Box::new(CsvTable::to(full).unwrap()),
        Box::new(CsvTable::to(file("second.csv")).unwrap()),
    ];
    let mut recorder = Recorder::start(&scenario.controller_configuration(), sinks).unwrap();
    let mut failures = 0;
    for _ in 0..10_000 {
        failures += usize::from(recorder.push(&Sample::default()).is_err());
    }
    let recorded = recorder.finish();
    assert_eq!((failures, recorded.failures.len()), (1, 0));
    let path = folder.path().join("second.csv");
    assert_eq!(fs::read_to_string(&path).unwrap().lines().count(), 10_001);
    assert_eq!(recorded.complete, [path]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn where_a_period_is_no_whole_nanosecond_the_table_is_that_of_the_record() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = scenario("edge", &["run.tick_hz=3000", "run.duration_s=0.01"]);
    let (record, table) = record(folder.path(), &scenario);
    let mut exported = Vec::new();
    ticks_to_csv(&record[..], &mut exported).unwrap();
    assert_eq!(table.lines().count(), 31);
    assert_eq!(String::from_utf8(exported).unwrap(), table);
}

#[test]
fn a_partial_file_that_cannot_be_written_leaves_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = scenario("edge", &[]);
    let file = |name: &str| AtomicFile::create(folder.path().join(name)).unwrap();
    let log = McapLog::to(file("run.mcap"), &scenario, Source::Simulation).unwrap();
    let mut full = file("run.csv");
    full.room = 100;
    let sinks: Vec<Box<dyn Sink>> = vec![
        Box::new(log),
        Box::new(CsvTable::to(full).unwrap()),
        Box::new(CsvTable::to(file("second.csv")).unwrap()),
    ];
    let mut recorder = Recorder::start(&scenario.controller_configuration(), sinks).unwrap();
    recorder.push(&Sample::default()).unwrap();
    let recorded = recorder.finish_partial("stopped");
    let ([record, table], [error]) = (&recorded.partial[..], &recorded.failures[..]) else {
        panic!("{recorded:?}");
    };
    assert!(record.exists() && table.exists());
    assert!(error.to_string().contains("run.csv"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
