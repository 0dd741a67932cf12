//! The plant with a compliant contact: the same arm and belt as the rigid plant, but with a spring
//! and a damper at the tip, friction by bristles ([`contact`]), and the enabled
//! [`effects`](super::effects).
//!
//! It has no events and no impacts: a collision is a short stretch of ordinary motion. The
//! situation that the rigid plant calls Painlevé's paradox is an instability of the contact, which
//! ends when the tip stops slipping or lifts off. The steps have error control
//! ([`rosenbrock`](super::rosenbrock)) and work at any stiffness.

pub mod contact;
mod equations;
mod step;

use nalgebra::{Const, DimMin, SVector, ToTypenum, Vector2};
use painleve_shared::settings::Settings;
use painleve_shared::{Arm, ArmParameters, JointMotion, JointTorque, LinkMotion, OutOfRange, Slip};

pub use contact::{CompliantContact, ContactKind, NormalDamping, TipContact};
use equations::{CompliantMotion, FULL, PLAIN, WITH_DRIVES};
use step::CompliantStep;

use super::belt::BeltSettings;
use super::effects::Effects;
use super::effects::gear::EncoderSide;
use super::moving_belt::MovingBelt;
use super::rosenbrock::Linearised;
use super::step_budget::StepBudget;
use super::torque::TorqueSegment;
use super::{InitialState, MotionError, PlantParameters};
use crate::plant::{ContactMode, Event, Plant, PlantError, Probe, Snapshot, State};

/// Longest step, s. A touch that is much shorter can fall between two evaluations of the gap.
const MAXIMUM_STEP_S: f64 = 2e-3;
/// Slip velocity below which a touching tip sticks, m/s.
const STICK_M_S: f64 = 1e-3;

/// The simulated arm on a compliant contact.
#[derive(Clone, Debug)]
pub struct CompliantArmOnBelt {
    arm: Arm<f64>,
    /// The arm with the payload that it will pick up.
    loaded_arm: Option<Box<Arm<f64>>>,
    belt: MovingBelt,
    friction: f64,
    contact: CompliantContact,
    effects: Effects,
    /// Coulomb friction of the joints that the controller knows, N·m.
    joint_friction_nm: [f64; 2],
    local_error: f64,
    torque: TorqueSegment,
    time_s: f64,
    state: SVector<f64, FULL>,
    /// Whether the states of the drives are integrated.
    has_drives: bool,
    mode: ContactMode,
    step_size_s: f64,
    budget: StepBudget,
}

impl CompliantArmOnBelt {
    /// Gives the belt this friction and speed from now on.
    pub fn set_belt(&mut self, belt: &BeltSettings) {
        self.friction = belt.friction;
        self.belt.replace(self.time_s, &belt.profile);
    }

    /// Creates a plant at time zero with zero torque. A tip at most 0.1 mm above the belt or 1 mm
    /// inside it is first moved onto the belt's surface, without force of the contact's spring.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter that is out of range.
    pub fn new(
        parameters: &PlantParameters,
        contact: &TipContact,
        effects: &Effects,
        initial: State,
    ) -> Result<Self, OutOfRange> {
        let arm = Arm::new(parameters.arm)?;
        parameters.validate()?;
        let inside = |group| move |error: OutOfRange| error.inside(group);
        contact.validate().map_err(inside("contact"))?;
        effects.validate().map_err(inside("effects"))?;
        InitialState::from(&initial)
            .validate()
            .map_err(inside("initial"))?;
        let loaded = ArmParameters {
            tip_mass_kg: parameters.arm.tip_mass_kg + effects.payload.mass_kg,
            ..parameters.arm
        };
        let loaded = Arm::new(loaded)?;
        let mut plant = Self {
            arm,
            loaded_arm: effects.payload.is_on().then(|| Box::new(loaded)),
            belt: MovingBelt::new(&parameters.belt),
            friction: parameters.friction,
            contact: CompliantContact::new(contact),
            effects: effects.clone(),
            joint_friction_nm: parameters.arm.coulomb_friction_nm,
            local_error: contact.local_error,
            torque: TorqueSegment::constant(JointTorque::zeros()),
            time_s: 0.0,
            state: SVector::zeros(),
            has_drives: effects.gear.elastic
                || effects.joints.is_on()
                || parameters.arm.coulomb_friction_nm != [0.0; 2],
            mode: ContactMode::Flight,
            step_size_s: 1e-4,
            budget: StepBudget::default(),
        };
        let motion = plant.motion().rigid(0.0, 0.0);
        let on_belt = motion.start_on_belt(&initial, |tip_t_m| effects.surface.at(0.0, tip_t_m))?;
        let start = on_belt.unwrap_or(initial);
        if on_belt.is_some() {
            let slip_m_s = motion.relative_velocity_m_s(0.0, &start).x;
            plant.mode = ContactMode::slide(Slip::of(slip_m_s));
        }
        let rotors = [start[0], start[1] - start[0], start[2], start[3] - start[2]];
        plant.state.fixed_rows_mut::<4>(0).copy_from(&start);
        plant.state.fixed_rows_mut::<4>(5).copy_from_slice(&rotors);
        Ok(plant)
    }

    /// Returns the present state of the arm.
    pub fn state(&self) -> State {
        self.state.fixed_rows::<4>(0).into_owned()
    }

    /// Integrates to time `until_s`.
    ///
    /// # Errors
    /// [`MotionError`]; the plant stays at the time of the error.
    pub fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), MotionError> {
        while self.time_s < until_s {
            let payload = &self.effects.payload;
            if self.time_s >= payload.at_s
                && let Some(loaded) = self.loaded_arm.take()
            {
                self.arm = *loaded;
            }
            let corner = self
                .belt
                .next_corner_s(self.time_s)
                .min(self.effects.push.next_corner_s(self.time_s))
                .min(payload.next_corner_s(self.time_s))
                .min(until_s);
            if self.effects.hanging_belt.is_on() {
                self.advance_smoothly::<FULL>(corner, probe)?;
            } else if self.has_drives {
                self.advance_smoothly::<WITH_DRIVES>(corner, probe)?;
            } else {
                self.advance_smoothly::<PLAIN>(corner, probe)?;
            }
            self.belt.jump(self.time_s);
        }
        Ok(())
    }

    fn motion(&self) -> CompliantMotion<'_> {
        CompliantMotion {
            arm: &self.arm,
            belt: &self.belt,
            friction: self.friction,
            contact: &self.contact,
            effects: &self.effects,
            joint_friction_nm: self.joint_friction_nm,
            torque: self.torque,
        }
    }

    /// Integrates the first `N` states to a time before which torque, belt and pushes are smooth.
    fn advance_smoothly<const N: usize>(
        &mut self,
        until_s: f64,
        probe: &mut dyn Probe,
    ) -> Result<(), MotionError>
    where
        Const<N>: DimMin<Const<N>, Output = Const<N>> + ToTypenum,
    {
        while self.time_s < until_s {
            let remaining = until_s - self.time_s;
            if remaining <= 4.0 * f64::EPSILON * until_s.abs() {
                self.time_s = until_s;
                break;
            }
            self.budget.spend(self.time_s)?;
            let motion = self.motion();
            let (start_s, start) = (self.time_s, self.state);
            let mut x = SVector::<f64, N>::zeros();
            x.copy_from_slice(&start.as_slice()[..N]);
            let linearised = Linearised::new(&motion, start_s, &x);
            let mut size = self.step_size_s.min(MAXIMUM_STEP_S);
            let (end, taken) = loop {
                let tried = size.min(remaining);
                let step = linearised.step(&motion, tried, self.local_error);
                let next = tried * step.growth();
                if step.error <= 1.0 {
                    // A truncated step does not limit the next one.
                    size = if tried < size { size.max(next) } else { next };
                    break (step.end, tried);
                }
                size = next;
                if start_s + size == start_s {
                    return Err(MotionError::StepVanished {
                        time_s: start_s,
                        mode: self.mode,
                    });
                }
            };
            self.step_size_s = size;
            self.time_s = if taken == remaining {
                until_s
            } else {
                start_s + taken
            };
            self.state.as_mut_slice()[..N].copy_from_slice(end.as_slice());
            let mode = self.present_mode();
            let (end_s, end) = (self.time_s, self.state);
            probe.step(&CompliantStep {
                motion: self.motion(),
                mode,
                start: (start_s, &start),
                end: (end_s, &end),
            });
            let from = core::mem::replace(&mut self.mode, mode);
            if from != mode {
                let arm_state = self.state();
                probe.event(end_s, Event::ModeChange { from, to: mode }, &arm_state);
            }
        }
        Ok(())
    }

    /// Returns the present contact mode: whether there is a contact force, and the direction of
    /// slip.
    fn present_mode(&self) -> ContactMode {
        let touch = self.motion().touch_at(self.time_s, &self.state);
        if touch.force_n.y <= 0.0 {
            ContactMode::Flight
        } else if touch.slip_m_s.abs() < STICK_M_S {
            ContactMode::Stick
        } else {
            ContactMode::slide(Slip::of(touch.slip_m_s))
        }
    }
}

impl Plant for CompliantArmOnBelt {
    fn snapshot(&self) -> Snapshot {
        self.motion().snapshot(self.mode, self.time_s, &self.state)
    }

    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        self.torque = self.torque.followed_by(self.time_s, target_nm, lag_s);
    }

    fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError> {
        Self::advance(self, until_s, probe).map_err(PlantError::new)
    }

    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn link_angles_rad(&self) -> LinkMotion<f64> {
        let gear = &self.effects.gear;
        if gear.elastic && gear.encoder_side == EncoderSide::Motor {
            JointMotion::new(self.state[5], self.state[6]).to_links()
        } else {
            LinkMotion::new(self.state[0], self.state[1])
        }
    }

    fn contact_force_n(&self) -> Vector2<f64> {
        self.motion().touch_at(self.time_s, &self.state).force_n
    }
}

#[cfg(test)]
mod tests;
