//! When a program begins.

use super::super::*;
use crate::refer::reference::{Program, Segment};
use crate::supervise::supervisor::OnLiftOff;
use crate::test_readings::pressing as frame;
use painleve_shared::counts::ForceCounts;

/// Returns the tick at which the program begins, while contact is lost for some ticks before the edges are known.
fn begins_at(on_lift_off: OnLiftOff, segments: &[Segment], lost_ticks: u32) -> Option<u32> {
    let mut configuration = <Configuration>::default();
    configuration.settings.supervisor.on_lift_off = on_lift_off;
    configuration.settings.reference = Program {
        segments: segments.iter().copied().collect(),
    };
    let mut controller = Controller::new(&configuration).unwrap();
    (0..600).find(|tick| {
        let mut frame = frame(*tick);
        if (20..20 + lost_ticks).contains(tick) {
            frame.normal_force = ForceCounts(0);
            frame.tangential_force = ForceCounts(0);
        }
        controller.tick(&frame);
        controller.references.generator.has_begun()
    })
}

#[test]
fn a_program_begins_once_the_edges_are_known() {
    let moves = Segment::MinimumJerk {
        target_m: 0.1,
        duration_s: 3.0,
    };
    let jumps = Segment::Step {
        target_m: -0.05,
        duration_s: 0.0,
    };
    for on_lift_off in [OnLiftOff::Recover, OnLiftOff::Continue] {
        for segments in [&[moves][..], &[jumps, moves]] {
            for lost_ticks in [0, 10] {
                let begins_at = begins_at(on_lift_off, segments, lost_ticks);
                assert!(
                    begins_at.is_some_and(|tick| tick > 100),
                    "{on_lift_off:?} {segments:?} {lost_ticks}: {begins_at:?}"
                );
            }
        }
    }
}
