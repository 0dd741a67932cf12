//! Table of runs made by hand, so that a change of the controller does not change the snapshot.

use crate::plain;

use super::*;
use crate::robustness::Ending;
use crate::robustness::tables::rows;

#[test]
fn each_part_has_a_line_and_each_condition_a_column() {
    let study = AblationStudy {
        conditions: vec![Condition::Rigid, Condition::Capture],
        parts: vec![Part::Governor, Part::FrictionEstimate],
        seed: 7,
        runs: 40,
        overrides: Vec::new(),
    };
    let lost = |number: usize, ending| {
        let endings = (0..40).map(move |run| {
            if run < number {
                ending
            } else {
                Ending::Reached
            }
        });
        endings.map(|ending| (ending, 1e-4))
    };
    let all: Vec<_> = lost(1, Ending::LiftOff)
        .chain(lost(20, Ending::Fault))
        .chain(lost(0, Ending::Reached))
        .chain(lost(0, Ending::Reached))
        .chain(lost(30, Ending::NotCaptured))
        .chain(lost(0, Ending::Reached))
        .collect();
    insta::assert_snapshot!(plain(&Ablation::new(&study, &rows(&all))));
}
