//! What a sensor frame is good for, and what went wrong with it.

use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::Controller;
use crate::supervise::deadline_monitor::{DeadlineMonitor, Lapse};

/// Ticks without readings are not counted further: a fault is latched long before.
const UNREAD_TICKS_LIMIT: u32 = 1 << 16;

/// What a frame is good for.
pub(super) enum Arrival {
    /// Readings so many ticks after the ones before (1 when none were lost).
    After(u32),
    /// A repeated or old frame.
    Stale,
    /// A new frame with a reading that cannot be.
    OutOfRange,
}

impl Controller {
    /// Takes note of how many times something went wrong around this tick, 0 for a
    /// good one. If that is now too often in a row, the fault is latched, and the last answer
    /// without its torque is returned, to be put out at once.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        // A good one, which nearly all are, costs next to nothing.
        if times == 0 {
            self.monitor.note_good(lapse);
            None
        } else {
            self.note_bad(lapse, times)
        }
    }

    #[cold]
    #[inline(never)]
    fn note_bad(&mut self, lapse: Lapse, times: u32) -> Option<ActuatorFrame> {
        if !self.monitor.note_bad(lapse, times) || self.supervisor.fault().is_some() {
            return None;
        }
        self.supervisor.latch(lapse.fault());
        self.shut_down(self.answer.tick);
        Some(self.answer)
    }

    /// How often each kind of lapse has happened.
    pub fn monitor(&self) -> &DeadlineMonitor {
        &self.monitor
    }

    pub(super) fn arrival(&mut self, frame: &SensorFrame) -> Arrival {
        let last = self.last_sequence.unwrap_or(frame.sequence.wrapping_sub(1));
        let ahead = frame.sequence.wrapping_sub(last);
        let converters = &self.configuration.converters;
        let mut joints = converters.encoders.iter().zip(frame.joints);
        let forces = [frame.normal_force, frame.tangential_force];
        let encoders = joints.all(|(scale, reading)| scale.contains(reading));
        let forces = forces
            .iter()
            .all(|force| converters.force.contains(force.0));
        if ahead != 1 || !encoders || !forces {
            return self.irregular_arrival(frame.sequence, ahead, encoders, forces);
        }
        self.last_sequence = Some(frame.sequence);
        for lapse in Lapse::OF_FRAMES {
            self.note(lapse, 0);
        }
        Arrival::After(1 + core::mem::take(&mut self.unread_ticks))
    }

    /// A frame that is not the next one, or has readings (`encoders`, `forces`) out of range.
    #[cold]
    #[inline(never)]
    fn irregular_arrival(
        &mut self,
        sequence: u32,
        ahead: u32,
        encoders: bool,
        forces: bool,
    ) -> Arrival {
        // More than half the range ahead is behind.
        let stale = ahead == 0 || ahead > u32::MAX / 2;
        self.note(Lapse::StaleFrame, u32::from(stale));
        if stale {
            return Arrival::Stale;
        }
        self.last_sequence = Some(sequence);
        self.note(Lapse::LostFrame, ahead - 1);
        self.note(Lapse::EncoderOutOfRange, u32::from(!encoders));
        self.note(Lapse::ForceOutOfRange, u32::from(!forces));
        let ticks = ahead.saturating_add(self.unread_ticks);
        if encoders && forces {
            self.unread_ticks = 0;
            Arrival::After(ticks)
        } else {
            self.unread_ticks = ticks.min(UNREAD_TICKS_LIMIT);
            Arrival::OutOfRange
        }
    }
}
