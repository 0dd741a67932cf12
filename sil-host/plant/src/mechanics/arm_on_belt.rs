//! The simulated arm on its belt: its state, and its motion from one event to the next.

mod contact_change;
mod short_step;

use nalgebra::Vector2;
use painleve_shared::settings::Settings;
use painleve_shared::{Arm, JointTorque, LinkMotion, OutOfRange, Slip};

use crate::plant::{ContactMode, Plant, PlantError, Probe, Snapshot, State};

use super::belt::BeltSettings;
use super::dop853::{Dop853Step, Tolerance};
use super::effects::surface::SurfacePoint;
use super::impact::ImpactLaw;
use super::motion::{Evaluation, Motion, StateTerms, theta};
use super::motion_error::MotionError;
use super::moving_belt::MovingBelt;
use super::parameters::{InitialState, PlantParameters, SolverSettings};
use super::probe::{ArmProbe, ArmStep};
use super::step_budget::StepBudget;
use super::torque::TorqueSegment;
use super::transition;

/// Largest correction of an event's time for which the first-order change of the state is exact to
/// rounding, s.
const FIRST_ORDER_S: f64 = 1e-8;

/// Largest number of corrections of an event's time.
const MOST_CORRECTIONS: u32 = 3;

/// Upper limit of events within the shortest relevant time; no real motion has as many.
const MAXIMUM_EVENTS_AT_ONE_TIME: u32 = 1000;

/// The simulated arm on its belt.
#[derive(Clone, Debug)]
pub struct ArmOnBelt {
    arm: Arm<f64>,
    friction: f64,
    belt: MovingBelt,
    impact: ImpactLaw,
    solver: SolverSettings,
    torque: TorqueSegment,
    time_s: f64,
    state: State,
    mode: ContactMode,
    /// Time (s) and z_t (m) at which the tip began to stick.
    stick_start: (f64, f64),
    /// Whether torque or belt have changed since the mode was decided.
    unsettled: bool,
    step_size_s: f64,
    budget: StepBudget,
    /// Steps up to this length are tried at order 5 first, s.
    short_size_s: f64,
    /// The equations evaluated at the present state, if known; cleared by any change of the state
    /// or of the equations.
    evaluation: Option<Evaluation>,
    /// The terms of that evaluation.
    terms: StateTerms,
    step: Box<Dop853Step<4>>,
}

impl ArmOnBelt {
    /// Creates a plant at time zero with zero torque. A tip at most 0.1 mm above the belt or 1 mm
    /// inside it is first moved onto the belt.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first parameter that is out of range.
    pub fn new(parameters: &PlantParameters, initial: State) -> Result<Self, OutOfRange> {
        let arm = Arm::new(parameters.arm)?;
        parameters.validate()?;
        InitialState::from(&initial)
            .validate()
            .map_err(|error| error.inside("initial"))?;

        let terms = StateTerms::new(&arm, &initial);
        let mut plant = Self {
            arm,
            friction: parameters.friction,
            belt: MovingBelt::new(&parameters.belt),
            impact: parameters.impact,
            solver: parameters.solver,
            torque: TorqueSegment::constant(JointTorque::zeros()),
            time_s: 0.0,
            state: initial,
            mode: ContactMode::Flight,
            stick_start: (0.0, 0.0),
            unsettled: false,
            step_size_s: 1e-3,
            budget: StepBudget::default(),
            short_size_s: short_step::LONGEST_S,
            evaluation: None,
            terms,
            step: Box::new(Dop853Step::empty()),
        };
        let motion = plant.motion();
        if let Some(on_belt) = motion.start_on_belt(&initial, |_| SurfacePoint::default())? {
            let velocity = motion.relative_velocity_m_s(0.0, &on_belt);
            if velocity.y.abs() <= plant.solver.chatter_speed_m_s {
                plant.state = motion.onto_belt(&on_belt);
                plant.mode = ContactMode::slide(Slip::of(velocity.x));
                plant.unsettled = true;
            } else {
                plant.state = on_belt;
            }
        }
        Ok(plant)
    }

    /// Returns the arm's model.
    pub fn arm(&self) -> &Arm<f64> {
        &self.arm
    }

    /// Returns the present time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Returns the present state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Returns the present contact mode.
    pub fn mode(&self) -> ContactMode {
        self.mode
    }

    /// Returns the joint torques applied now, N·m.
    pub fn torque_nm(&self) -> JointTorque<f64> {
        self.torque.at(self.time_s)
    }

    /// Returns the equations of the present stretch of motion.
    pub fn motion(&self) -> Motion<'_> {
        Motion {
            arm: &self.arm,
            belt: self.belt.profile(),
            friction: self.friction,
            torque: self.torque,
        }
    }

    /// Returns the contact force (f_t, f_n) on the tip now, N, without impulses.
    #[inline]
    pub fn contact_force_n(&self) -> Vector2<f64> {
        self.evaluation().force_n
    }

    /// Gives the belt this friction and speed from now on.
    pub fn set_belt(&mut self, belt: &BeltSettings) {
        self.friction = belt.friction;
        self.belt.replace(self.time_s, &belt.profile);
        self.restart_contact();
    }

    /// Lets the contact start anew, because the belt has changed.
    fn restart_contact(&mut self) {
        self.stick_start = (self.time_s, self.motion().tip_t_m(&self.state));
        self.unsettled = true;
        self.evaluation = None;
    }

    /// Commands joint torques `target_nm` from now on, through a first-order lag with time constant
    /// `lag_s` (0 for none).
    #[inline]
    pub fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        let next = self.torque.followed_by(self.time_s, target_nm, lag_s);
        if next.at(self.time_s) != self.torque.at(self.time_s) {
            self.unsettled = true;
        }
        self.torque = next;
        if self.evaluation.is_some() {
            let motion = self.motion();
            self.evaluation = Some(motion.with_terms(self.mode, self.time_s, &self.terms));
        }
    }

    /// Decides the contact mode at the present time, so that the forces reflect the last command.
    ///
    /// # Errors
    /// [`MotionError`] if no mode is possible.
    #[inline]
    pub fn settle(&mut self, probe: &mut dyn ArmProbe) -> Result<(), MotionError> {
        if self.unsettled
            && self.mode.is_contact()
            && !transition::slides_on(self.mode, self.evaluate())
        {
            self.enter_contact(probe)?;
        }
        self.unsettled = false;
        Ok(())
    }

    /// Evaluates the equations at the present state, unless they are known.
    #[inline]
    fn evaluate(&mut self) -> &Evaluation {
        let motion = Motion {
            arm: &self.arm,
            belt: self.belt.profile(),
            friction: self.friction,
            torque: self.torque,
        };
        self.evaluation.get_or_insert_with(|| {
            self.terms = StateTerms::new(motion.arm, &self.state);
            motion.with_terms(self.mode, self.time_s, &self.terms)
        })
    }

    #[inline]
    fn evaluation(&self) -> Evaluation {
        self.evaluation
            .unwrap_or_else(|| self.motion().evaluate(self.mode, self.time_s, &self.state))
    }

    /// Integrates to time `until_s`.
    ///
    /// # Errors
    /// [`MotionError`]; the plant stays at the time of the error.
    pub fn advance(&mut self, until_s: f64, probe: &mut dyn ArmProbe) -> Result<(), MotionError> {
        while self.time_s < until_s {
            let corner = self.belt.next_corner_s(self.time_s).min(until_s);
            self.settle(probe)?;
            self.advance_smoothly(corner, probe)?;
            self.unsettled |= corner < until_s;
            if self.belt.jump(self.time_s) {
                self.restart_contact();
            }
        }
        self.settle(probe)
    }

    /// Integrates to a time before which torque and belt are smooth.
    fn advance_smoothly(
        &mut self,
        until_s: f64,
        probe: &mut dyn ArmProbe,
    ) -> Result<(), MotionError> {
        let mut events = 0;
        let mut event_s = self.time_s;
        while self.time_s < until_s {
            let remaining = until_s - self.time_s;
            if remaining <= 4.0 * f64::EPSILON * until_s.abs() {
                self.time_s = until_s;
                break;
            }
            let Some(event) = self.step_or_event(until_s, probe)? else {
                continue;
            };
            events = if event > event_s + 1e-9 {
                0
            } else {
                events + 1
            };
            event_s = event;
            if events > MAXIMUM_EVENTS_AT_ONE_TIME {
                return Err(MotionError::EventsWithoutEnd { time_s: event });
            }
        }
        Ok(())
    }

    /// Takes one accepted step, or moves to the first event within it and returns the event's time.
    fn step_or_event(
        &mut self,
        until_s: f64,
        probe: &mut dyn ArmProbe,
    ) -> Result<Option<f64>, MotionError> {
        let here = *self.evaluate();
        let motion = Motion {
            arm: &self.arm,
            belt: self.belt.profile(),
            friction: self.friction,
            torque: self.torque,
        };
        let tolerance = Tolerance {
            relative: self.solver.relative_tolerance,
            absolute: self.solver.absolute_tolerance,
        };
        let (mode, start_s, start) = (self.mode, self.time_s, self.state);
        let remaining = until_s - start_s;
        if remaining <= self.short_size_s.min(self.solver.maximum_step_s) {
            let (step, longest) = self.short_step(&motion, &here, until_s, &tolerance);
            self.short_size_s = longest;
            if let Some((end, terms, there)) = step {
                probe.step(&ArmStep {
                    motion: &motion,
                    mode,
                    start_s,
                    start: &start,
                    at_start: &here,
                    end_s: until_s,
                    end: &end,
                    at_end: &there,
                });
                self.time_s = until_s;
                self.state = end;
                self.terms = terms;
                self.evaluation = Some(there);
                return Ok(None);
            }
        }

        let derivative = |t: f64, x: &State| motion.derivative(mode, t, x);
        loop {
            self.budget.spend(start_s)?;
            let wanted = self.step_size_s.min(self.solver.maximum_step_s);
            let size = wanted.min(remaining);
            self.step
                .take(&derivative, start_s, &start, &here.slope, size, &tolerance);
            if self.step.error <= 1.0 {
                // A truncated step does not limit the next one.
                let proposed = self.step.proposed_size();
                self.step_size_s = if size < wanted {
                    wanted.max(proposed)
                } else {
                    proposed
                };
                break;
            }
            self.step_size_s = if self.step.error.is_finite() {
                self.step.proposed_size()
            } else {
                0.1 * size
            };
            if start_s + self.step_size_s == start_s {
                return Err(MotionError::StepVanished {
                    time_s: start_s,
                    mode,
                });
            }
        }
        let mut terms = StateTerms::new(motion.arm, &self.step.end);
        let there = motion.with_terms(mode, start_s + self.step.h, &terms);
        self.step.finish(&there.slope);

        let mut event = transition::first_event_s(&motion, mode, &mut self.step, &here, &there);
        if let Some(event_s) = event.as_mut() {
            // The interpolating polynomial that located the event is less accurate than a step.
            // Newton's method in time removes the gap that the step leaves, because moving the tip
            // onto the belt by force would change the energy.
            for taken in 1..=MOST_CORRECTIONS {
                let size = *event_s - start_s;
                self.step
                    .take(&derivative, start_s, &start, &here.slope, size, &tolerance);
                let correction = transition::landing_correction_s(&motion, mode, &self.step.end);
                if *event_s + correction <= start_s {
                    break;
                }
                let exact = correction.abs() < FIRST_ORDER_S;
                if exact {
                    let end_slope = derivative(*event_s, &self.step.end);
                    self.step.end += end_slope * correction;
                }
                if exact || taken < MOST_CORRECTIONS {
                    *event_s += correction;
                }
                if exact {
                    break;
                }
            }
        }
        let end_s = event.unwrap_or(if self.step.h == remaining {
            until_s
        } else {
            start_s + self.step.h
        });
        let end = self.onto_constraint(&motion, end_s, &self.step.end);
        let there = if event.is_none() && mode == ContactMode::Flight {
            there
        } else {
            terms = StateTerms::new(motion.arm, &end);
            motion.with_terms(mode, end_s, &terms)
        };
        probe.step(&ArmStep {
            motion: &motion,
            mode,
            start_s,
            start: &start,
            at_start: &here,
            end_s,
            end: &end,
            at_end: &there,
        });
        self.time_s = end_s;
        self.state = end;
        if event.is_some() {
            self.evaluation = None;
            self.handle_event(probe)?;
        } else {
            self.terms = terms;
            self.evaluation = Some(there);
        }
        Ok(event)
    }

    /// Returns the nearest state that satisfies the mode's constraint, from which integration
    /// errors have moved `state`.
    fn onto_constraint(&self, motion: &Motion<'_>, t_s: f64, state: &State) -> State {
        match self.mode {
            ContactMode::Flight => *state,
            ContactMode::SlidePositive | ContactMode::SlideNegative => motion.onto_belt(state),
            ContactMode::Stick => {
                let (since, anchor) = self.stick_start;
                let tip = anchor + self.belt.profile().displacement_m(since, t_s);
                motion.onto_stick(t_s, tip, state)
            }
        }
    }
}

impl Plant for ArmOnBelt {
    fn snapshot(&self) -> Snapshot {
        let (motion, here) = (self.motion(), self.evaluation());
        motion.snapshot_of(self.mode, self.time_s, &self.state, &here)
    }

    #[inline]
    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64) {
        Self::command_torque(self, target_nm, lag_s);
    }

    fn advance(&mut self, until_s: f64, mut probe: &mut dyn Probe) -> Result<(), PlantError> {
        Self::advance(self, until_s, &mut probe).map_err(PlantError::new)
    }

    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn link_angles_rad(&self) -> LinkMotion<f64> {
        theta(&self.state)
    }

    #[inline]
    fn contact_force_n(&self) -> Vector2<f64> {
        Self::contact_force_n(self)
    }
}
