//! Classifies an arriving sensor frame and records its lapses.

use painleve_shared::counts::LinearConverter;
use painleve_shared::frame::{DigitalInputs, SensorFrame};

use crate::configuration::Converters;
use crate::supervise::lapses::{Lapse, LapseMonitor};
use crate::supervise::supervisor::Supervisor;

/// Largest count of ticks without readings: a fault is latched long before.
const UNREAD_TICKS_LIMIT: u32 = 1 << 16;

/// Lapses that a board detects by itself, and reports by these inputs.
const BOARD_LAPSES: [(DigitalInputs, Lapse); 4] = [
    (DigitalInputs::ARMING_REFUSED, Lapse::ArmingRefused),
    (DigitalInputs::STAGE_NOT_READY, Lapse::StageNotReady),
    (DigitalInputs::GAP_AGAINST_FORCE, Lapse::GapAgainstForce),
    (DigitalInputs::WINDING_HOT, Lapse::WindingHot),
];

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
    pub supervisor: &'a mut Supervisor,
}

impl Lapses<'_> {
    /// Records how many times a lapse occurred, 0 for none. Returns whether this has just latched a
    /// fault; the caller then takes the torque off.
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
        let latches = self.monitor.note(lapse, times) && self.supervisor.fault().is_none();
        if latches {
            self.supervisor.latch(lapse.fault());
        }
        latches
    }

    /// Records how many times one of a frame's lapses occurred, and keeps the `first` that has occurred too often.
    // In line, because a loop over the lapses would take three times as long.
    #[inline(always)]
    fn note_among(&mut self, first: &mut Option<Lapse>, lapse: Lapse, times: u32) {
        if self.monitor.note(lapse, times) && first.is_none() {
            *first = Some(lapse);
        }
    }

    /// Latches the fault of a frame's first lapse that has occurred too often. The answer to the frame then takes the
    /// torque off.
    #[inline]
    fn stop_at(&mut self, first: Option<Lapse>) {
        if let Some(lapse) = first {
            self.supervisor.latch(lapse.fault());
        }
    }
}

/// The ranges of the converters' readings.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReadingRanges {
    /// Counts per turn of each encoder.
    encoder_moduli: [u32; 2],
    force_cell: LinearConverter<f32>,
}

impl ReadingRanges {
    pub fn of(converters: &Converters) -> Self {
        Self {
            encoder_moduli: converters.encoders.map(|scale| scale.modulus()),
            force_cell: converters.force.converter(),
        }
    }

    #[inline]
    fn readability(&self, frame: &SensorFrame) -> Readability {
        let [modulus_1, modulus_2] = self.encoder_moduli;
        let [joint_1, joint_2] = frame.joints;
        Readability {
            encoders: joint_1.0 < modulus_1 && joint_2.0 < modulus_2,
            forces: self.force_cell.contains(frame.normal_force.0)
                && self.force_cell.contains(frame.tangential_force.0),
        }
    }
}

/// Checks a frame before its readings are used.
#[inline]
pub(super) fn arrive(
    ranges: &ReadingRanges,
    state: &mut ArrivalState,
    mut lapses: Lapses<'_>,
    frame: &SensorFrame,
) -> Arrival {
    let last = state
        .last_sequence
        .unwrap_or(frame.sequence.wrapping_sub(1));
    let ahead = frame.sequence.wrapping_sub(last);
    let reading = ranges.readability(frame);
    let is_readable = reading.encoders && reading.forces;
    if ahead != 1
        || !is_readable
        || BOARD_LAPSES
            .iter()
            .any(|(input, _)| frame.inputs.contains(*input))
    {
        return irregular(state, lapses, frame, ahead, reading);
    }
    state.last_sequence = Some(frame.sequence);
    for lapse in Lapse::OF_FRAMES {
        lapses.note(*lapse, 0);
    }
    Arrival::After(1 + core::mem::take(&mut state.unread_ticks))
}

/// Whether the readings of a frame are within their converters' ranges.
struct Readability {
    encoders: bool,
    forces: bool,
}

/// Handles a frame that is out of sequence, has readings out of range, or reports faults of the board.
#[cold]
#[inline(never)]
fn irregular(
    state: &mut ArrivalState,
    mut lapses: Lapses<'_>,
    frame: &SensorFrame,
    ahead: u32,
    Readability { encoders, forces }: Readability,
) -> Arrival {
    // More than half the counter's range ahead means behind.
    let stale = ahead == 0 || ahead > u32::MAX / 2;
    let first = &mut None;
    for (input, lapse) in BOARD_LAPSES {
        lapses.note_among(first, lapse, u32::from(frame.inputs.contains(input)));
    }
    if stale {
        lapses.note_among(first, Lapse::StaleFrame, 1);
        lapses.stop_at(*first);
        return Arrival::Stale;
    }
    state.last_sequence = Some(frame.sequence);
    lapses.note_among(first, Lapse::StaleFrame, 0);
    lapses.note_among(first, Lapse::LostFrame, ahead - 1);
    lapses.note_among(first, Lapse::EncoderOutOfRange, u32::from(!encoders));
    lapses.note_among(first, Lapse::ForceOutOfRange, u32::from(!forces));
    lapses.stop_at(*first);
    let ticks = ahead.saturating_add(state.unread_ticks);
    if encoders && forces {
        state.unread_ticks = 0;
        Arrival::After(ticks)
    } else {
        state.unread_ticks = ticks.min(UNREAD_TICKS_LIMIT);
        Arrival::OutOfRange
    }
}
