//! A simulated arm to commission, and an operator who follows the instructions, to within half a degree.

mod built_in_mistake;
mod imperfect;
mod random_arm;
mod slides;
mod wiring;

use painleve_identify::Parameters;
use painleve_identify::geometry::encoder_rad;
use painleve_identify::parameters::Drawn;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::plant::PlantError;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_plant::simulation::Simulation;
use painleve_shared::counts::{EncoderCounts, EncoderScale, ForceCounts, TorqueCounts};
use painleve_shared::{ActuatorFrame, Arm, LinkMotion, OutOfRange};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub use built_in_mistake::BuiltInMistake;
pub use imperfect::imperfect;
pub use random_arm::random_arm;
pub use slides::{GeometryMistake, PlantOf, SimulatedSlides};
pub use wiring::Wiring;

use crate::identification::prior;
use crate::{OperatorTask, RawReadings, Rig};

/// Largest error of a held angle, degrees.
const HAND_DEG: f64 = 0.5;

/// Largest distance of the tip from the point below joint 1 when it is set down, m.
const HAND_M: f64 = 0.02;

/// Largest error of a resting force reading, counts.
const NOISE_COUNTS: i32 = 4;

/// Failure of a simulated arm.
#[derive(Debug, thiserror::Error)]
pub enum SimulatedError {
    /// The arm cannot be set down.
    #[error(transparent)]
    Range(#[from] OutOfRange),
    /// The simulation failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

/// A simulated arm with its operator.
pub struct SimulatedRig {
    /// The arm as it is.
    actual: Scenario,
    wiring: Wiring,
    encoders: [EncoderScale; 2],
    /// Errors of the encoders: those that the scenario's correction takes off.
    geometry: Parameters,
    /// Link angles at which the operator holds the arm, rad; `None` once it is set down.
    held_rad: Option<LinkMotion<f64>>,
    simulation: Option<Simulation>,
    stages_are_on: bool,
    generator: Pcg64,
}

impl SimulatedRig {
    /// Makes the arm that is described by `scenario`, except for its mistakes. Hands and noise follow `seed`.
    pub fn new(scenario: &Scenario, mistake: Option<BuiltInMistake>, seed: u64) -> Self {
        let mut wiring = Wiring::as_described(scenario);
        let mut actual = scenario.clone();
        if let Some(mistake) = mistake {
            mistake.build_into(&mut wiring, &mut actual);
        }
        let encoders = actual.converters.scales().encoders;
        // Counts of the simulation are those of perfectly mounted parts; the wiring changes them.
        actual.converters.encoder.offset_counts = [0; 2];
        actual.converters.mounting = Default::default();
        actual.belt.profile = BeltProfile::Constant { speed_m_s: 0.0 };
        actual.run.enable_at_s = 0.0;
        Self {
            actual,
            wiring,
            encoders: encoders.map(|it| EncoderScale {
                offset: EncoderCounts(0),
                ..it
            }),
            geometry: prior(scenario, &Drawn::default()).parameters,
            held_rad: Some(LinkMotion::zeros()),
            simulation: None,
            stages_are_on: false,
            generator: Pcg64::seed_from_u64(seed),
        }
    }

    fn draw(&mut self, most: f64) -> f64 {
        self.generator.random_range(-most..=most)
    }

    /// Sets the arm down at rest, with its tip within reach of the operator's eye below joint 1.
    fn set_down(&mut self, posture: painleve_shared::Posture) -> Result<(), SimulatedError> {
        let arm = Arm::new(self.actual.arm)?;
        let tip_t_m = self.draw(HAND_M);
        let start = arm.link_angles_on_belt_rad(tip_t_m, posture);
        let [theta_1, theta_2] = start.unwrap_or_default().to_array().map(f64::to_degrees);
        self.actual.initial = InitialState::at_rest(theta_1, theta_2);
        self.simulation = Some(Simulation::new(&self.actual)?);
        self.held_rad = None;
        Ok(())
    }

    fn readings(&mut self) -> Result<RawReadings, SimulatedError> {
        let (joints, forces) = match (&self.held_rad, &mut self.simulation) {
            (None, Some(simulation)) => {
                let frame = simulation.sample(&mut ())?;
                (frame.joints, [frame.tangential_force, frame.normal_force])
            }
            (held_rad, _) => {
                let held_rad = held_rad.unwrap_or_else(LinkMotion::zeros);
                let angles = held_rad.to_joints().to_array();
                let joints = [0, 1].map(|joint| self.encoders[joint].reading(angles[joint]));
                (joints, [ForceCounts(0); 2])
            }
        };
        let joints = [0, 1].map(|joint| {
            let scale = &self.encoders[joint];
            let counts = f64::from(scale.counts_from_zero(joints[joint]));
            let joint_rad = counts * scale.rad_per_count::<f64>();
            scale.reading(encoder_rad(&self.geometry, joint, joint_rad))
        });
        let mut noise = || ForceCounts(self.generator.random_range(-NOISE_COUNTS..=NOISE_COUNTS));
        let forces = forces.map(|it| ForceCounts(it.0 + noise().0));
        let force_scale = self.actual.converters.scales().force;
        Ok(RawReadings {
            joints: self.wiring.encoders(&self.encoders, joints),
            forces: self.wiring.forces(&force_scale, forces),
        })
    }
}

impl Rig for SimulatedRig {
    type Error = SimulatedError;

    fn instruct(&mut self, instruction: OperatorTask) -> Result<(), SimulatedError> {
        match instruction {
            OperatorTask::Hold { plumb_deg } => {
                let tilt_rad = self.actual.arm.belt_tilt_rad;
                let [one, two] =
                    plumb_deg.map(|it| (it + self.draw(HAND_DEG)).to_radians() - tilt_rad);
                self.held_rad = Some(LinkMotion::new(one, two));
            }
            OperatorTask::SetDown { posture } => self.set_down(posture)?,
            OperatorTask::Enable => self.stages_are_on = true,
        }
        Ok(())
    }

    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, SimulatedError> {
        let readings = self.readings()?;
        let torques = if self.stages_are_on {
            let torque_scale = self.actual.converters.scales().torque;
            self.wiring.torques(&torque_scale, torques)
        } else {
            [TorqueCounts(0); 2]
        };
        if let Some(simulation) = &mut self.simulation {
            let answer = ActuatorFrame {
                torques,
                ..ActuatorFrame::default()
            };
            simulation.advance(Some(&answer), &mut ())?;
        }
        Ok(readings)
    }
}
