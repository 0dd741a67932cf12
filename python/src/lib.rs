//! Plant, controller and runs for Python. The package `painleve` exports them.

use painleve_firmware::telemetry::Telemetry;
use painleve_plant::closed_loop::{ClosedLoop, LoopError, Monitor};
use painleve_plant::controller_host::InProcess;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::sample::Sample;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::{Plant, Snapshot};
use painleve_record::RecordedTick;
use painleve_record::fields::{ESTIMATES, PLANT, Read, RecordField, TOPICS};
use painleve_record::replica::Replica;
use painleve_shared::JointTorque;
use painleve_shared::counts::{EncoderCounts, ForceCounts, Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};
use painleve_study::studies::{self, STUDIES};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Loads a scenario by name or as TOML text, with overrides.
fn load(scenario: &str, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Scenario> {
    let mut texts = Vec::new();
    if let Some(overrides) = overrides {
        for (key, value) in overrides {
            let value: String = value.str()?.extract()?;
            texts.push(format!(
                "{}={}",
                key.extract::<String>()?,
                toml_value(&value)
            ));
        }
    }
    let wrong =
        |error: painleve_plant::scenario::ScenarioError| PyValueError::new_err(error.to_string());
    if scenario.contains(['=', '\n']) {
        let scenario = Scenario::from_toml(scenario).map_err(wrong)?;
        scenario.with_overrides("scenario", &texts).map_err(wrong)
    } else {
        Scenario::load(scenario, &texts).map_err(wrong)
    }
}

/// Converts Python's truth values to TOML's.
fn toml_value(value: &str) -> &str {
    match value {
        "True" => "true",
        "False" => "false",
        other => other,
    }
}

fn failed(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
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
#[pyo3(signature = (scenario = "hybrid-elbow-down", overrides = None))]
fn run<'py>(
    py: Python<'py>,
    scenario: &str,
    overrides: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let scenario = load(scenario, overrides)?;
    let columns = py.detach(|| collect(&scenario))?;
    let run = PyDict::new(py);
    run.set_item("time_s", columns.time_s)?;
    for (name, _, column) in columns.columns {
        column.put(&name, &run)?;
    }
    Ok(run)
}

fn collect(scenario: &Scenario) -> PyResult<Columns> {
    let configuration = scenario.controller_configuration();
    let simulation = Simulation::new(scenario).map_err(failed)?;
    let host = InProcess::new(&configuration).map_err(failed)?;
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
        closed_loop.tick(&mut columns).map_err(failed)?;
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

/// The arm on its belt without converters: torques in N·m, one control tick per step.
#[pyclass(name = "Plant", unsendable)]
struct PyPlant {
    plant: BuiltInPlant,
    tick_hz: f64,
    ticks: u64,
}

#[pymethods]
impl PyPlant {
    #[new]
    #[pyo3(signature = (scenario = "hybrid-elbow-down", overrides = None))]
    fn new(scenario: &str, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let scenario = load(scenario, overrides)?;
        Ok(Self {
            plant: BuiltInPlant::new(&scenario).map_err(failed)?,
            tick_hz: scenario.run.tick_hz.into(),
            ticks: 0,
        })
    }

    /// Applies torques u1, u2 in N·m for one tick and returns the state at its end.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        u1_nm: f64,
        u2_nm: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        if !(u1_nm.is_finite() && u2_nm.is_finite()) {
            return Err(PyValueError::new_err("torques are finite numbers, N·m"));
        }
        self.plant
            .command_torque(JointTorque::new(u1_nm, u2_nm), 0.0);
        self.ticks += 1;
        let until_s = self.ticks as f64 / self.tick_hz;
        self.plant.advance(until_s, &mut ()).map_err(failed)?;
        self.state(py)
    }

    /// The state: `time_s` and the fields of the topic `plant`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        state(py, self.plant.snapshot())
    }
}

/// A sensor frame: tick, sequence, joints 1 and 2, normal and tangential force, inputs; counts.
type Sensor = (u32, u32, u32, u32, i32, i32, u32);
/// An actuator frame: tick, sequence, u1, u2, reference and estimated tip in µm, state, fault, flags.
type Actuator = (u32, u32, i32, i32, i32, i32, u8, u8, u16);

/// The plant with its converters, as the controller sees it.
#[pyclass(name = "Simulation", unsendable)]
struct PySimulation(Simulation);

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (scenario = "hybrid-elbow-down", overrides = None))]
    fn new(scenario: &str, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let scenario = load(scenario, overrides)?;
        Ok(Self(Simulation::new(&scenario).map_err(failed)?))
    }

    /// Reads the sensors, once a tick: the frame, and whether the link loses it.
    fn sample(&mut self) -> PyResult<(Sensor, bool)> {
        let frame = self.0.sample(&mut ()).map_err(failed)?;
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
        Ok((sensor, self.0.sensor_frame_is_lost()))
    }

    /// Passes the controller's answer, or `None`, to the torque stages and advances to the next tick.
    #[pyo3(signature = (answer))]
    fn advance(&mut self, answer: Option<Actuator>) -> PyResult<()> {
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
        self.0.advance(frame.as_ref(), &mut ()).map_err(failed)
    }

    /// The state: `time_s` and the fields of the topic `plant`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        state(py, self.0.plant().snapshot())
    }
}

/// The firmware's controller.
#[pyclass(name = "Controller", unsendable)]
struct PyController {
    controller: painleve_plant::Controller,
    telemetry: Telemetry,
}

#[pymethods]
impl PyController {
    #[new]
    #[pyo3(signature = (scenario = "hybrid-elbow-down", overrides = None))]
    fn new(scenario: &str, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let configuration = load(scenario, overrides)?.controller_configuration();
        Ok(Self {
            controller: painleve_plant::Controller::new(&configuration).map_err(failed)?,
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
        let answer = self
            .controller
            .tick_with_telemetry(&frame, &mut self.telemetry);
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

/// Computes a study on all cores and returns the JSON object of `painleve study NAME --json` as text; `arguments` are
/// that command's options.
#[pyfunction]
fn study(py: Python<'_>, name: &str, arguments: Vec<String>) -> PyResult<String> {
    let unknown = || {
        let names: Vec<&str> = STUDIES.iter().map(|entry| entry.name).collect();
        PyValueError::new_err(format!("unknown study '{name}': {}", names.join(", ")))
    };
    let entry = studies::find(name).ok_or_else(unknown)?;
    let command = entry.command().no_binary_name(true);
    let options = command
        .try_get_matches_from(arguments)
        .and_then(|matches| (entry.read)(&matches))
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    let study = options
        .study()
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    let outcome = py
        .detach(|| study.compute(&|| ()))
        .map_err(failed)?;
    outcome.json().map_err(failed)
}

/// The compiled part of the package.
#[pymodule]
fn _painleve(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(study, module)?)?;
    module.add_class::<PyPlant>()?;
    module.add_class::<PySimulation>()?;
    module.add_class::<PyController>()
}
