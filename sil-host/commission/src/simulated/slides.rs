//! The slides of a simulated arm: its controller runs on the arm as it is.

use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::scenario::{BeltSettings, InitialState, RunSettings, Scenario};
use painleve_plant::simulation::Simulation;
use painleve_plant::{Controller, Event, Plant, Probe, State, Step};
use painleve_shared::counts::EncoderCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::{Arm, OutOfRange, Posture};
use strum::{EnumString, IntoStaticStr, VariantArray};

use super::SimulatedError;
use crate::identification::{Slid, SlideRig};

/// A mistake that a geometry cannot describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum GeometryMistake {
    /// The magnet of the elbow slips on its shaft by 0.6° in the last slide.
    SlippingMagnet,
    /// The second link is 6 % shorter than told, as if it were bent.
    BentLink,
    /// Link 1 is 5 % longer than told.
    WrongLength,
    /// The operator does not turn the elbow.
    SamePosture,
}

impl GeometryMistake {
    /// All mistakes.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Returns the name in the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Slip of the magnet, rad.
const SLIP_RAD: f64 = 0.0105;

/// Makes the plant of a scenario in its initial state.
pub type PlantOf<P> = fn(&Scenario) -> Result<P, OutOfRange>;

/// A simulated arm whose controller slides its tip.
pub struct SimulatedSlides<P = BuiltInPlant> {
    plant_of: PlantOf<P>,
    /// The arm as it is; its controller and model are those of each slide.
    actual: Scenario,
    mistake: Option<GeometryMistake>,
    slides: u32,
    /// Time that the arm moved, s.
    pub time_s: f64,
    /// Largest normal force from the first tick that tracks, N, in the steps of the plant: impacts count. Before, the arm
    /// rests on the belt with its weight and springs.
    pub largest_force_n: f64,
}

/// Largest normal force at the steps of a plant, N.
struct LargestForce(f64);

impl Probe for LargestForce {
    fn step(&mut self, step: &dyn Step) {
        let Self(largest_n) = self;
        *largest_n = largest_n.max(step.end().normal_force_n);
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

impl SimulatedSlides {
    /// Creates an arm that is as the plant of `actual`, except for the mistake.
    pub fn new(actual: Scenario, mistake: Option<GeometryMistake>) -> Self {
        Self::on(BuiltInPlant::new, actual, mistake)
    }
}

impl<P: Plant> SimulatedSlides<P> {
    /// Creates an arm on any plant; `actual`, except for the mistake, is what the plant of each slide is made from.
    pub fn on(
        plant_of: PlantOf<P>,
        mut actual: Scenario,
        mistake: Option<GeometryMistake>,
    ) -> Self {
        let told = actual.controller_configuration().arm;
        actual.arm_model = Some(told);
        let [length_1, length_2] = &mut actual.arm.link_length_m;
        match mistake {
            Some(GeometryMistake::BentLink) => *length_2 *= 0.94,
            Some(GeometryMistake::WrongLength) => *length_1 *= 1.05,
            _ => {}
        }
        Self {
            plant_of,
            actual,
            mistake,
            slides: 0,
            time_s: 0.0,
            largest_force_n: 0.0,
        }
    }

    /// Returns a frame as the encoders of an arm with this mistake give it.
    fn mistaken(&self, mut frame: SensorFrame, share: f64) -> SensorFrame {
        if self.mistake == Some(GeometryMistake::SlippingMagnet) && self.slides == 4 && share > 0.4
        {
            let scale = self.actual.converters.scales().encoders[1];
            let slipped = scale.reading(SLIP_RAD).0.wrapping_sub(scale.offset.0);
            let EncoderCounts(counts) = &mut frame.joints[1];
            *counts = counts.wrapping_add(slipped) & (scale.modulus() - 1);
        }
        frame
    }
}

impl<P: Plant> SlideRig for SimulatedSlides<P> {
    type Error = SimulatedError;

    fn slide(&mut self, scenario: &Scenario, posture: Posture) -> Result<Slid, SimulatedError> {
        self.slides += 1;
        let posture = match self.mistake {
            Some(GeometryMistake::SamePosture) => Posture::ElbowDown,
            _ => posture,
        };
        let arm = Arm::new(self.actual.arm)?;
        let start = arm
            .link_angles_on_belt_rad(0.0, posture)
            .unwrap_or_default();
        let [theta_1, theta_2] = start.to_array().map(f64::to_degrees);
        let slid = Scenario {
            initial: InitialState::at_rest(theta_1, theta_2),
            controller: scenario.controller.clone(),
            arm_model: scenario.arm_model.or(self.actual.arm_model),
            belt: BeltSettings {
                profile: scenario.belt.profile.clone(),
                ..self.actual.belt
            },
            run: RunSettings {
                seed: scenario.run.seed.wrapping_add(u64::from(self.slides)),
                ..scenario.run
            },
            ..self.actual.clone()
        };
        let mut simulation = Simulation::of((self.plant_of)(&slid)?, &slid)?;
        let mut controller = Controller::new(&slid.controller_configuration())?;
        let mut slide = Slid::default();
        let ticks = slid.run.ticks();
        for tick in 0..ticks {
            let frame = self.mistaken(simulation.sample(&mut ())?, tick as f64 / ticks as f64);
            let answer: ActuatorFrame = controller.tick(&frame);
            if answer.latched_fault().is_some() {
                break;
            }
            slide.push(frame, &answer);
            if slide.surprise(&slid).is_some() {
                break;
            }
            let mut force = LargestForce(0.0);
            simulation.advance(Some(&answer), &mut force)?;
            if !slide.ticks.is_empty() {
                self.largest_force_n = self.largest_force_n.max(force.0);
            }
        }
        self.time_s += slid.run.duration_s;
        Ok(slide)
    }
}
