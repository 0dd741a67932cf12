//! A run as an MCAP log: JSON messages with their schemas, in zstd chunks.
//!
//! Topics, each with one message per control tick; `log_time` is simulated time:
//! - `/plant`: state, contact and torques of the simulated arm, SI units
//! - `/sensor`: the frame that the controller received, raw counts
//! - `/actuator`: the frame that the controller returned, raw counts, with state and fault by name
//!
//! Fields are flat, so every number is a curve in Foxglove and PlotJuggler. A
//! value that is not finite becomes `null`. One metadata record holds the configuration.
//!
//! The control loop only copies a [`Sample`] into a buffer. Full buffers go to a
//! writer thread and come back empty. When no buffer is empty the loop waits, so no
//! sample is lost and memory is bounded.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, BufWriter};
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use mcap::McapError;
use mcap::records::{MessageHeader, Metadata};
use painleve_plant::sample::Sample;
use painleve_system::atomic_file::{AtomicFile, AtomicFileError};
use schemars::{JsonSchema, SchemaGenerator, generate::SchemaSettings};
use serde::Serialize;

/// Samples passed to the writer thread at once: one second of a run at 1 kHz.
const SAMPLES_PER_BUFFER: usize = 1024;
/// Number of buffers in circulation, about 0.8 MB together.
const BUFFERS: usize = 4;

/// Why a run could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be created or renamed.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// Writing failed during the recording, for example because the disk is full.
    #[error(
        "cannot record to `{path}`: {source}; choose a path with enough space or run without recording"
    )]
    Write {
        /// The requested path.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The writer thread cannot be started.
    #[error(
        "cannot start the thread that writes `{path}`: {source}; end other processes or run without recording"
    )]
    Thread {
        /// The requested path.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A call after the error that ended the recording.
    #[error("recording to `{path}` has already failed; start a new recording")]
    Ended {
        /// The requested path.
        path: PathBuf,
    },
}

/// Writes samples to an MCAP file that appears once it is complete.
///
/// Leaves no file if dropped without [`finish`](Self::finish).
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    /// The requested path.
    target: PathBuf,
    buffer: Vec<Sample>,
    /// `None` after the recording ended.
    writer: Option<WriterThread>,
}

#[derive(Debug)]
struct WriterThread {
    full: SyncSender<Vec<Sample>>,
    empty: Receiver<Vec<Sample>>,
    thread: JoinHandle<Result<LogWriter, McapError>>,
}

impl Recorder {
    /// Starts a recording; `metadata` (scenario, seed, configuration as JSON, …) goes
    /// into a separate record.
    ///
    /// The writer thread inherits the caller's scheduling: create the recorder before
    /// raising a priority.
    ///
    /// # Errors
    /// [`RecordError`] if the file or its folder cannot be created, or the thread
    /// cannot be started.
    pub fn create(
        path: impl Into<PathBuf>,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Self, RecordError> {
        Self::start(AtomicFile::create(path)?, metadata)
    }

    fn start(file: AtomicFile, metadata: &BTreeMap<String, String>) -> Result<Self, RecordError> {
        let (path, target) = (file.path().to_path_buf(), file.target().to_path_buf());
        let log = LogWriter::new(file, metadata).map_err(|error| write_error(&path, error))?;

        let (full, full_buffers) = sync_channel(BUFFERS);
        let (empty_buffers, empty) = sync_channel(BUFFERS);
        for _ in 1..BUFFERS {
            // Cannot fail: the channel has room and its receiver exists.
            let _ = empty_buffers.send(Vec::with_capacity(SAMPLES_PER_BUFFER));
        }
        let thread = thread::Builder::new()
            .name("mcap writer".to_owned())
            .spawn(move || write_buffers(log, &full_buffers, &empty_buffers));
        match thread {
            Ok(thread) => Ok(Self {
                path,
                target,
                buffer: Vec::with_capacity(SAMPLES_PER_BUFFER),
                writer: Some(WriterThread {
                    full,
                    empty,
                    thread,
                }),
            }),
            Err(source) => Err(RecordError::Thread { path, source }),
        }
    }

    /// Adds a copy of a sample. Waits only when the disk is behind by
    /// several thousand samples.
    ///
    /// # Errors
    /// [`RecordError`] if writing earlier samples failed; the recording has then ended.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.buffer.push(*sample);
        if self.buffer.len() >= SAMPLES_PER_BUFFER {
            self.hand_over()?;
        }
        Ok(())
    }

    /// Writes the remaining samples and gives the file its final name.
    ///
    /// # Errors
    /// [`RecordError`] if anything could not be written; no file is left then.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.hand_over()?;
        let file = self
            .end()?
            .finish()
            .map_err(|error| write_error(&self.path, error))?;
        Ok(file.commit()?)
    }

    /// Whether the recording and `file` have the same target path.
    pub fn is_same_file(&self, file: &AtomicFile) -> bool {
        self.target == file.target()
    }

    /// Writes the recorded part of a run that ended early, under a name that marks it as partial, with
    /// the reason in a metadata record `ended early`, and returns that name. Keeps the record of an
    /// earlier run.
    ///
    /// # Errors
    /// See [`Recorder::finish`].
    pub fn finish_partial(mut self, reason: &str) -> Result<PathBuf, RecordError> {
        self.hand_over()?;
        let mut log = self.end()?;
        let metadata = BTreeMap::from([("reason".to_owned(), reason.to_owned())]);
        let file = log
            .write_metadata("ended early", metadata)
            .and_then(|()| log.finish())
            .map_err(|error| write_error(&self.path, error))?;
        Ok(file.commit_partial()?)
    }

    #[cold]
    fn hand_over(&mut self) -> Result<(), RecordError> {
        let handed_over = self.writer.as_ref().and_then(|writer| {
            let empty = writer.empty.recv().ok()?;
            let full = mem::replace(&mut self.buffer, empty);
            writer.full.send(full).ok()
        });
        if handed_over.is_some() {
            return Ok(());
        }
        // A closed channel means that the thread has stopped: its result holds the reason.
        self.buffer.clear();
        self.end().and_then(|_| Err(self.ended()))
    }

    /// Stops the writer thread and takes back the log.
    fn end(&mut self) -> Result<LogWriter, RecordError> {
        let Some(WriterThread { full, thread, .. }) = self.writer.take() else {
            return Err(self.ended());
        };
        drop(full);
        match thread.join() {
            Ok(Ok(log)) => Ok(log),
            Ok(Err(error)) => Err(write_error(&self.path, error)),
            Err(_panic) => Err(self.ended()),
        }
    }

    fn ended(&self) -> RecordError {
        RecordError::Ended {
            path: self.path.clone(),
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Dropping the unfinished log removes its temporary file.
        let _ = self.end();
    }
}

/// Runs the writer thread until the recorder closes its channel.
fn write_buffers(
    mut log: LogWriter,
    full: &Receiver<Vec<Sample>>,
    empty: &SyncSender<Vec<Sample>>,
) -> Result<LogWriter, McapError> {
    for mut buffer in full {
        for sample in &buffer {
            log.write(sample)?;
        }
        buffer.clear();
        // Fails only when the recorder is ending and takes no more buffers.
        let _ = empty.send(buffer);
    }
    Ok(log)
}

fn write_error(path: &Path, error: McapError) -> RecordError {
    let source = match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    };
    RecordError::Write {
        path: path.to_path_buf(),
        source,
    }
}

/// Encodes samples and owns the file.
struct LogWriter {
    writer: mcap::Writer<BufWriter<AtomicFile>>,
    plant: u16,
    sensor: u16,
    actuator: u16,
    sequence: u32,
    json: Vec<u8>,
}

impl LogWriter {
    fn new(file: AtomicFile, metadata: &BTreeMap<String, String>) -> Result<Self, McapError> {
        let mut writer = mcap::WriteOptions::new()
            .library(concat!("painleve ", env!("CARGO_PKG_VERSION")))
            // The cores belong to the control loop; one thread is fast enough.
            .compression_threads(0)
            // The default level is slower here and compresses these messages no better.
            .compression_level(1)
            .create(BufWriter::new(file))?;
        writer.write_metadata(&Metadata {
            name: "painleve".to_owned(),
            metadata: metadata.clone(),
        })?;
        Ok(Self {
            plant: add_channel::<PlantMessage>(&mut writer, "/plant")?,
            sensor: add_channel::<SensorMessage>(&mut writer, "/sensor")?,
            actuator: add_channel::<ActuatorMessage>(&mut writer, "/actuator")?,
            writer,
            sequence: 0,
            json: Vec::with_capacity(1024),
        })
    }

    fn write_metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), McapError> {
        self.writer.write_metadata(&Metadata {
            name: name.to_owned(),
            metadata,
        })
    }

    fn write(&mut self, sample: &Sample) -> Result<(), McapError> {
        // Saturates: a negative or undefined time becomes zero.
        let time_ns = (sample.plant.time_s * 1e9).round() as u64;
        self.write_message(self.plant, time_ns, &PlantMessage::new(sample))?;
        self.write_message(self.sensor, time_ns, &SensorMessage::new(sample))?;
        self.write_message(self.actuator, time_ns, &ActuatorMessage::new(sample))?;
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }

    fn write_message(
        &mut self,
        channel_id: u16,
        time_ns: u64,
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        self.json.clear();
        serde_json::to_writer(&mut self.json, message).map_err(io::Error::from)?;
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, &self.json)
    }

    fn finish(mut self) -> Result<AtomicFile, McapError> {
        self.writer.finish()?;
        let buffered = self.writer.into_inner();
        Ok(buffered.into_inner().map_err(|error| error.into_error())?)
    }
}

fn add_channel<M: JsonSchema>(
    writer: &mut mcap::Writer<BufWriter<AtomicFile>>,
    topic: &str,
) -> Result<u16, McapError> {
    // Foxglove reads draft 7 and does not resolve references.
    let settings = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true);
    let schema = SchemaGenerator::new(settings).into_root_schema_for::<M>();
    let schema = serde_json::to_vec(&schema).map_err(io::Error::from)?;
    let name: Cow<'_, str> = M::schema_name();
    let schema_id = writer.add_schema(&name, "jsonschema", &schema)?;
    writer.add_channel(schema_id, topic, "json", &BTreeMap::new())
}

/// State, contact and torques of the simulated arm.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "painleve.Plant")]
struct PlantMessage {
    /// Angle of the first link from the belt's inward normal, rad.
    theta1_rad: f64,
    /// Angle of the second link from the belt's inward normal, rad.
    theta2_rad: f64,
    /// Rate of the first angle, rad/s.
    theta1_dot_rad_s: f64,
    /// Rate of the second angle, rad/s.
    theta2_dot_rad_s: f64,
    /// Position of the tip along the belt z_t, m.
    tip_t_m: f64,
    /// Reference z_t*, m.
    reference_tip_t_m: f64,
    /// Height of the tip over the belt, m.
    gap_m: f64,
    /// Velocity of the tip relative to the belt, m/s.
    slip_velocity_m_s: f64,
    /// Velocity of the belt, m/s.
    belt_speed_m_s: f64,
    /// Normal force f_n, N.
    normal_force_n: f64,
    /// Tangential force f_t, N.
    tangential_force_n: f64,
    /// Free normal acceleration b, m/s².
    b_m_s2: f64,
    /// Contact coefficient p for the present direction of slip, 1/kg.
    p_per_kg: f64,
    /// Torque on the first joint, N·m.
    u1_nm: f64,
    /// Torque on the second joint, N·m.
    u2_nm: f64,
    /// Contact mode of the tip: flight, slide-positive, slide-negative or stick.
    mode: &'static str,
    /// Contact mode as a number: 0 flight, 1 slide-positive, 2 slide-negative, 3 stick.
    mode_number: u8,
}

impl PlantMessage {
    fn new(sample: &Sample) -> Self {
        let [theta1_rad, theta2_rad] = sample.plant.theta_rad;
        let [theta1_dot_rad_s, theta2_dot_rad_s] = sample.plant.theta_dot_rad_s;
        let [u1_nm, u2_nm] = sample.plant.torque_nm;
        Self {
            theta1_rad,
            theta2_rad,
            theta1_dot_rad_s,
            theta2_dot_rad_s,
            tip_t_m: sample.plant.tip_t_m,
            reference_tip_t_m: sample.reference_tip_t_m,
            gap_m: sample.plant.gap_m,
            slip_velocity_m_s: sample.plant.slip_velocity_m_s,
            belt_speed_m_s: sample.plant.belt_speed_m_s,
            normal_force_n: sample.plant.normal_force_n,
            tangential_force_n: sample.plant.tangential_force_n,
            b_m_s2: sample.plant.b_m_s2,
            p_per_kg: sample.plant.p_per_kg,
            u1_nm,
            u2_nm,
            mode: sample.plant.mode.name(),
            mode_number: sample.plant.mode as u8,
        }
    }
}

/// The sensor frame, raw counts.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "painleve.Sensor")]
struct SensorMessage {
    /// Control tick of the sample; wraps.
    tick: u32,
    /// Sequence number of the frame; wraps.
    sequence: u32,
    /// Encoder of the first joint, θ1, counts.
    joint1_counts: u32,
    /// Encoder in the elbow, θ2 − θ1, counts.
    joint2_counts: u32,
    /// Normal force, counts.
    normal_force_counts: i32,
    /// Tangential force, counts.
    tangential_force_counts: i32,
    /// Digital inputs, one bit each.
    inputs: u32,
}

impl SensorMessage {
    fn new(sample: &Sample) -> Self {
        let sensor = &sample.sensor;
        Self {
            tick: sensor.tick,
            sequence: sensor.sequence,
            joint1_counts: sensor.joints[0].0,
            joint2_counts: sensor.joints[1].0,
            normal_force_counts: sensor.normal_force.0,
            tangential_force_counts: sensor.tangential_force.0,
            inputs: sensor.inputs.0,
        }
    }
}

/// The actuator frame, raw counts, with state and fault by name.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "painleve.Actuator")]
struct ActuatorMessage {
    /// Tick of the sensor frame that this frame answers.
    tick: u32,
    /// Sequence number of the frame; wraps.
    sequence: u32,
    /// Torque on the first joint, counts.
    u1_counts: i32,
    /// Torque on the second joint, counts.
    u2_counts: i32,
    /// Reference z_t* of this tick, µm.
    reference_tip_um: i32,
    /// Tip position as the controller estimates it, µm.
    estimated_tip_um: i32,
    /// The supervisor's state.
    state: &'static str,
    /// Number of the supervisor's state.
    state_number: u8,
    /// The latched fault, or "none".
    fault: &'static str,
    /// Number of the latched fault, 0 for none.
    fault_number: u8,
    /// Flags, one bit each: 1 contact, 2 torque saturated, 4 reference done.
    flags: u16,
}

impl ActuatorMessage {
    fn new(sample: &Sample) -> Self {
        const UNKNOWN: &str = "unknown";
        let actuator = &sample.actuator;
        Self {
            tick: actuator.tick,
            sequence: actuator.sequence,
            u1_counts: actuator.torques[0].0,
            u2_counts: actuator.torques[1].0,
            reference_tip_um: actuator.reference_tip.0,
            estimated_tip_um: actuator.estimated_tip.0,
            state: actuator
                .supervisor_state()
                .map_or(UNKNOWN, |state| state.name()),
            state_number: actuator.state,
            fault: match (actuator.fault, actuator.latched_fault()) {
                (0, _) => "none",
                (_, Some(fault)) => fault.description(),
                (_, None) => UNKNOWN,
            },
            fault_number: actuator.fault,
            flags: actuator.flags.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    use painleve_shared::counts::{EncoderCounts, ForceCounts, Micrometres, TorqueCounts};
    use painleve_shared::status::{Fault, SupervisorState};
    use serde_json::Value;

    use painleve_plant::{ContactMode, Snapshot};

    fn sample(tick: u32) -> Sample {
        // Quarters, so that decoding is exact.
        let value = f64::from(tick) * 0.25;
        let mut sample = Sample {
            plant: Snapshot {
                time_s: f64::from(tick) * 1e-3,
                theta_rad: [value, -value],
                theta_dot_rad_s: [value + 1.0, value + 2.0],
                tip_t_m: value + 3.0,
                gap_m: value + 4.0,
                slip_velocity_m_s: value + 5.0,
                belt_speed_m_s: -0.5,
                normal_force_n: value + 6.0,
                tangential_force_n: value + 7.0,
                b_m_s2: value + 8.0,
                p_per_kg: value + 9.0,
                torque_nm: [value + 10.0, value + 11.0],
                mode: ContactMode::ALL[tick as usize % 4],
                ..Snapshot::default()
            },
            reference_tip_t_m: value + 12.0,
            ..Sample::default()
        };
        sample.sensor.tick = tick;
        sample.sensor.sequence = tick + 1;
        sample.sensor.joints = [EncoderCounts(tick % 16384), EncoderCounts(7)];
        sample.sensor.normal_force = ForceCounts(-1024);
        sample.actuator.tick = tick;
        sample.actuator.torques = [TorqueCounts(2047), TorqueCounts(-2048)];
        sample.actuator.estimated_tip = Micrometres(-148_000);
        sample.actuator.state = SupervisorState::LiftOff as u8;
        sample.actuator.fault = Fault::LostFrames as u8;
        sample
    }

    fn record(path: &Path, ticks: u32) {
        let metadata = BTreeMap::from([("scenario".to_owned(), "hybrid-elbow-down".to_owned())]);
        let mut recorder = Recorder::create(path, &metadata).unwrap();
        for tick in 0..ticks {
            recorder.push(&sample(tick)).unwrap();
        }
        recorder.finish().unwrap();
    }

    fn is_empty(folder: &Path) -> bool {
        fs::read_dir(folder).unwrap().next().is_none()
    }

    #[test]
    fn samples_round_trip_with_their_time_and_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/run.mcap");
        // Several full buffers and a partial one.
        let ticks = 5 * SAMPLES_PER_BUFFER as u32 + 17;
        record(&path, ticks);

        let bytes = fs::read(&path).unwrap();
        let mut counts = BTreeMap::<String, u32>::new();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            let count = counts.entry(message.channel.topic.clone()).or_default();
            let tick = *count;
            *count += 1;
            assert_eq!(message.sequence, tick);
            assert_eq!(message.log_time, u64::from(tick) * 1_000_000);
            assert_eq!(message.publish_time, message.log_time);

            let expected = sample(tick);
            let json: Value = serde_json::from_slice(&message.data).unwrap();
            match message.channel.topic.as_str() {
                "/plant" => {
                    assert_eq!(json["theta2_rad"], expected.plant.theta_rad[1]);
                    assert_eq!(json["tip_t_m"], expected.plant.tip_t_m);
                    assert_eq!(json["normal_force_n"], expected.plant.normal_force_n);
                    assert_eq!(json["u2_nm"], expected.plant.torque_nm[1]);
                    assert_eq!(json["p_per_kg"], expected.plant.p_per_kg);
                    assert_eq!(json["mode"], expected.plant.mode.name());
                    assert_eq!(json["mode_number"], tick % 4);
                }
                "/sensor" => {
                    assert_eq!(json["sequence"], tick + 1);
                    assert_eq!(json["joint1_counts"], tick % 16384);
                    assert_eq!(json["normal_force_counts"], -1024);
                }
                "/actuator" => {
                    assert_eq!(json["u1_counts"], 2047);
                    assert_eq!(json["estimated_tip_um"], -148_000);
                    assert_eq!(json["state"], "lift-off");
                    assert_eq!(json["fault_number"], 5);
                    assert_eq!(json["fault"], Fault::LostFrames.description());
                }
                other => panic!("topic {other}"),
            }
        }
        let topics = ["/actuator", "/plant", "/sensor"];
        assert_eq!(counts, topics.map(|topic| (topic.to_owned(), ticks)).into());
    }

    #[test]
    fn schemas_describe_every_field_and_metadata_names_the_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        record(&path, 1);
        let bytes = fs::read(&path).unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            assert_eq!(message.channel.message_encoding, "json");
            let schema = message.channel.schema.as_ref().unwrap();
            assert_eq!(schema.encoding, "jsonschema");
            let schema: Value = serde_json::from_slice(&schema.data).unwrap();
            assert_eq!(schema["type"], "object");
            let json: Value = serde_json::from_slice(&message.data).unwrap();
            for (field, value) in json.as_object().unwrap() {
                let property = &schema["properties"][field];
                // Plain types only: Foxglove's reader does not support unions.
                let plain = property["type"].as_str().unwrap();
                assert_eq!(plain == "string", value.is_string(), "{field}");
                assert!(property["description"].is_string(), "{field}");
            }
        }

        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.schemas.len(), 3);
        let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(metadata.name, "painleve");
        assert_eq!(metadata.metadata["scenario"], "hybrid-elbow-down");
    }

    #[test]
    fn values_that_are_not_finite_become_null() {
        let sample = Sample {
            plant: Snapshot {
                b_m_s2: f64::NAN,
                normal_force_n: f64::INFINITY,
                ..Snapshot::default()
            },

            ..Sample::default()
        };
        let json = serde_json::to_value(PlantMessage::new(&sample)).unwrap();
        assert_eq!(json["b_m_s2"], Value::Null);
        assert_eq!(json["normal_force_n"], Value::Null);
    }

    #[test]
    fn an_empty_recording_is_a_valid_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        record(&path, 0);
        let bytes = fs::read(&path).unwrap();
        assert_eq!(mcap::MessageStream::new(&bytes).unwrap().count(), 0);
    }

    #[test]
    fn a_recorder_dropped_unfinished_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut recorder = Recorder::create(&path, &BTreeMap::new()).unwrap();
        for tick in 0..3000 {
            recorder.push(&sample(tick)).unwrap();
        }
        assert!(!path.exists());
        drop(recorder);
        assert!(is_empty(folder.path()));
    }

    #[test]
    fn an_unwritable_path_is_refused_at_once_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let error = Recorder::create(file.join("run.mcap"), &BTreeMap::new()).unwrap_err();
        assert!(error.to_string().contains("file/run.mcap"), "{error}");
    }

    #[test]
    fn a_full_disk_ends_the_recording_with_one_error_and_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let start = |room| {
            let mut file = AtomicFile::create(&path).unwrap();
            file.room = room;
            Recorder::start(file, &BTreeMap::new())
        };
        let told = |error: RecordError| {
            assert!(matches!(error, RecordError::Write { .. }), "{error}");
            assert!(error.to_string().contains("run.mcap"), "{error}");
            assert!(error.to_string().contains("no storage space"), "{error}");
        };

        // At the start …
        told(start(0).unwrap_err());

        // … while running …
        let mut recorder = start(20_000).unwrap();
        told(
            (0..)
                .find_map(|tick| recorder.push(&sample(tick)).err())
                .unwrap(),
        );
        let error = recorder.finish().unwrap_err();
        assert!(matches!(error, RecordError::Ended { .. }), "{error}");

        // … or, in a short run, at the end.
        let mut recorder = start(1_000).unwrap();
        recorder.push(&sample(0)).unwrap();
        told(recorder.finish().unwrap_err());
        assert!(is_empty(folder.path()));
    }
}
