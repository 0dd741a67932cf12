//! The compliant contact as it gets stiffer: the classical resolution of the paradox.
//!
//! Each row repeats, at one stiffness, what the rigid plant decides by rules: the inconsistent start x0,a, which the
//! rigid plant resolves by an impact without collision; a slide under torque; the end of the belt with p > 0
//! (Table II); and the belt speeds at which the arm keeps bouncing (Fig. 4). The last row is the rigid plant.

mod edge;
mod figure;
mod options;
mod outcome;
mod start;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::compliant::{
    CompliantArmOnBelt, ContactKind, NormalDamping, TipContact,
};
use painleve_plant::mechanics::effects::Effects;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::mechanics::{ArmOnBelt, BuiltInPlant, PlantParameters};
use painleve_plant::{Event, Plant, Probe, State, Step};
use painleve_shared::settings::Settings;
use painleve_shared::{Arm, JointTorque, OutOfRange, Pose, Posture};
use painleve_study_core::initial::Initial;
use painleve_study_core::tabular::Tabular;
use painleve_study_core::{Grid, Study, StudyError};
use serde::Serialize;

pub use options::Options;
pub use outcome::StiffnessOutcome;
pub use start::{FirstContact, Trace};

/// Normal force at which the bristles are as stiff as the contact, N.
const BRISTLE_FORCE_N: f64 = 10.0;
/// Mass for which the damping gives the rigid plant's restitution while the arm bounces, kg; from impact to impact
/// it differs.
const BOUNCING_MASS_KG: f64 = 0.2;
/// Local error of the integration.
const LOCAL_ERROR: f64 = 1e-7;
/// Time after which the arm slides quietly, and duration of the compared slide, s.
const QUIET_S: f64 = 30.0;
const SLIDE_TICKS: u32 = 100;

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct Stiffness {
    /// The plant.
    pub parameters: PlantParameters,
    /// Stiffnesses, N/m.
    pub stiffnesses_n_m: Vec<f64>,
    /// Belt speeds of the window, m/s, in ascending order.
    pub v_belt: Grid,
    /// Time before bouncing is observed, s.
    pub transient_s: f64,
    /// Time during which it is observed, s.
    pub record_s: f64,
}

/// One stiffness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Stiffness, N/m; `None` for the rigid plant.
    pub stiffness_n_m: Option<f64>,
    /// Impulse of the first contact from x0,a, normal, N·s.
    pub impulse_ns: f64,
    /// Duration of this contact, s.
    pub contact_s: f64,
    /// Largest normal force, N; `None` for an impulse.
    pub peak_force_n: Option<f64>,
    /// Normal velocity of the tip at the end of this contact, m/s.
    pub throw_m_s: f64,
    /// Slip at the end of this contact, m/s.
    pub slip_m_s: f64,
    /// Largest deviation of the angles from those of the rigid plant in 0.1 s of sliding, rad.
    pub deviation_rad: f64,
    /// Farthest tip position on which a static torque holds the pressed tip, elbow up, m.
    pub edge_up_m: f64,
    /// Farthest tip position on which a static torque holds the pressed tip, elbow down, m.
    pub edge_down_m: f64,
    /// Most negative belt speed at which the arm keeps bouncing from x0,a, m/s.
    pub bounces_from_m_s: Option<f64>,
    /// Least negative belt speed at which the arm keeps bouncing from x0,a, m/s.
    pub bounces_to_m_s: Option<f64>,
    /// The first contact from x0,a over time.
    #[serde(skip)]
    pub trace: Trace,
}

impl Stiffness {
    /// Creates the plant, compliant with this stiffness (N/m), or rigid.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter that is out of range.
    fn plant(
        &self,
        stiffness_n_m: Option<f64>,
        v_belt_m_s: f64,
        start: State,
        mass_kg: f64,
    ) -> Result<BuiltInPlant, OutOfRange> {
        let parameters = PlantParameters {
            belt: BeltProfile::Constant {
                speed_m_s: v_belt_m_s,
            },
            ..self.parameters
        };
        Ok(match stiffness_n_m {
            None => BuiltInPlant::Rigid(ArmOnBelt::new(&parameters, start)?),
            Some(stiffness_n_m) => {
                let contact = self.contact(stiffness_n_m, mass_kg)?;
                let effects = Effects::default();
                let plant = CompliantArmOnBelt::new(&parameters, &contact, &effects, start)?;
                BuiltInPlant::Compliant(plant)
            }
        })
    }

    /// Returns the mass that a tip which sticks at x0,a has towards the belt, kg.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter of the arm that is out of range.
    pub fn sticking_mass_kg(&self) -> Result<f64, OutOfRange> {
        let arm = Arm::new(self.parameters.arm)?;
        let start = Initial::A.state(&arm, 0, 0);
        let q = arm.inverse_tip_inertia_per_kg(&Pose::new(&theta(&start)));
        Ok(q.m11 / q.determinant())
    }

    /// Returns the contact of this stiffness. Its damping gives this mass the restitution of the rigid
    /// plant; its bristles are as stiff as its spring at 10 N.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter that is out of range.
    pub fn contact(&self, stiffness_n_m: f64, mass_kg: f64) -> Result<TipContact, OutOfRange> {
        let contact = TipContact {
            kind: ContactKind::Compliant,
            stiffness_n_m,
            normal: NormalDamping::Restitution {
                restitution: self.parameters.impact.restitution,
                mass_kg,
            },
            bristle_stiffness_per_m: stiffness_n_m / BRISTLE_FORCE_N,
            local_error: LOCAL_ERROR,
            ..Default::default()
        };
        contact
            .validate()
            .map_err(|error| error.inside("contact"))?;
        Ok(contact)
    }

    /// Returns the largest deviation from the rigid plant's angles in a slide under torque, rad.
    fn deviation_rad(&self, stiffness_n_m: Option<f64>) -> Result<f64, StudyError> {
        let speed_m_s = self.parameters.belt.speed_m_s(0.0);
        let failed = |source| self.failed(stiffness_n_m, source);
        let mass_kg = self.sticking_mass_kg()?;
        let mut quiet = self.plant(None, speed_m_s, self.start(Initial::D)?, mass_kg)?;
        quiet.advance(QUIET_S, &mut ()).map_err(failed)?;
        let now = quiet.snapshot();
        let [theta, rates] = [now.theta_rad, now.theta_dot_rad_s];
        let start = State::new(theta.first(), theta.second(), rates.first(), rates.second());
        let mut rigid = self.plant(None, speed_m_s, start, mass_kg)?;
        let mut soft = self.plant(stiffness_n_m, speed_m_s, start, mass_kg)?;
        let mut largest = 0.0_f64;
        for tick in 0..SLIDE_TICKS {
            let torque = JointTorque::new(0.002 * libm::sin(0.009 * f64::from(tick)), 0.0);
            for plant in [&mut rigid, &mut soft] {
                plant.command_torque(torque, 0.0);
                plant
                    .advance(f64::from(tick + 1) * 1e-3, &mut ())
                    .map_err(failed)?;
            }
            let angles = [&rigid, &soft].map(|plant| *plant.link_angles_rad().vector());
            largest = largest.max((angles[1] - angles[0]).norm());
        }
        Ok(largest)
    }

    /// Returns whether the arm still leaves the belt from x0,a after the transient.
    fn bounces(&self, stiffness_n_m: Option<f64>, v_belt_m_s: f64) -> Result<bool, StudyError> {
        let failed = |source| self.failed(stiffness_n_m, source);
        let Self {
            transient_s,
            record_s,
            ..
        } = *self;
        let mut plant = self.plant(
            stiffness_n_m,
            v_belt_m_s,
            self.start(Initial::A)?,
            BOUNCING_MASS_KG,
        )?;
        plant.advance(transient_s, &mut ()).map_err(failed)?;
        let mut flights = Flights::default();
        plant
            .advance(transient_s + record_s, &mut flights)
            .map_err(failed)?;
        Ok(flights.longest_s > 1e-3)
    }

    fn start(&self, initial: Initial) -> Result<State, OutOfRange> {
        Ok(initial.state(&Arm::new(self.parameters.arm)?, 0, 0))
    }

    fn failed(&self, stiffness_n_m: Option<f64>, source: painleve_plant::PlantError) -> StudyError {
        let row = stiffness_n_m.map_or("rigid".into(), |stiffness| format!("{stiffness} N/m"));
        StudyError::Plant { row, source }
    }
}

/// The longest flight.
#[derive(Clone, Copy, Debug, Default)]
struct Flights {
    since_s: Option<f64>,
    longest_s: f64,
}

impl Probe for Flights {
    fn step(&mut self, step: &dyn Step) {
        if step.mode().is_contact() {
            self.since_s = None;
        } else {
            let since_s = *self.since_s.get_or_insert(step.start_s());
            self.longest_s = self.longest_s.max(step.end_s() - since_s);
        }
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

impl Study for Stiffness {
    type Row = Row;

    fn len(&self) -> usize {
        self.stiffnesses_n_m.len() + 1
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let stiffness_n_m = self.stiffnesses_n_m.get(index).copied();
        let (first, trace) = self.first_contact(stiffness_n_m)?;
        let mut bouncing = Vec::new();
        for &v_belt_m_s in self.v_belt.values() {
            if self.bounces(stiffness_n_m, v_belt_m_s)? {
                bouncing.push(v_belt_m_s);
            }
        }
        let ends = bouncing.iter().copied();
        Ok(Row {
            stiffness_n_m,
            impulse_ns: first.impulse_ns,
            contact_s: first.contact_s,
            peak_force_n: first.peak_force_n,
            throw_m_s: first.throw_m_s,
            slip_m_s: first.slip_m_s,
            deviation_rad: self.deviation_rad(stiffness_n_m)?,
            edge_up_m: self.edge_m(stiffness_n_m, Posture::ElbowUp)?,
            edge_down_m: self.edge_m(stiffness_n_m, Posture::ElbowDown)?,
            bounces_from_m_s: ends.clone().reduce(f64::min),
            bounces_to_m_s: ends.reduce(f64::max),
            trace,
        })
    }
}

impl Tabular for Stiffness {
    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(BTreeMap::new())
    }
}
