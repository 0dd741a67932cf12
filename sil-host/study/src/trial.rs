//! One closed loop in this process, tick by tick: the same simulation and the same
//! controller as in a run of two processes, without its record.

use painleve_plant::Controller;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::{Plant, PlantError, Probe};
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::range::OutOfRange;
use painleve_shared::status::Fault;

/// A closed loop that can be stopped as soon as its outcome is known.
pub struct Trial<P = BuiltInPlant> {
    simulation: Simulation<P>,
    controller: Controller,
    answer: ActuatorFrame,
}

impl Trial {
    /// The scenario at its start.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn new(scenario: &Scenario) -> Result<Self, OutOfRange> {
        Self::of(Simulation::new(scenario)?, scenario)
    }
}

impl<P: Plant> Trial<P> {
    /// A simulation of any plant, with the scenario's controller.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn of(simulation: Simulation<P>, scenario: &Scenario) -> Result<Self, OutOfRange> {
        Ok(Self {
            simulation,
            controller: Controller::new(&scenario.controller_configuration())?,
            answer: ActuatorFrame::default(),
        })
    }

    /// Runs one control tick.
    ///
    /// # Errors
    /// [`PlantError`] if the plant cannot go on.
    pub fn tick(&mut self, probe: &mut impl Probe) -> Result<(), PlantError> {
        let sensor = self.simulation.sample(probe)?;
        let arrives = !self.simulation.sensor_frame_is_lost();
        if arrives {
            self.answer = self.controller.tick(&sensor);
        }
        let answer = arrives.then_some(&self.answer);
        self.simulation.advance(answer, probe)
    }

    /// Simulated time, s.
    pub fn time_s(&self) -> f64 {
        self.simulation.plant().time_s()
    }

    /// Where the tip is along the belt, m.
    pub fn tip_t_m(&self) -> f64 {
        self.simulation.plant().snapshot().tip_t_m
    }

    /// What the controller answered last.
    pub fn answer(&self) -> &ActuatorFrame {
        &self.answer
    }

    /// The fault that the controller has latched.
    pub fn fault(&self) -> Option<Fault> {
        self.answer.latched_fault()
    }
}
