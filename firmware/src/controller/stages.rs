//! The stages of a tick, from readings to an answer, and what they learn after it.

use painleve_shared::Slip;
use painleve_shared::counts::Micrometres;
use painleve_shared::frame::{SensorFrame, StatusFlags};
use painleve_shared::status::Fault;

use super::{Controller, Due};
use crate::estimate::Estimators;
use crate::estimate::joints::Restart;
use crate::last_command::LastCommand;
use crate::law::Law;
use crate::refer::Target;
use crate::schedule::Turn;

impl<L: Law> Controller<L> {
    /// Answers a frame's readings, `elapsed_ticks` after the previous ones.
    #[inline]
    pub(super) fn follow(
        &mut self,
        frame: &SensorFrame,
        elapsed_ticks: u32,
        show: impl FnOnce(&Estimators, &Target, &LastCommand),
    ) {
        let followed = self.estimates.observe(frame, elapsed_ticks, &self.command);
        if followed == Err(Restart::EncoderJump) {
            self.supervisor.latch(Fault::EncoderJump);
        }
        let contact = &self.estimates.contact;
        let phase = self
            .supervisor
            .tick(frame.inputs, contact.touches, self.demand.law.is_on());
        let landing = self.demand.flight.map(|flight| flight.posture);
        let target = self.references.tick(&self.estimates, &phase, landing);
        self.observed.elapsed_ticks = elapsed_ticks;
        let mut drives = phase.state.drives();
        if drives {
            let output = self
                .demand
                .tick(&self.estimates, &phase, &target, self.command.saturated);
            let torques = self.torques.tick(&mut self.command, &output);
            self.command.reference_velocity_m_s = target.reference.velocity_m_s;
            if let Err(fault) = torques {
                self.supervisor.latch(fault);
                drives = false;
            }
        }
        if !drives {
            self.release();
        }
        let (estimates, command) = (&self.estimates, &self.command);
        let answer = &mut self.last_answer;
        answer.torques = command.counts;
        answer.reference_tip = Micrometres::from_metres(target.reference.position_m);
        answer.estimated_tip = Micrometres::from_metres(estimates.model.tip_m.x);
        let (touches, friction) = (estimates.contact.touches, &estimates.contact.friction);
        let slips = touches && friction.slip == Slip::Negative;
        let mut flags = StatusFlags::default();
        flags.set(StatusFlags::CONTACT, touches);
        flags.set(StatusFlags::SATURATED, command.saturated);
        let is_done = self.references.generator.is_done();
        flags.set(StatusFlags::REFERENCE_DONE, is_done);
        flags.set(StatusFlags::AT_EDGE, target.at_edge);
        flags.set(StatusFlags::RECOVERING, target.recovering && drives);
        flags.set(StatusFlags::SLIP_NEGATIVE, slips);
        flags.set(StatusFlags::STICKS, touches && friction.sticks);
        answer.flags = flags;
        self.supervisor.report(answer);
        show(estimates, &target, command);
        // Readings from which the estimates have started show nothing else.
        self.due = followed.map_or(Due::Preparation, |()| Due::Everything);
    }

    /// Updates the estimates with the tick that has been answered, and the slow ones and the edges in turn.
    #[inline(never)]
    pub(super) fn learn(&mut self) {
        let turn = self.turn.take();
        let (estimates, observed) = (&mut self.estimates, &self.observed);
        let touches = estimates.contact.touches;
        // Compiled for each case: the longest update, in contact, never coincides with a search in the air.
        if touches {
            estimates.learn(true, observed, turn);
        } else {
            estimates.learn(false, observed, turn);
        }
        // A tip that is being returned to the belt needs the edges soon.
        if turn == Turn::Edges || (!touches && self.references.asks_for_landing) {
            self.references.search(estimates);
        }
    }

    /// Prepares the estimates for the next readings.
    #[inline]
    pub(super) fn prepare(&mut self) {
        let state = self.supervisor.state();
        let drives = state.drives();
        self.estimates.prepare(&mut self.command, drives);
        self.references.prepare(state);
        self.observed.drove = drives;
        self.observed.torque_nm = self.command.torque_nm;
        self.observed.rounding_nm = self.command.rounding_nm;
        self.observed.saturated = self.command.saturated;
    }

    /// Takes the torque off and cancels a recovery in progress.
    pub(super) fn release(&mut self) {
        self.command = LastCommand::default();
        self.demand.flight = None;
        self.observed.drove = false;
    }
}
