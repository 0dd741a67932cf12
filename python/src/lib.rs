//! Plant, controller and runs for Python. The package `painleve` exports them.

use painleve_plant::closed_loop::{ClosedLoop, LoopError, Monitor};
use painleve_plant::controller_host::InProcess;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::telemetry::Telemetry;
use painleve_plant::{Plant, Snapshot};
use painleve_record::RecordedTick;
use painleve_record::fields::{ESTIMATES, PLANT, Read, RecordField, TOPICS};
use painleve_record::replica::Replica;
use painleve_shared::JointTorque;
use painleve_shared::counts::{EncoderCounts, ForceCounts, Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_shared::range::OutOfRange;
use painleve_study::STUDIES;
use painleve_study_core::StudyError;
use painleve_study_core::catalogue::{CatalogueEntry, Progress};
use pyo3::PyClass;
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::False;
use pyo3::types::{PyDict, PyString};

mod interruptible;
mod values;

use interruptible::{Interruptible, exception};

/// What a scenario is loaded from.
enum Source {
    /// The name of a built-in one, a path that ends in `.toml`, or TOML text.
    Text(String),
    /// An object with a path, such as one of `pathlib`.
    Path(String),
}

impl Default for Source {
    fn default() -> Self {
        Self::Text("hybrid-elbow-down".into())
    }
}

impl<'py> FromPyObject<'_, 'py> for Source {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(text) = object.cast::<PyString>() {
            Ok(Self::Text(text.extract()?))
        } else if object.hasattr("__fspath__")? {
            let path: String = object.call_method0("__fspath__")?.extract()?;
            // Never the name of a built-in one.
            let is_name = !path.contains('/');
            Ok(Self::Path(if is_name { format!("./{path}") } else { path }))
        } else {
            Err(PyTypeError::new_err(format!(
                "a scenario is a name, a path or a TOML text, not of type {}",
                object.get_type().name()?
            )))
        }
    }
}

/// Loads a scenario with overrides.
fn load(source: &Source, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Scenario> {
    let overrides = overrides.map_or(Ok(Vec::new()), values::overrides)?;
    let (Source::Text(scenario) | Source::Path(scenario)) = source;
    let is_path = matches!(source, Source::Path(_))
        || scenario.ends_with(".toml") && !scenario.contains('\n');
    let loaded = if !is_path && (scenario.is_empty() || scenario.contains(['=', '\n'])) {
        Scenario::from_toml(scenario)
            .and_then(|scenario| scenario.with_overrides("scenario", &overrides))
    } else {
        Scenario::load(scenario, &overrides)
    };
    loaded.map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Returns the plant of a scenario at its start.
fn plant(scenario: &Scenario) -> PyResult<Interruptible> {
    let mut plant = BuiltInPlant::new(scenario).map_err(out_of_range)?;
    // Until it first advances, a plant only guesses the mode of a tip on the belt.
    let decided = plant.advance(0.0, &mut ());
    decided.map_err(|error| exception(&error))?;
    Ok(Interruptible::new(plant))
}

fn out_of_range(error: OutOfRange) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Values of one quantity, one for each tick.
enum Column {
    Numbers(Vec<f64>),
    Whole(Vec<i64>),
    Text(Vec<&'static str>),
    Truth(Vec<bool>),
}

impl Column {
    fn new(read: Read) -> Self {
        match read {
            Read::Number(_) | Read::Single(_) => Self::Numbers(Vec::new()),
            Read::Whole(_) => Self::Whole(Vec::new()),
            Read::Text(_) => Self::Text(Vec::new()),
            Read::Truth(_) => Self::Truth(Vec::new()),
        }
    }

    fn push(&mut self, read: Read, tick: &RecordedTick<'_>) {
        match (self, read) {
            (Self::Numbers(values), Read::Number(read)) => values.push(read(tick)),
            (Self::Numbers(values), Read::Single(read)) => values.push(read(tick).into()),
            (Self::Whole(values), Read::Whole(read)) => values.push(read(tick)),
            (Self::Text(values), Read::Text(read)) => values.push(read(tick)),
            (Self::Truth(values), Read::Truth(read)) => values.push(read(tick)),
            _ => unreachable!("a column has one type"),
        }
    }

    fn put(self, name: &str, to: &Bound<'_, PyDict>) -> PyResult<()> {
        match self {
            Self::Numbers(values) => to.set_item(name, values),
            Self::Whole(values) => to.set_item(name, values),
            Self::Text(values) => to.set_item(name, values),
            Self::Truth(values) => to.set_item(name, values),
        }
    }
}

/// Collects every quantity of a run.
struct Columns {
    replica: Option<Replica>,
    time_s: Vec<f64>,
    columns: Vec<(String, Read, Column)>,
}

impl Monitor for Columns {
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        if let Some(replica) = &mut self.replica {
            replica.follow(sample);
        }
        let tick = RecordedTick {
            sample,
            estimates: self.replica.as_ref().map(Replica::telemetry),
        };
        self.time_s.push(sample.plant.time_s);
        for (_, read, column) in &mut self.columns {
            column.push(*read, &tick);
        }
        Ok(())
    }
}

/// Runs a scenario to its end and returns its quantities as columns: `time_s` and `topic.field`, as
/// `painleve run --csv` names them. Unknown numbers are NaN.
#[pyfunction]
#[pyo3(
    signature = (scenario = Source::default(), overrides = None),
    text_signature = "(scenario='hybrid-elbow-down', overrides=None)"
)]
fn run<'py>(
    py: Python<'py>,
    scenario: Source,
    overrides: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let scenario = load(&scenario, overrides)?;
    let columns = py.detach(|| collect(&scenario))?;
    let run = PyDict::new(py);
    run.set_item("time_s", columns.time_s)?;
    for (name, _, column) in columns.columns {
        // A column of a long run takes some ten milliseconds.
        py.check_signals()?;
        column.put(&name, &run)?;
    }
    Ok(run)
}

fn collect(scenario: &Scenario) -> PyResult<Columns> {
    let configuration = scenario.controller_configuration();
    let simulation = Simulation::of(plant(scenario)?, scenario).map_err(out_of_range)?;
    let host = InProcess::new(&configuration).map_err(out_of_range)?;
    let column = |topic: &str, field: &RecordField| {
        let name = format!("{topic}.{}", field.name);
        (name, field.read, Column::new(field.read))
    };
    let columns = TOPICS
        .iter()
        .flat_map(|topic| topic.fields.iter().map(|field| column(topic.name, field)));
    let mut columns = Columns {
        replica: Replica::new(&configuration),
        time_s: Vec::new(),
        columns: columns.collect(),
    };
    let mut closed_loop = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        closed_loop
            .tick(&mut columns)
            .map_err(|error| exception(&error))?;
    }
    Ok(columns)
}

fn put_finite(values: &Bound<'_, PyDict>, name: &str, value: f64) -> PyResult<()> {
    if value.is_finite() {
        values.set_item(name, value)?;
    }
    Ok(())
}

/// Returns quantities at one tick; omits numbers that are not finite.
fn quantities<'py>(
    py: Python<'py>,
    fields: &[RecordField],
    tick: &RecordedTick<'_>,
) -> PyResult<Bound<'py, PyDict>> {
    let values = PyDict::new(py);
    for RecordField { name, read, .. } in fields {
        match read {
            Read::Number(read) => put_finite(&values, name, read(tick))?,
            Read::Single(read) => put_finite(&values, name, read(tick).into())?,
            Read::Whole(read) => values.set_item(name, read(tick))?,
            Read::Text(read) => values.set_item(name, read(tick))?,
            Read::Truth(read) => values.set_item(name, read(tick))?,
        }
    }
    Ok(values)
}

/// Returns the plant's state: `time_s` and the fields of the topic `plant`.
fn state<'py>(py: Python<'py>, plant: Snapshot) -> PyResult<Bound<'py, PyDict>> {
    let sample = Sample {
        plant,
        reference_tip_t_m: f64::NAN,
        ..Sample::default()
    };
    let tick = RecordedTick {
        sample: &sample,
        estimates: None,
    };
    let values = quantities(py, PLANT.fields, &tick)?;
    values.set_item("time_s", plant.time_s)?;
    Ok(values)
}

/// Borrows an object for a call.
///
/// # Errors
/// `RuntimeError` while another call uses it.
fn idle<'py, T: PyClass<Frozen = False>>(object: &Bound<'py, T>) -> PyResult<PyRefMut<'py, T>> {
    let name = T::NAME.to_lowercase();
    object.try_borrow_mut().map_err(|_| {
        PyRuntimeError::new_err(format!(
            "another call is using this {name}, perhaps on another thread; give each thread its own"
        ))
    })
}

/// The arm on its belt without converters: torques in N·m, one control tick per step.
#[pyclass(name = "Plant", module = "painleve")]
struct PyPlant {
    plant: Interruptible,
    tick_hz: u32,
    ticks: u64,
}

#[pymethods]
impl PyPlant {
    #[new]
    #[pyo3(
        signature = (scenario = Source::default(), overrides = None),
        text_signature = "(scenario='hybrid-elbow-down', overrides=None)"
    )]
    fn new(scenario: Source, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let scenario = load(&scenario, overrides)?;
        Ok(Self {
            plant: plant(&scenario)?,
            tick_hz: scenario.run.tick_hz,
            ticks: 0,
        })
    }

    /// Control ticks a second.
    #[getter]
    fn tick_hz(slf: &Bound<'_, Self>) -> PyResult<u32> {
        Ok(idle(slf)?.tick_hz)
    }

    /// Applies torques u1, u2 in N·m for one tick and returns the state at its end.
    fn step<'py>(slf: &Bound<'py, Self>, u1_nm: f64, u2_nm: f64) -> PyResult<Bound<'py, PyDict>> {
        let torque_nm = JointTorque::new(u1_nm, u2_nm);
        if !(u1_nm.is_finite() && u2_nm.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "torques {u1_nm}, {u2_nm} N·m: both are finite numbers"
            )));
        }
        let mut plant = idle(slf)?;
        let this = &mut *plant;
        let until_s = (this.ticks + 1) as f64 / f64::from(this.tick_hz);
        slf.py()
            .detach(|| {
                this.plant.command_torque(torque_nm, 0.0);
                this.plant.advance(until_s, &mut ())
            })
            .map_err(|error| exception(&error))?;
        this.ticks += 1;
        state(slf.py(), this.plant.snapshot())
    }

    /// The state: `time_s` and the fields of the topic `plant`.
    fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        state(slf.py(), idle(slf)?.plant.snapshot())
    }
}

/// A sensor frame: tick, sequence, joints 1 and 2, normal and tangential force, inputs; counts.
type Sensor = (u32, u32, u32, u32, i32, i32, u32);
/// An actuator frame: tick, sequence, u1, u2, reference and estimated tip in µm, state, fault, flags.
type Actuator = (u32, u32, i32, i32, i32, i32, u8, u8, u16);

/// The plant with its converters, as the controller sees it.
#[pyclass(name = "Simulation", module = "painleve")]
struct PySimulation {
    simulation: Simulation<Interruptible>,
    /// Whether this tick has been sampled.
    is_sampled: bool,
}

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(
        signature = (scenario = Source::default(), overrides = None),
        text_signature = "(scenario='hybrid-elbow-down', overrides=None)"
    )]
    fn new(scenario: Source, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let scenario = load(&scenario, overrides)?;
        let simulation = Simulation::of(plant(&scenario)?, &scenario);
        Ok(Self {
            simulation: simulation.map_err(out_of_range)?,
            is_sampled: false,
        })
    }

    /// Reads the sensors, once a tick: the frame, and whether the link loses it.
    fn sample(slf: &Bound<'_, Self>) -> PyResult<(Sensor, bool)> {
        let mut simulation = idle(slf)?;
        let this = &mut *simulation;
        if this.is_sampled {
            return Err(PyRuntimeError::new_err(
                "advance() comes before the next sample()",
            ));
        }
        let frame = slf
            .py()
            .detach(|| this.simulation.sample(&mut ()))
            .map_err(|error| exception(&error))?;
        this.is_sampled = true;
        let [joint_1, joint_2] = frame.joints.map(|joint| joint.0);
        let sensor = (
            frame.tick,
            frame.sequence,
            joint_1,
            joint_2,
            frame.normal_force.0,
            frame.tangential_force.0,
            frame.inputs.0,
        );
        Ok((sensor, this.simulation.sensor_frame_is_lost()))
    }

    /// Passes the controller's answer, or `None`, to the torque stages and advances to the next tick. An answer to another tick,
    /// or with an unknown state or fault, raises `ValueError`.
    #[pyo3(signature = (answer))]
    fn advance(slf: &Bound<'_, Self>, answer: Option<Actuator>) -> PyResult<()> {
        let mut simulation = idle(slf)?;
        let this = &mut *simulation;
        let frame = answer.map(
            |(tick, sequence, u1, u2, reference_um, estimated_um, state, fault, flags)| {
                ActuatorFrame {
                    tick,
                    sequence,
                    torques: [TorqueCounts(u1), TorqueCounts(u2)],
                    reference_tip: Micrometres(reference_um),
                    estimated_tip: Micrometres(estimated_um),
                    state,
                    fault,
                    flags: StatusFlags(flags),
                }
            },
        );
        if !this.is_sampled {
            return Err(PyRuntimeError::new_err("sample() comes before advance()"));
        }
        if let Some(frame) = &frame {
            let refused = this.simulation.check_answer(frame);
            refused.map_err(|error| PyValueError::new_err(error.to_string()))?;
        }
        this.is_sampled = false;
        slf.py()
            .detach(|| this.simulation.advance(frame.as_ref(), &mut ()))
            .map_err(|error| exception(&error))
    }

    /// The state: `time_s` and the fields of the topic `plant`.
    fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        state(slf.py(), idle(slf)?.simulation.plant().snapshot())
    }
}

/// The firmware's controller.
#[pyclass(name = "Controller", module = "painleve")]
struct PyController {
    controller: painleve_plant::Controller,
    telemetry: Telemetry,
}

#[pymethods]
impl PyController {
    #[new]
    #[pyo3(
        signature = (scenario = Source::default(), overrides = None),
        text_signature = "(scenario='hybrid-elbow-down', overrides=None)"
    )]
    fn new(scenario: Source, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let configuration = load(&scenario, overrides)?.controller_configuration();
        Ok(Self {
            controller: painleve_plant::Controller::new(&configuration).map_err(out_of_range)?,
            telemetry: Default::default(),
        })
    }

    /// Answers a sensor frame.
    fn tick(&mut self, sensor: Sensor) -> Actuator {
        let (tick, sequence, joint_1, joint_2, normal, tangential, inputs) = sensor;
        let frame = SensorFrame {
            tick,
            sequence,
            joints: [EncoderCounts(joint_1), EncoderCounts(joint_2)],
            normal_force: ForceCounts(normal),
            tangential_force: ForceCounts(tangential),
            inputs: DigitalInputs(inputs),
        };
        let answer = self.telemetry.tick(&mut self.controller, &frame);
        let [u1, u2] = answer.torques.map(|torque| torque.0);
        (
            answer.tick,
            answer.sequence,
            u1,
            u2,
            answer.reference_tip.0,
            answer.estimated_tip.0,
            answer.state,
            answer.fault,
            answer.flags.0,
        )
    }

    /// The controller's estimates: the fields of the topic `estimates`.
    fn telemetry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tick = RecordedTick {
            sample: &Sample::default(),
            estimates: Some(&self.telemetry),
        };
        quantities(py, ESTIMATES.fields, &tick)
    }
}

/// Computes a study on all cores and returns the object that `painleve study NAME --json` prints.
///
/// Options are those of that command, except those of its output and `threads`, with `_` for `-`: a number or a text, a list
/// or an array for values separated by commas, True for an option without a value, and for `set` a dictionary of keys or a list
/// of texts `key=value`::
///
///     painleve.study("bifurcation", mu=0.6, v_belt="-0.6:-0.2:0.1", initial=["a", "d"], set={"belt.friction": 0.5})
#[pyfunction]
#[pyo3(signature = (name, **options))]
fn study<'py>(
    py: Python<'py>,
    name: &str,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let unknown = || {
        let names: Vec<&str> = STUDIES.iter().map(|entry| entry.name).collect();
        PyValueError::new_err(format!("unknown study '{name}': {}", names.join(", ")))
    };
    let entry = painleve_study::find(name).ok_or_else(unknown)?;
    let arguments = options.map_or(Ok(Vec::new()), values::arguments)?;
    let json = interruptible::on_threads(py, |go_on| study_json(entry, arguments, go_on))??;
    py.import("json")?.call_method1("loads", (json,))
}

/// Computes a study, given the arguments of its command, and returns its JSON object as text.
fn study_json(
    entry: &CatalogueEntry,
    arguments: Vec<String>,
    progress: Progress<'_>,
) -> PyResult<String> {
    let mistake = |error: &dyn std::fmt::Display| {
        // The command's own usage and help follow an empty line.
        let message = error.to_string();
        let message = message.split("\n\n").next().unwrap_or_default();
        let message = message.strip_prefix("error: ").unwrap_or(message);
        PyValueError::new_err(values::in_python_names(message))
    };
    let command = entry.command().no_binary_name(true);
    let options = command
        .try_get_matches_from(arguments)
        .and_then(|matches| (entry.read)(&matches))
        .map_err(|error| mistake(&error))?;
    let study = options.study().map_err(|error| mistake(&error))?;
    let outcome = study.compute(progress).map_err(|error| match &error {
        StudyError::Plant { .. } | StudyError::Loop { .. } => exception(&error),
        // Some options are checked only with the rows.
        _ => mistake(&error),
    })?;
    outcome.json().map_err(|error| exception(&error))
}

/// The compiled part of the package.
#[pymodule]
fn _painleve(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(study, module)?)?;
    module.add_class::<PyPlant>()?;
    module.add_class::<PySimulation>()?;
    module.add_class::<PyController>()
}
