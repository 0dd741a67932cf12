//! The torque that a tick demands: from the law while the tip touches, from the recovery while a tip
//! that left the belt is returned to it.

use crate::configuration::Configuration;
use crate::estimate::Estimators;
use crate::law::{Law, LawInput, LawOutput};
use crate::recover::{Flight, RecoverySettings};
use crate::refer::Target;
use crate::supervise::supervisor::Phase;

/// The law, and the recovery that stands in for it.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct TorqueDemand<L: Law> {
    law_state: L::State,
    /// The recovery in progress.
    pub flight: Option<Flight>,
    pub(crate) law: L,
    recovery: RecoverySettings,
    tick_s: f32,
    torque_limit_nm: f32,
}

impl<L: Law> TorqueDemand<L> {
    /// Makes the demand of this configuration, with motion loops of the law faster by the factor `speed`, for an output that
    /// gives up to ±`torque_limit_nm`.
    pub fn new(configuration: &Configuration<L>, speed: f32, torque_limit_nm: f32) -> Self {
        let settings = &configuration.settings;
        let law = settings.law.at_speed(speed);
        Self {
            law_state: law.initial_state(),
            flight: None,
            law,
            recovery: settings.recovery,
            tick_s: configuration.tick_s(),
            torque_limit_nm,
        }
    }

    /// Returns the torque that this tick demands, and the contact force that it is meant to cause. `saturated` states
    /// whether the torque until now was limited.
    #[inline]
    pub fn tick(
        &mut self,
        estimates: &Estimators,
        phase: &Phase,
        target: &Target,
        saturated: bool,
    ) -> LawOutput {
        let (arm, model, contact) = (&estimates.arm, &estimates.model, &estimates.contact);
        if target.recovering {
            let stretch = target.edges_for_landing.then_some(target.stretch);
            let flight = &mut self.flight;
            return self.recovery.tick(flight, arm, model, stretch, self.tick_s);
        }
        self.flight.take_if(|flight| flight.touch(self.tick_s));
        let starts = phase.arms || contact.lands;
        let input = LawInput {
            arm,
            model,
            posture: target.posture,
            contact,
            saturated: saturated && !starts,
            reference: target.reference,
            torque_limit_nm: self.torque_limit_nm,
            tick_s: self.tick_s,
        };
        if starts {
            // The copy spares every other tick to store the input in memory.
            let copy = input;
            self.law.reset(&mut self.law_state, &copy);
        }
        self.law.tick(&mut self.law_state, &input)
    }
}
