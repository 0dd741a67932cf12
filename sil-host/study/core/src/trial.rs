//! A closed loop in this process, tick by tick, with the same simulation and the same
//! controller as a run of two processes, but without its record.

use painleve_plant::Controller;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::{Plant, PlantError, Probe};
use painleve_shared::LinkMotion;
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::range::OutOfRange;
use painleve_shared::settings::Settings;
use painleve_shared::status::Fault;

/// A closed loop that can be stopped as soon as its outcome is known.
#[derive(Clone)]
pub struct Trial<P = BuiltInPlant> {
    simulation: Simulation<P>,
    controller: Controller,
    answer: ActuatorFrame,
    /// Whether it answers the last tick, whose frame was not lost.
    is_answered: bool,
}

impl Trial {
    /// Creates the closed loop in the scenario's initial state.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        scenario.validate()?;
        Self::on(BuiltInPlant::new(scenario)?, scenario)
    }
}

impl<P: Plant> Trial<P> {
    /// Creates a closed loop of any plant, in its initial state, with the scenario's converters and
    /// controller.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn on(plant: P, scenario: &Scenario) -> Result<Self, OutOfRange> {
        Ok(Self {
            simulation: Simulation::of(plant, scenario)?,
            controller: Controller::new(&scenario.controller_configuration())?,
            answer: ActuatorFrame::default(),
            is_answered: false,
        })
    }

    /// Runs one control tick.
    ///
    /// # Errors
    /// [`PlantError`] if the plant cannot continue.
    pub fn tick(&mut self, probe: &mut dyn Probe) -> Result<(), PlantError> {
        let sensor = self.simulation.sample(probe)?;
        self.is_answered = !self.simulation.sensor_frame_is_lost();
        if self.is_answered {
            self.answer = self.controller.tick(&sensor);
        }
        let answer = self.is_answered.then_some(&self.answer);
        self.simulation.advance(answer, probe)
    }

    /// Pushes the tip with a force (f_t, f_n), N, during the next tick.
    pub fn push(&mut self, force_n: [f64; 2]) {
        self.simulation.push(force_n, 1);
    }

    /// Returns the simulation.
    pub fn simulation(&self) -> &Simulation<P> {
        &self.simulation
    }

    /// Returns the simulated time, s.
    pub fn time_s(&self) -> f64 {
        self.simulation.plant().time_s()
    }

    /// Returns the tip position along the belt, m.
    pub fn tip_t_m(&self) -> f64 {
        self.simulation.plant().snapshot().tip_t_m
    }

    /// Returns the link angles, rad.
    pub fn theta_rad(&self) -> LinkMotion<f64> {
        self.simulation.plant().snapshot().theta_rad
    }

    /// Returns the normal force on the tip, N.
    pub fn normal_force_n(&self) -> f64 {
        self.simulation.plant().snapshot().normal_force_n
    }

    /// Returns the answer to the last tick; `None` if its frame was lost.
    pub fn new_answer(&self) -> Option<&ActuatorFrame> {
        self.is_answered.then_some(&self.answer)
    }

    /// Returns the last answer of the controller.
    pub fn answer(&self) -> &ActuatorFrame {
        &self.answer
    }

    /// Returns the latched fault of the controller.
    pub fn fault(&self) -> Option<Fault> {
        self.answer.latched_fault()
    }
}
