//! Classifies an arriving sensor frame and records its lapses.

use painleve_shared::frame::{DigitalInputs, SensorFrame};

use crate::configuration::Converters;
use crate::last_command::LastCommand;
use crate::supervise::lapses::{Lapse, LapseMonitor};
use crate::supervise::supervisor::Supervision;

/// Largest count of ticks without readings: a fault is latched long before.
const UNREAD_TICKS_LIMIT: u32 = 1 << 16;

/// Faults that a board detects by itself.
const BOARD_FAULTS: DigitalInputs = DigitalInputs::ARMING_REFUSED
    .union(DigitalInputs::STAGE_NOT_READY)
    .union(DigitalInputs::GAP_AGAINST_FORCE);

/// Result of the checks of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Valid readings, this many ticks after the previous ones (1 when none were lost).
    After(u32),
    /// A repeated or old frame.
    Stale,
    /// A new frame with an impossible reading.
    OutOfRange,
}

/// Record of the frames received.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ArrivalState {
    last_sequence: Option<u32>,
    /// Ticks since the last readings used, without those that the present frame adds.
    unread_ticks: u32,
}

/// Lapse monitor, and the supervisor that it stops.
pub(super) struct Lapses<'a> {
    pub monitor: &'a mut LapseMonitor,
    pub supervision: &'a mut Supervision,
    pub command: &'a mut LastCommand,
}

impl Lapses<'_> {
    /// Records how many times a lapse occurred, 0 for none. Returns whether this has just latched a
    /// fault.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> bool {
        // Nearly all calls record no lapse: return early.
        if times == 0 {
            self.monitor.note_good(lapse);
            false
        } else {
            self.note_bad(lapse, times)
        }
    }

    #[cold]
    #[inline(never)]
    fn note_bad(&mut self, lapse: Lapse, times: u32) -> bool {
        let latches = self.monitor.note_bad(lapse, times) && self.supervision.fault().is_none();
        if latches {
            self.supervision.latch(lapse.fault());
            *self.command = LastCommand::default();
        }
        latches
    }
}

/// Checks a frame before its readings are used.
pub(super) fn arrive(
    converters: &Converters,
    state: &mut ArrivalState,
    mut lapses: Lapses<'_>,
    frame: &SensorFrame,
) -> Arrival {
    let last = state
        .last_sequence
        .unwrap_or(frame.sequence.wrapping_sub(1));
    let ahead = frame.sequence.wrapping_sub(last);
    let mut joints = converters.encoders.iter().zip(frame.joints);
    let forces = [frame.normal_force, frame.tangential_force];
    let encoders = joints.all(|(scale, reading)| scale.contains(reading));
    let forces = forces
        .iter()
        .all(|force| converters.force.contains(force.0));
    let board_faults = frame.inputs.intersection(BOARD_FAULTS);
    if ahead != 1 || !encoders || !forces || !board_faults.is_empty() {
        note_board_faults(&mut lapses, board_faults);
        return irregular(state, lapses, frame.sequence, ahead, encoders, forces);
    }
    state.last_sequence = Some(frame.sequence);
    for lapse in Lapse::OF_FRAMES {
        lapses.note(*lapse, 0);
    }
    Arrival::After(1 + core::mem::take(&mut state.unread_ticks))
}

/// Records the faults that the board has detected by itself.
#[cold]
#[inline(never)]
fn note_board_faults(lapses: &mut Lapses<'_>, faults: DigitalInputs) {
    for (bit, lapse) in [
        (DigitalInputs::ARMING_REFUSED, Lapse::ArmingRefused),
        (DigitalInputs::STAGE_NOT_READY, Lapse::StageNotReady),
        (DigitalInputs::GAP_AGAINST_FORCE, Lapse::GapAgainstForce),
    ] {
        lapses.note(lapse, u32::from(faults.contains(bit)));
    }
}

/// Handles a frame that is out of sequence or has readings (`encoders`, `forces`) out of range.
#[cold]
#[inline(never)]
fn irregular(
    state: &mut ArrivalState,
    mut lapses: Lapses<'_>,
    sequence: u32,
    ahead: u32,
    encoders: bool,
    forces: bool,
) -> Arrival {
    // More than half the counter's range ahead means behind.
    let stale = ahead == 0 || ahead > u32::MAX / 2;
    lapses.note(Lapse::StaleFrame, u32::from(stale));
    if stale {
        return Arrival::Stale;
    }
    state.last_sequence = Some(sequence);
    lapses.note(Lapse::LostFrame, ahead - 1);
    lapses.note(Lapse::EncoderOutOfRange, u32::from(!encoders));
    lapses.note(Lapse::ForceOutOfRange, u32::from(!forces));
    let ticks = ahead.saturating_add(state.unread_ticks);
    if encoders && forces {
        state.unread_ticks = 0;
        Arrival::After(ticks)
    } else {
        state.unread_ticks = ticks.min(UNREAD_TICKS_LIMIT);
        Arrival::OutOfRange
    }
}
