//! `painleve drive --store`, `--stored` and `--forget` end to end.

use painleve_tests::errors;

use crate::drive::report;
use crate::drive::rig::{EmulatedRig, StartedProgram};

fn asked(rig: &EmulatedRig, option: &str, more: &[&str]) -> std::process::Output {
    StartedProgram::drive(&rig.port, &[&[option], more].concat())
        .end()
        .0
}

#[test]
fn a_configuration_is_stored_found_and_forgotten() {
    let rig = EmulatedRig::new();
    let is = |output: &std::process::Output, state: &str, version: u32| {
        let report = report(output);
        assert_eq!(report["state"], state, "{report}");
        assert_eq!(report["version"], version, "{report}");
    };
    is(&asked(&rig, "--stored", &[]), "Empty", 0);
    is(&asked(&rig, "--store", &[]), "Intact", 1);
    is(&asked(&rig, "--store", &[]), "Intact", 2);
    is(&asked(&rig, "--stored", &[]), "Intact", 2);
    // A setting out of range is refused by the program, and nothing is stored.
    let refused = asked(&rig, "--store", &["--set", "run.tick_hz=0"]);
    assert!(!refused.status.success(), "{}", errors(&refused));
    is(&asked(&rig, "--stored", &[]), "Intact", 2);
    is(&asked(&rig, "--forget", &[]), "Empty", 0);
    is(&asked(&rig, "--stored", &[]), "Empty", 0);
    assert_eq!(rig.ticks_on(), 0);
}
