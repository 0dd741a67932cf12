//! Checks an arriving sensor frame, records its lapses, and heeds ENABLE in a frame whose readings cannot be used.

use painleve_shared::frame::{DigitalInputs, SensorFrame};

use super::{Controller, Due};
use crate::law::Law;
use crate::supervise::lapses::{BOARD_LAPSES, Lapse};

/// Record of the frames received.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ArrivalState {
    last_sequence: Option<u32>,
    /// Ticks since the last readings used, without those that the present frame adds.
    unread_ticks: u32,
}

impl<L: Law> Controller<L> {
    /// Checks a frame before its readings are used, and records its lapses. Returns by how many ticks valid readings follow
    /// the previous ones (1 when none were lost); `None` for a repeated or old frame, and for an impossible reading.
    #[inline]
    pub(super) fn arrive(&mut self, frame: &SensorFrame) -> Option<u32> {
        let state = &mut self.arrivals;
        let last = state
            .last_sequence
            .unwrap_or(frame.sequence.wrapping_sub(1));
        let ahead = frame.sequence.wrapping_sub(last);
        let (encoders, forces) = self.estimates.can_read(frame);
        let mut reports = BOARD_LAPSES.iter().map(|(input, _)| *input);
        let reported = |input| frame.inputs.contains(input);
        if ahead != 1 || !encoders || !forces || reports.any(reported) {
            return self.irregular(frame, ahead);
        }
        state.last_sequence = Some(frame.sequence);
        for lapse in Lapse::OF_FRAMES {
            self.supervisor.note(*lapse, 0);
        }
        Some(1 + core::mem::take(&mut state.unread_ticks))
    }

    /// Handles a frame that is out of sequence, has readings out of range, or reports faults of the board. The answer to it
    /// takes the torque off if this latches a fault.
    #[cold]
    #[inline(never)]
    fn irregular(&mut self, frame: &SensorFrame, ahead: u32) -> Option<u32> {
        let (state, supervisor) = (&mut self.arrivals, &mut self.supervisor);
        let (encoders, forces) = self.estimates.can_read(frame);
        // One latch after all of them: a call for each would add to the bound on a tick.
        let mut first = None;
        let mut note = |lapse: Lapse, times: u32| {
            if supervisor.lapses.note(lapse, times) && first.is_none() {
                first = Some(lapse);
            }
        };
        for (input, lapse) in BOARD_LAPSES {
            note(lapse, u32::from(frame.inputs.contains(input)));
        }
        // More than half the counter's range ahead means behind.
        let stale = ahead == 0 || ahead > u32::MAX / 2;
        note(Lapse::StaleFrame, u32::from(stale));
        let mut elapsed_ticks = None;
        if !stale {
            note(Lapse::LostFrame, ahead - 1);
            note(Lapse::EncoderOutOfRange, u32::from(!encoders));
            note(Lapse::ForceOutOfRange, u32::from(!forces));
            let ticks = ahead.saturating_add(state.unread_ticks);
            if encoders && forces {
                state.unread_ticks = 0;
                elapsed_ticks = Some(ticks);
            } else {
                state.unread_ticks = ticks.min(u32::MAX / 2);
                self.due = Due::Preparation;
            }
        }
        if let Some(lapse) = first {
            supervisor.latch(lapse.fault());
        }
        // A sender that has started anew counts from another number: follow it once its frames have latched a fault, so that
        // it can reset the fault.
        if !stale || supervisor.fault().is_some() {
            state.last_sequence = Some(frame.sequence);
        }
        // The state machine sees only frames with readings.
        let disables = !stale && !frame.inputs.contains(DigitalInputs::ENABLE);
        if disables && elapsed_ticks.is_none() && supervisor.state().drives() {
            supervisor.disable();
        }
        elapsed_ticks
    }
}
