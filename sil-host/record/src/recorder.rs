//! The thread that records a run, and the [`Sink`]s that it feeds.
//!
//! The control loop only copies a [`Sample`] into a buffer. Full buffers go to the recording thread
//! and come back empty. When no buffer is empty the loop waits, so no sample is lost and memory is
//! bounded. The thread recomputes the controller's estimates ([`Replica`]) and finds the controller's
//! events, so that neither costs the loop anything.

use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use painleve_chart::picture::PictureError;
use painleve_files::atomic_file::{AtomicFile, AtomicFileError, commit_all};
use painleve_plant::closed_loop::{LoopError, Monitor};
use painleve_plant::sample::Sample;
use painleve_plant::telemetry::Telemetry;
use painleve_plant::{Configuration, Event};

use crate::events::{ControllerEvents, EventKind, RunEvent};
use crate::replica::Replica;

/// Entries passed to the recording thread at once: one second of a run at 1 kHz.
const ENTRIES_PER_BUFFER: usize = 1024;
/// Number of buffers in circulation, about 1 MB together.
const BUFFERS: usize = 4;

/// Why a run could not be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be created or renamed.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// The figure cannot be converted.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// Writing failed during the recording, for example because the disk is full.
    #[error("cannot write `{path}`: {source}; choose a path that can be written and has space")]
    Write {
        /// The requested path.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// The recording thread cannot be started.
    #[error("cannot start the recording thread: {0}; end other processes or run without recording")]
    Thread(io::Error),
    /// A call after the error that ended the recording.
    #[error("the recording has already failed; start a new one")]
    Ended,
}

impl RecordError {
    /// A [`RecordError::Write`] to the file requested at `path`.
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::Write {
            path: path.to_path_buf(),
            source,
        }
    }
}

/// Everything about one control tick.
#[derive(Clone, Copy, Debug)]
pub struct RecordedTick<'a> {
    /// Both frames and the plant's state.
    pub sample: &'a Sample,
    /// The controller's internal state after the tick; `None` if it is not known.
    pub estimates: Option<&'a Telemetry>,
}

/// A file, or part of one, made from the ticks of a run.
pub trait Sink: Send {
    /// Receives one control tick.
    ///
    /// # Errors
    /// [`RecordError`] ends the recording.
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError>;

    /// Receives an event; events and ticks arrive in order of time.
    ///
    /// # Errors
    /// [`RecordError`] ends the recording.
    fn event(&mut self, _event: &RunEvent) -> Result<(), RecordError> {
        Ok(())
    }

    /// Completes the file and returns it, if there is one. It receives its name when all sinks are complete; without
    /// this call no file is left.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written.
    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError>;

    /// Keeps the file of a run that ended early under a name that marks it as partial, which is
    /// returned; `None` if a partial file has no use.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written.
    fn finish_partial(self: Box<Self>, _reason: &str) -> Result<Option<PathBuf>, RecordError> {
        Ok(None)
    }
}

/// The sinks of a recording.
pub type Sinks = Vec<Box<dyn Sink>>;

/// An entry of the recording, as the control loop passes it on.
#[derive(Clone, Copy, Debug)]
enum Entry {
    Tick(Sample),
    Event(RunEvent),
}

/// Passes the ticks of a run to a thread that records them.
#[derive(Debug)]
pub struct Recorder {
    buffer: Vec<Entry>,
    /// `None` after the recording ended.
    thread: Option<RecordingThread>,
}

#[derive(Debug)]
struct RecordingThread {
    full: SyncSender<Vec<Entry>>,
    empty: Receiver<Vec<Entry>>,
    thread: JoinHandle<Result<Sinks, RecordError>>,
}

impl Recorder {
    /// Starts a recording of a run whose controller has this configuration.
    ///
    /// The thread inherits the caller's scheduling: start the recorder before raising a priority.
    ///
    /// # Errors
    /// [`RecordError::Thread`].
    pub fn start(configuration: &Configuration, sinks: Sinks) -> Result<Self, RecordError> {
        let (full, full_buffers) = sync_channel(BUFFERS);
        let (empty_buffers, empty) = sync_channel(BUFFERS);
        for _ in 1..BUFFERS {
            // Cannot fail: the channel has room and its receiver exists.
            let _ = empty_buffers.send(new_buffer());
        }
        let recording = Recording {
            replica: Replica::new(configuration),
            events: ControllerEvents::default(),
            sinks,
        };
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || recording.run(&full_buffers, &empty_buffers))
            .map_err(RecordError::Thread)?;
        Ok(Self {
            buffer: new_buffer(),
            thread: Some(RecordingThread {
                full,
                empty,
                thread,
            }),
        })
    }

    /// Adds a copy of a sample. Waits only when the sinks are behind by several thousand samples.
    ///
    /// # Errors
    /// [`RecordError`] if writing earlier samples failed; the recording has then ended.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.buffer.push(Entry::Tick(*sample));
        if self.buffer.len() >= ENTRIES_PER_BUFFER {
            self.hand_over()?;
        }
        Ok(())
    }

    /// Adds a discontinuity of the plant's motion.
    pub fn push_event(&mut self, time_s: f64, event: Event) {
        let kind = EventKind::Plant(event);
        self.buffer.push(Entry::Event(RunEvent { time_s, kind }));
    }

    /// Records the remaining samples and completes every file.
    ///
    /// # Errors
    /// [`RecordError`] if anything could not be written; no file is left then. Without a figure that cannot be converted
    /// the others are still complete, and are left.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.hand_over()?;
        let (mut files, mut unconverted) = (Vec::new(), None);
        for sink in self.end()? {
            match sink.finish() {
                Ok(file) => files.extend(file),
                Err(RecordError::Picture(error)) => unconverted = Some(error),
                Err(error) => return Err(error),
            }
        }
        commit_all(files)?;
        unconverted.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Keeps the recorded part of a run that ended early. Returns the name of each file, or why it could not be kept;
    /// the others are. Earlier records stay.
    pub fn finish_partial(mut self, reason: &str) -> Vec<Result<PathBuf, RecordError>> {
        match self.hand_over().and_then(|()| self.end()) {
            Ok(sinks) => sinks
                .into_iter()
                .filter_map(|sink| sink.finish_partial(reason).transpose())
                .collect(),
            Err(error) => vec![Err(error)],
        }
    }

    #[cold]
    fn hand_over(&mut self) -> Result<(), RecordError> {
        let handed_over = self.thread.as_ref().and_then(|thread| {
            let empty = thread.empty.recv().ok()?;
            let full = mem::replace(&mut self.buffer, empty);
            thread.full.send(full).ok()
        });
        if handed_over.is_some() {
            return Ok(());
        }
        // A closed channel means that the thread has stopped: its result holds the reason.
        self.buffer.clear();
        self.end().and(Err(RecordError::Ended))
    }

    /// Stops the thread and takes back the sinks.
    fn end(&mut self) -> Result<Sinks, RecordError> {
        let Some(RecordingThread { full, thread, .. }) = self.thread.take() else {
            return Err(RecordError::Ended);
        };
        drop(full);
        thread.join().unwrap_or(Err(RecordError::Ended))
    }
}

impl Monitor for Recorder {
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        let pushed = self.push(sample);
        pushed.map_err(|error| LoopError::Monitor(Box::new(error)))
    }

    fn event(&mut self, time_s: f64, event: Event) {
        self.push_event(time_s, event);
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Dropping unfinished sinks removes their temporary files.
        let _ = self.end();
    }
}

fn new_buffer() -> Vec<Entry> {
    // Additional room for events, which are passed on with the next tick.
    Vec::with_capacity(ENTRIES_PER_BUFFER + ENTRIES_PER_BUFFER / 8)
}

/// State of the recording thread.
struct Recording {
    replica: Option<Replica>,
    events: ControllerEvents,
    sinks: Sinks,
}

impl Recording {
    /// Runs until the recorder closes its channel.
    fn run(
        mut self,
        full: &Receiver<Vec<Entry>>,
        empty: &SyncSender<Vec<Entry>>,
    ) -> Result<Sinks, RecordError> {
        for mut buffer in full {
            for entry in &buffer {
                match entry {
                    Entry::Tick(sample) => self.tick(sample)?,
                    Entry::Event(event) => self.event(event)?,
                }
            }
            buffer.clear();
            // Fails only when the recorder is ending and takes no more buffers.
            let _ = empty.send(buffer);
        }
        Ok(self.sinks)
    }

    fn tick(&mut self, sample: &Sample) -> Result<(), RecordError> {
        if let Some(replica) = &mut self.replica
            && !replica.follow(sample)
        {
            self.replica = None;
            self.event(&RunEvent {
                time_s: sample.plant.time_s,
                kind: EventKind::EstimatesEnd,
            })?;
        }
        for kind in self.events.take_in(&sample.actuator).into_iter().flatten() {
            self.event(&RunEvent {
                time_s: sample.plant.time_s,
                kind,
            })?;
        }
        let tick = RecordedTick {
            sample,
            estimates: self.replica.as_ref().map(Replica::telemetry),
        };
        self.sinks.iter_mut().try_for_each(|sink| sink.tick(&tick))
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        self.sinks.iter_mut().try_for_each(|sink| sink.event(event))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::scenario::Scenario;

    /// A sink that ends with a file or without.
    struct Ending(Result<AtomicFile, RecordError>);

    impl Sink for Ending {
        fn tick(&mut self, _: &RecordedTick<'_>) -> Result<(), RecordError> {
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
            self.0.map(Some)
        }
    }

    #[test]
    fn a_figure_that_cannot_be_converted_does_not_take_the_record_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let scenario = Scenario::load("edge", &[]).unwrap();
        let finished = |error: RecordError| {
            let file = AtomicFile::create(&path).unwrap();
            let sinks = [Ending(Err(error)), Ending(Ok(file))];
            let sinks = sinks.map(|sink| Box::new(sink) as Box<dyn Sink>);
            let configuration = scenario.controller_configuration();
            let recorder = Recorder::start(&configuration, sinks.into()).unwrap();
            (recorder.finish().unwrap_err(), path.exists())
        };
        let (error, is_there) = finished(RecordError::Ended);
        assert!(matches!(error, RecordError::Ended) && !is_there);
        let (error, is_there) = finished(PictureError::Failed("no memory".into()).into());
        assert!(
            error.to_string().ends_with("no memory") && is_there,
            "{error}"
        );
    }
}
