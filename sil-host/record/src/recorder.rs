//! The thread that records a run, and the [`Sink`]s that it feeds.
//!
//! The control loop only copies a [`Sample`] into a buffer. Full buffers go to the recording thread
//! and come back empty. When no buffer is empty the loop waits, so no sample is lost and memory is
//! bounded. The thread recomputes the controller's estimates ([`Replica`]) and finds the controller's
//! events, so that neither costs the loop anything.

use std::collections::VecDeque;
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use painleve_chart::picture::PictureError;
use painleve_files::atomic_file::{AtomicFile, AtomicFileError};
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
    /// A file cannot be completed, but what has been written is kept.
    #[error("{failure}; the partial record is in {}", .path.display())]
    Partial {
        /// Why it is not complete.
        failure: Box<Self>,
        /// The partial file.
        path: PathBuf,
    },
    /// The recording thread cannot be started.
    #[error("cannot start the recording thread: {0}; end other processes or run without recording")]
    Thread(io::Error),
    /// The recording thread has panicked.
    #[error("the recording thread has failed; this is a defect")]
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

    /// Adds that what has been written is in the file at `path`.
    #[must_use]
    pub fn but_partly_in(self, path: PathBuf) -> Self {
        let failure = Box::new(self);
        Self::Partial { failure, path }
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

    /// Completes the file and returns it, if there is one. The recorder gives it its name; without this call no file is
    /// left.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written.
    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError>;

    /// Keeps the file of a run that ended early, or of a sink that has failed, under a name that marks it as partial, which
    /// is returned; `None` if a partial file has no use.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be written.
    fn finish_partial(self: Box<Self>, _reason: &str) -> Result<Option<PathBuf>, RecordError> {
        Ok(None)
    }
}

/// The sinks of a recording.
pub type Sinks = Vec<Box<dyn Sink>>;

/// What a recording leaves. A file that fails takes no other with it.
#[derive(Debug, Default)]
pub struct Recorded {
    /// The complete files.
    pub complete: Vec<PathBuf>,
    /// The partial files of a run that ended early.
    pub partial: Vec<PathBuf>,
    /// Why the others are missing or partial.
    pub failures: Vec<RecordError>,
}

impl Recorded {
    /// Completes the file of a sink.
    fn complete(&mut self, sink: Box<dyn Sink>) {
        let completed = sink.finish().and_then(|file| {
            let path = file.as_ref().map(|file| file.path().to_path_buf());
            file.map_or(Ok(()), AtomicFile::commit)?;
            Ok(path)
        });
        match completed {
            Ok(path) => self.complete.extend(path),
            Err(error) => self.failures.push(error),
        }
    }

    /// Keeps the partial file of a sink.
    fn keep_partial(&mut self, sink: Box<dyn Sink>, reason: &str) {
        match sink.finish_partial(reason) {
            Ok(path) => self.partial.extend(path),
            Err(error) => self.failures.push(error),
        }
    }
}

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
    empty: Receiver<Returned>,
    thread: JoinHandle<Files>,
}

/// A buffer that the thread returns.
#[derive(Debug, Default)]
struct Returned {
    /// The empty buffer.
    buffer: Vec<Entry>,
    /// Why a sink has failed meanwhile.
    failure: Option<RecordError>,
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
            let _ = empty_buffers.send(Returned {
                buffer: new_buffer(),
                failure: None,
            });
        }
        let recording = Recording {
            replica: Replica::new(configuration),
            events: ControllerEvents::default(),
            files: Files {
                sinks,
                ..Files::default()
            },
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
    /// [`RecordError`] once for every sink that could not write earlier samples. The others go on; after
    /// [`RecordError::Ended`] there are none.
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

    /// Records the remaining samples and completes every file that can be written.
    pub fn finish(mut self) -> Recorded {
        let (sinks, mut recorded) = self.end();
        for sink in sinks {
            recorded.complete(sink);
        }
        recorded
    }

    /// Keeps the recorded part of a run that ended early. Earlier records stay.
    pub fn finish_partial(mut self, reason: &str) -> Recorded {
        let (sinks, mut recorded) = self.end();
        for sink in sinks {
            recorded.keep_partial(sink, reason);
        }
        recorded
    }

    #[cold]
    fn hand_over(&mut self) -> Result<(), RecordError> {
        let RecordingThread { full, empty, .. } = self.thread.as_ref().ok_or(RecordError::Ended)?;
        // A closed channel means that the thread has panicked.
        let Returned { buffer, failure } = empty.recv().map_err(|_| RecordError::Ended)?;
        let sent = full.send(mem::replace(&mut self.buffer, buffer));
        sent.map_err(|_| RecordError::Ended)?;
        failure.map_or(Ok(()), Err)
    }

    /// Hands over the remaining samples, stops the thread, and takes back the sinks that have not failed, with what the
    /// others leave.
    fn end(&mut self) -> (Sinks, Recorded) {
        let Some(RecordingThread {
            full,
            empty,
            thread,
        }) = self.thread.take()
        else {
            return Default::default();
        };
        // Fails only if the thread has panicked.
        let _ = full.send(mem::take(&mut self.buffer));
        drop(full);
        let ended = thread.join();
        let Files { sinks, failures } = ended.unwrap_or_else(|_| Files {
            failures: [RecordError::Ended].into(),
            ..Files::default()
        });
        let returned = empty.iter().filter_map(|returned| returned.failure);
        let recorded = Recorded {
            failures: returned.chain(failures).collect(),
            ..Recorded::default()
        };
        (sinks, recorded)
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
    files: Files,
}

impl Recording {
    /// Runs until the recorder closes its channel.
    fn run(mut self, full: &Receiver<Vec<Entry>>, empty: &SyncSender<Returned>) -> Files {
        for mut buffer in full {
            for entry in &buffer {
                match entry {
                    Entry::Tick(sample) => self.tick(sample),
                    Entry::Event(event) => self.event(event),
                }
            }
            buffer.clear();
            let failure = self.files.failures.pop_front();
            // The channel has room for every buffer. Fails only when nobody takes them back.
            let _ = empty.send(Returned { buffer, failure });
        }
        self.files
    }

    fn tick(&mut self, sample: &Sample) {
        if let Some(replica) = &mut self.replica
            && !replica.follow(sample)
        {
            self.replica = None;
            self.event(&RunEvent {
                time_s: sample.plant.time_s,
                kind: EventKind::EstimatesEnd,
            });
        }
        for kind in self.events.take_in(&sample.actuator).into_iter().flatten() {
            self.event(&RunEvent {
                time_s: sample.plant.time_s,
                kind,
            });
        }
        let tick = RecordedTick {
            sample,
            estimates: self.replica.as_ref().map(Replica::telemetry),
        };
        self.files.write(|sink| sink.tick(&tick));
    }

    fn event(&mut self, event: &RunEvent) {
        self.files.write(|sink| sink.event(event));
    }
}

/// What the recording thread writes.
#[derive(Default)]
struct Files {
    /// The sinks that have not failed.
    sinks: Sinks,
    /// Failures of the others that have not been returned with a buffer.
    failures: VecDeque<RecordError>,
}

impl Files {
    /// Writes something to all sinks. One that fails leaves its partial file; the others go on.
    fn write(&mut self, write: impl Fn(&mut dyn Sink) -> Result<(), RecordError>) {
        let mut index = 0;
        while let Some(sink) = self.sinks.get_mut(index) {
            let Err(error) = write(sink.as_mut()) else {
                index += 1;
                continue;
            };
            let partial = self.sinks.remove(index).finish_partial(&error.to_string());
            self.failures.push_back(match partial {
                Ok(Some(path)) | Err(RecordError::Partial { path, .. }) => {
                    error.but_partly_in(path)
                }
                // If that cannot be written either, it is for the same reason.
                Ok(None) | Err(_) => error,
            });
        }
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
    fn a_file_that_fails_at_the_end_takes_no_other_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let scenario = Scenario::load("edge", &[]).unwrap();
        let file = AtomicFile::create(&path).unwrap();
        let failure = PictureError::Failed("no memory".into());
        let sinks = [Ending(Err(failure.into())), Ending(Ok(file))];
        let sinks = sinks.map(|sink| Box::new(sink) as Box<dyn Sink>);
        let configuration = scenario.controller_configuration();
        let recorder = Recorder::start(&configuration, sinks.into()).unwrap();
        let recorded = recorder.finish();
        let [error] = recorded.failures.as_slice() else {
            panic!("{recorded:?}");
        };
        assert!(error.to_string().ends_with("no memory"), "{error}");
        assert!(path.exists() && recorded.complete == [path]);
    }
}
