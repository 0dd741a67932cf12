//! The torque that a tick demands: from the law while the tip touches, from the recovery while a tip
//! that left the belt is returned to it.

use painleve_shared::{Arm, Posture};

use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::last_command::LastCommand;
use crate::law::{Law, LawInput, LawOutput};
use crate::recover::{Recovery, RecoverySettings, RecoveryState};
use crate::refer::Target;
use crate::supervise::supervisor::Phase;

/// The law, and the recovery that stands in for it.
#[derive(Clone, Debug)]
pub struct TorqueDemand<L> {
    law: L,
    recovery: Recovery,
    tick_s: f32,
    torque_limit_nm: f32,
}

/// State of a [`TorqueDemand`] between ticks.
#[derive(Clone, Debug)]
pub struct DemandState<L: Law> {
    law: L::State,
    recovery: RecoveryState,
}

impl<L: Law> DemandState<L> {
    /// Posture in which the tip is to land; `None` while no recovery is in progress.
    pub fn landing_posture(&self) -> Option<Posture> {
        self.recovery.posture()
    }

    /// Cancels a recovery in progress.
    pub fn cancel_recovery(&mut self) {
        self.recovery = RecoveryState::default();
    }
}

/// Inputs of a [`TorqueDemand`] at one tick.
#[derive(Clone, Copy, Debug)]
pub struct DemandInput<'a> {
    /// The arm with its calibrated length.
    pub arm: &'a Arm<f32>,
    /// Its model at the estimated angles and rates.
    pub model: &'a Model,
    /// The contact estimate.
    pub contact: &'a ContactEstimate,
    /// The drive's state.
    pub phase: &'a Phase,
    /// The reference.
    pub target: &'a Target,
    /// The command until now.
    pub last: &'a LastCommand,
}

impl<L: Law> TorqueDemand<L> {
    /// Makes the demand of this law and this recovery, with a control period of `tick_s` (s) and torques
    /// up to `torque_limit_nm` (N·m).
    pub fn new(law: L, recovery: &RecoverySettings, tick_s: f32, torque_limit_nm: f32) -> Self {
        Self {
            law,
            recovery: Recovery::new(recovery, tick_s),
            tick_s,
            torque_limit_nm,
        }
    }

    /// Returns the state before the first tick.
    pub fn start(&self) -> DemandState<L> {
        DemandState {
            law: self.law.initial_state(),
            recovery: RecoveryState::default(),
        }
    }

    /// Whether there is a law: without one the drive never arms.
    pub fn is_on(&self) -> bool {
        self.law.is_on()
    }

    /// Returns the torque that this tick demands, and the contact force that it is meant to cause.
    #[inline]
    pub fn tick(&self, state: &mut DemandState<L>, input: &DemandInput<'_>) -> LawOutput {
        let DemandInput {
            arm,
            model,
            contact,
            phase,
            target,
            last,
        } = *input;
        if target.recovering {
            let edges_m = target.fresh_edges_m;
            return self.recovery.tick(&mut state.recovery, arm, model, edges_m);
        }
        state.recovery.touch(self.tick_s);
        let starts = phase.arms || contact.lands;
        let input = LawInput {
            arm,
            model,
            posture: target.posture,
            force_n: contact.force_n,
            friction: &contact.friction,
            p_per_kg: contact.p_per_kg,
            response: &contact.response,
            contact: contact.touches,
            saturated: last.saturated && !starts,
            reference: target.reference,
            torque_limit_nm: self.torque_limit_nm,
            tick_s: self.tick_s,
        };
        if starts {
            // Few ticks reset, and out of line: the copy spares all others to store the input in memory.
            let copy = input;
            self.law.reset(&mut state.law, &copy);
        }
        self.law.tick(&mut state.law, &input)
    }
}
