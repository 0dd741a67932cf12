//! Table of runs made by hand, so that a change of the controller does not change the snapshot.

use crate::plain;

use super::*;
use crate::robustness::tables::rows;
use crate::robustness::{Arms, Criterion, Ending};

#[test]
fn each_part_has_a_line() {
    let study = AblationStudy {
        campaign: Robustness {
            arms: Arms::Paper,
            seed: 7,
            criterion: Criterion::InPlace,
            runs: 4,
            overrides: Vec::new(),
        },
        parts: vec![Part::Governor, Part::FrictionEstimate],
    };
    let (reached, fell) = ((Ending::Reached, 1e-4), (Ending::LiftOff, 0.08));
    let whole = [reached, reached, (Ending::AtEdge, 2e-4), reached];
    let without_governor = [reached, fell, (Ending::Fault, 0.04), fell];
    let without_estimate = [
        reached,
        (Ending::StoppedEarly, 5e-4),
        (Ending::NotCaptured, 0.01),
        (Ending::Unsolved, 0.0),
    ];
    let all = [whole, without_governor, without_estimate].concat();
    insta::assert_snapshot!(plain(&Ablation::new(&study, rows(&all))));
}
