//! The bits of runs: a change of the controller or the plant that is not meant to change any motion keeps them.
//!
//! After one that is meant to, `INSTA_UPDATE=always` takes the new ones over.

use std::fmt::Write;

use painleve_plant::scenario::built_in;

use crate::run;

/// What exercises parts of the controller that the built-in scenarios do not: overrides of the scenario `edge`.
const FURTHER: [(&str, &[&str]); 5] = [
    ("compliant contact", &["contact.kind=compliant"]),
    (
        "friction like a sine, known badly",
        &[
            "contact.kind=compliant",
            "effects.friction={ kind = 'sine', amplitude = 0.1, frequency_hz = 1.0 }",
            "controller.friction.first_guess=0.4",
        ],
    ),
    (
        "push off the belt",
        &[
            "contact.kind=compliant",
            "effects.push.impulse_ns=[0.0, 0.05]",
        ],
    ),
    (
        "joint friction, contact from the encoders",
        &[
            "contact.kind=compliant",
            "controller.contact.evidence=encoders",
            "effects.joints.coulomb_nm=0.05",
        ],
    ),
    ("weak stages", &["controller.torque_limit_nm=1.0"]),
];

#[test]
fn runs_keep_their_bits() {
    let built_in = built_in::names().map(|name| (name, name, &[][..]));
    let further = FURTHER.map(|(name, overrides)| (name, "edge", overrides));
    let mut hashes = String::new();
    for (name, scenario, overrides) in built_in.into_iter().chain(further) {
        let end = run(scenario, overrides);
        writeln!(hashes, "{} {name}", end.log_hash.as_str()).expect("memory");
    }
    insta::assert_snapshot!(hashes);
}
