//! When a program begins.

use super::super::*;
use crate::refer::reference::{Program, Segment};
use crate::supervise::supervisor::OnLiftOff;
use crate::test_readings::pressing as frame;
use painleve_shared::counts::ForceCounts;
use painleve_shared::status::SupervisorState;

/// Returns the tick at which the program begins, and the state then, if contact is lost for some ticks from tick 20 on.
fn begins(
    on_lift_off: OnLiftOff,
    segments: &[Segment],
    lost_ticks: u32,
) -> Option<(u32, SupervisorState)> {
    let mut configuration = <Configuration>::default();
    configuration.settings.supervisor.on_lift_off = on_lift_off;
    configuration.settings.reference = Program {
        segments: segments.iter().copied().collect(),
    };
    let mut controller = Controller::new(&configuration).unwrap();
    (0..1000).find_map(|tick| {
        let mut frame = frame(tick);
        if (20..20 + lost_ticks).contains(&tick) {
            frame.normal_force = ForceCounts(0);
            frame.tangential_force = ForceCounts(0);
        }
        let state = controller.tick(&frame).supervisor_state()?;
        let has_begun = controller.references.generator.has_begun();
        has_begun.then_some((tick, state))
    })
}

/// To find the edges of a tip on the belt takes more than a hundred ticks.
#[test]
fn a_program_begins_on_the_belt_once_the_edges_are_known() {
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
            for lost_ticks in [0, 10, 30, 60, 100, 200] {
                let (tick, state) = begins(on_lift_off, segments, lost_ticks).unwrap();
                assert_eq!(state, SupervisorState::Tracking, "{tick}");
                let searches_in_the_air = on_lift_off == OnLiftOff::Continue;
                let from = if searches_in_the_air { 0 } else { lost_ticks };
                assert!(tick > from + 100, "{on_lift_off:?} {lost_ticks}: {tick}");
            }
        }
    }
}
