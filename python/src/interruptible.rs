//! Ctrl-C ends long calls: a plant that looks at Python's signals while it moves, and work on other threads.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::nalgebra::Vector2;
use painleve_plant::{Event, Plant, PlantError, Probe, Snapshot, State, Step};
use painleve_shared::{JointTorque, LinkMotion};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two looks at the signals. A look waits for the interpreter, which another thread may hold for 5 ms.
const BETWEEN_LOOKS: Duration = Duration::from_millis(100);
/// Integration steps between two looks at the clock; a step takes some microseconds.
const STEPS_BETWEEN_CLOCKS: u32 = 256;

/// Returns an error as an exception: the one that a signal raised, or a `RuntimeError`.
pub fn exception(error: &dyn std::error::Error) -> PyErr {
    match error
        .source()
        .and_then(|source| source.downcast_ref::<PyErr>())
    {
        Some(raised) => Python::attach(|py| raised.clone_ref(py)),
        None => PyRuntimeError::new_err(error.to_string()),
    }
}

/// A plant whose motion ends when a signal raises an exception.
pub struct Interruptible {
    plant: BuiltInPlant,
    watch: Watch,
    interrupted: bool,
}

/// Why an interruptible plant does not continue.
#[derive(Debug, thiserror::Error)]
enum Interrupted {
    #[error("interrupted: {0}")]
    Now(#[source] PyErr),
    #[error("an interrupt has ended a step in its middle; create the object again")]
    Before,
}

impl Interruptible {
    /// Wraps a plant.
    pub fn new(plant: BuiltInPlant) -> Self {
        let watch = Watch {
            count: 0,
            last_look: Instant::now(),
        };
        Self {
            plant,
            watch,
            interrupted: false,
        }
    }
}

impl Plant for Interruptible {
    fn snapshot(&self) -> Snapshot {
        self.plant.snapshot()
    }

    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        self.plant.command_torque(target_nm, lag_s);
    }

    fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError> {
        if self.interrupted {
            return Err(PlantError::new(Interrupted::Before));
        }
        let Self { plant, watch, .. } = self;
        // A plant that an interrupt leaves in the middle of a step is not advanced again.
        let advance = AssertUnwindSafe(|| {
            watch.count();
            plant.advance(until_s, &mut (probe, watch))
        });
        catch_unwind(advance).unwrap_or_else(|payload| match payload.downcast::<PyErr>() {
            Ok(raised) => {
                self.interrupted = true;
                Err(PlantError::new(Interrupted::Now(*raised)))
            }
            Err(panic) => resume_unwind(panic),
        })
    }

    fn time_s(&self) -> f64 {
        self.plant.time_s()
    }

    fn link_angles_rad(&self) -> LinkMotion<f64> {
        self.plant.link_angles_rad()
    }

    fn contact_force_n(&self) -> Vector2<f64> {
        self.plant.contact_force_n()
    }
}

/// Looks at the signals from time to time, and unwinds with the exception that one raises: a probe cannot return it.
struct Watch {
    count: u32,
    last_look: Instant,
}

impl Watch {
    fn count(&mut self) {
        self.count += 1;
        if self.count < STEPS_BETWEEN_CLOCKS {
            return;
        }
        self.count = 0;
        if self.last_look.elapsed() >= BETWEEN_LOOKS {
            self.last_look = Instant::now();
            if let Err(raised) = Python::attach(|py| py.check_signals()) {
                resume_unwind(Box::new(raised));
            }
        }
    }
}

impl Probe for Watch {
    fn step(&mut self, _: &dyn Step) {
        self.count();
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {
        self.count();
    }
}

/// Runs `work` on threads of its own, which exist in this process even after a fork, and returns its value. When a
/// signal raises an exception, returns that at once; `work` then runs on to its next call of the function that it is given.
///
/// # Errors
/// The exception of a signal, or `RuntimeError` if there are no threads.
pub fn on_threads<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> T + Send + 'static,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new().build();
    let pool = pool.map_err(|error| exception(&error))?;
    let (sender, mut receiver) = mpsc::channel();
    let ended = Arc::new(AtomicBool::new(false));
    let is_ended = ended.clone();
    pool.spawn(move || {
        let go_on = || {
            if is_ended.load(Ordering::Relaxed) {
                resume_unwind(Box::new("interrupted"));
            }
        };
        // Nobody waits for the value after an interrupt; a bug's panic has been printed.
        if let Ok(value) = catch_unwind(AssertUnwindSafe(|| work(&go_on))) {
            let _ = sender.send(value);
        }
    });
    loop {
        let waited = py.detach(move || (receiver.recv_timeout(BETWEEN_LOOKS), receiver));
        receiver = waited.1;
        match waited.0 {
            Ok(value) => return Ok(value),
            Err(RecvTimeoutError::Timeout) => py.check_signals().inspect_err(|_| {
                ended.store(true, Ordering::Relaxed);
            })?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the work has ended in a panic"));
            }
        }
    }
}
