//! The slides of a simulated arm: its controller runs on the arm as it is.

use nalgebra::Vector2;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::scenario::{BeltSettings, InitialState, RunSettings, Scenario};
use painleve_plant::simulation::Simulation;
use painleve_plant::{Controller, Event, Plant, Probe, State, Step};
use painleve_shared::counts::EncoderCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::{Arm, LinkMotion, OutOfRange, Posture};
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
    /// The encoders' select lines are exchanged.
    EncodersSwapped,
    /// The operator holds the tip beside the belt, where nothing is at its height.
    TipInAir,
    /// The operator sets the tip down on the frame beside the belt: it stands still, and is 4 mm lower.
    TipOnFrame,
    /// The operator lets the belt run in the other direction.
    BeltReversed,
}

impl GeometryMistake {
    /// All mistakes.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Returns the name in the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Depth below the belt of what is beside it, as a part of what the stretched arm reaches below the belt.
const FLOOR: f64 = 0.9;

/// Height of the belt over its frame, m.
const FRAME_M: f64 = 4e-3;

/// Slip of the magnet, rad.
const SLIP_RAD: f64 = 0.0105;

/// Time for which the tip rests on the belt before the drive is switched on, s. A simulated arm starts with a tip that does not
/// press yet: its weight makes the contact ring for some 25 ms.
const RESTS_S: f64 = 0.05;

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
            Some(GeometryMistake::TipInAir) => {
                let stretched_m = *length_1 + *length_2;
                actual.arm.height_m += FLOOR * (stretched_m - actual.arm.height_m);
            }
            Some(GeometryMistake::TipOnFrame) => actual.arm.height_m += FRAME_M,
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
        if self.mistake == Some(GeometryMistake::EncodersSwapped) {
            frame.joints.swap(0, 1);
        }
        frame
    }

    /// Returns the angles of the links with the tip where the operator sets it down, below joint 1, rad.
    fn start_rad(&self, posture: Posture) -> Result<LinkMotion<f64>, OutOfRange> {
        let arm = Arm::new(self.actual.arm)?;
        let height_m = match (self.mistake, &self.actual.arm_model) {
            (Some(GeometryMistake::TipInAir), Some(told)) => f64::from(told.height_m),
            _ => arm.height_m(),
        };
        let start = arm.link_angles_rad(&Vector2::new(0.0, -height_m), posture);
        Ok(start.unwrap_or_default())
    }

    /// Returns how the surface under the tip moves.
    fn profile(&self, told: &BeltProfile) -> BeltProfile {
        let constant = |speed_m_s| BeltProfile::Constant { speed_m_s };
        match self.mistake {
            Some(GeometryMistake::TipOnFrame) => constant(0.0),
            Some(GeometryMistake::BeltReversed) => constant(-told.speed_m_s(0.0)),
            _ => told.clone(),
        }
    }
}

impl<P: Plant> SlideRig for SimulatedSlides<P> {
    type Error = SimulatedError;

    fn slide(
        &mut self,
        _: usize,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Slid, SimulatedError> {
        self.slides += 1;
        let posture = match self.mistake {
            Some(GeometryMistake::SamePosture) => Posture::ElbowDown,
            _ => posture,
        };
        let [theta_1, theta_2] = self.start_rad(posture)?.to_array().map(f64::to_degrees);
        let slid = Scenario {
            initial: InitialState::at_rest(theta_1, theta_2),
            controller: scenario.controller.clone(),
            arm_model: scenario.arm_model.or(self.actual.arm_model),
            belt: BeltSettings {
                profile: self.profile(&scenario.belt.profile),
                ..self.actual.belt
            },
            run: RunSettings {
                seed: scenario.run.seed.wrapping_add(u64::from(self.slides)),
                enable_at_s: RESTS_S,
                duration_s: scenario.run.duration_s + RESTS_S,
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
