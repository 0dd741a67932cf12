//! Options that a study refuses, because they would do nothing or change what it compares.

// Helpers of tests may panic as tests do.
#![allow(clippy::unwrap_used)]

use painleve_study_core::StudyError;
use painleve_study_core::catalogue::AnyStudy;

fn study(line: &str) -> Result<Box<dyn AnyStudy>, StudyError> {
    let (name, options) = line.split_once(' ').unwrap();
    let entry = painleve_study::find(name).unwrap();
    let command = entry.command().no_binary_name(true);
    let matches = command.try_get_matches_from(options.split(' ')).unwrap();
    (entry.read)(&matches).unwrap().study()
}

fn refusal(line: &str) -> String {
    study(line)
        .err()
        .map_or("accepted".into(), |error| error.to_string())
}

/// A scenario file with an arm that is larger, stronger and of another shape than the paper's.
fn large_arm() -> tempfile::NamedTempFile {
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    let text = "[arm]
        link_length_m = [0.6, 0.5]
        link_mass_kg = [3.0, 1.5]
        height_m = 0.99
        [converters.torque]
        range_nm = 40.0
        [controller]
        torque_limit_nm = 40.0
        reference = [{ minimum-jerk = { target_m = 0.3, duration_s = 3.0 } }]
        [initial]
        tip_m = -0.4";
    std::fs::write(file.path(), text).unwrap();
    file
}

/// By default: with its own converters, to its own target, from and at places within its reach.
#[test]
fn every_study_takes_the_arm_of_a_scenario_file() {
    let (large, short) = (large_arm(), "--set arm.height_m=0.415");
    let path = large.path().display();
    for line in [
        format!("sliding-range --controller {path}"),
        format!("closed-loop-bifurcation --controller {path} --v-belt=-0.4"),
        format!("effects --controller {path} --runs 1"),
        format!("loop --controller {path}"),
        format!("loop --controller hybrid,{path}"),
        format!("loop {short}"),
        format!("regions --scenario {path}"),
        format!("regions {short}"),
        format!("bifurcation --scenario {path} --initial a,d,u"),
        format!("poincare {short}"),
        format!("stiffness --scenario {path}"),
        format!("stiffness {short}"),
    ] {
        assert_eq!(refusal(&line), "accepted", "{line}");
    }
    let message = refusal(&format!(
        "sliding-range --converters ideal,hardware --controller {path}"
    ));
    assert_eq!(
        message,
        format!(
            "controller {path} with ideal converters: controller.torque_limit_nm = 40 is outside the allowed range 0 to 5"
        )
    );
    for study in ["robustness", "lift-off", "ablation --on rigid"] {
        let message = refusal(&format!("{study} {short}"));
        assert_eq!(
            message,
            "arm.height_m has no effect here; the study sets it"
        );
    }
    let message = refusal("stiffness --set belt.profile.speed_m_s=0.5");
    assert!(
        message.starts_with("belt.profile.speed_m_s = 0.5 is outside"),
        "{message}"
    );
}

#[test]
fn keys_that_the_study_itself_sets_are_refused() {
    for (line, key) in [
        (
            "lift-off --set controller.contact.evidence=encoders",
            "controller.contact.evidence",
        ),
        (
            "lift-off --set controller.governor.enabled=true",
            "controller.governor.enabled",
        ),
        ("capture --set run.enable_at_s=100", "run.enable_at_s"),
        ("capture --set run.duration_s=1", "run.duration_s"),
        ("ringing --set initial.theta1_deg=1", "initial.theta1_deg"),
        (
            "ringing --set controller.reference=[]",
            "controller.reference",
        ),
        (
            "ringing --set controller.friction.first_guess=0.1",
            "controller.friction.first_guess",
        ),
        (
            "ringing --set controller.law.hybrid.force_integral_gain_per_s=1",
            "controller.law.hybrid.force_integral_gain_per_s",
        ),
        ("ringing --set run.duration_s=2", "run.duration_s"),
        ("effects --set initial.theta1_deg=1", "initial.theta1_deg"),
        (
            "effects --set controller.reference=[]",
            "controller.reference",
        ),
        ("effects --set run.duration_s=2", "run.duration_s"),
        (
            "ablation --on half --set initial.theta1_deg=1",
            "initial.theta1_deg",
        ),
        (
            "ablation --on rigid,capture --set run.duration_s=2",
            "run.duration_s",
        ),
        (
            "loop --tip=0.1 --set controller.response.enabled=true",
            "controller.response.enabled",
        ),
    ] {
        assert_eq!(
            refusal(line),
            format!("{key} has no effect here; the study sets it")
        );
    }
    for line in [
        "capture --set controller.contact.evidence=encoders",
        "loop --tip=0.1 --set contact.kind=compliant --set controller.response.enabled=false",
        "effects --runs 1 --contact compliant --effect none --set contact.stiffness_n_m=1e5",
        "ablation --on rigid --set belt.friction=0.5",
        "ablation --on rigid --set run.duration_s=2",
    ] {
        assert_eq!(refusal(line), "accepted", "{line}");
    }
}

#[test]
fn another_contact_than_the_one_that_the_option_names_is_refused() {
    for (line, option) in [
        ("effects --contact rigid", "--contact"),
        ("ablation --on soft", "--on"),
    ] {
        assert_eq!(
            refusal(&format!("{line} --set contact.kind=compliant")),
            format!("contact.kind has no effect here; use {option}")
        );
    }
}

#[test]
fn a_law_that_the_study_sets_is_refused_with_the_option_that_chooses_it() {
    let key = "controller.law.hybrid.normal_force_n";
    assert_eq!(
        refusal(&format!("loop --tip=0.1628 --set {key}=15.0")),
        format!(
            "{key} cannot be set here: the study sets the law itself; choose it with --controller, by name or as a \
             scenario file"
        )
    );
}

#[test]
fn keys_that_a_study_without_control_does_not_use_are_refused() {
    for (study, keys) in [
        ("admissible", "arm, belt"),
        ("regions", "arm"),
        ("bifurcation", "arm, impact, solver"),
        ("poincare", "arm, impact, solver"),
        ("stiffness", "arm, belt, impact, solver"),
    ] {
        for (text, key) in [
            (
                "controller.governor.enabled=false",
                "controller.governor.enabled",
            ),
            ("converters.encoder.bits=12", "converters.encoder.bits"),
            ("run={tick_hz=500}", "run"),
        ] {
            let expected = format!("{key} has no effect here; set keys of {keys}");
            assert_eq!(
                refusal(&format!("{study} --set {text}")),
                expected,
                "{study}"
            );
        }
        assert_eq!(
            refusal(&format!("{study} --set arm.tip_mass_kg=0.01")),
            "accepted"
        );
        let unknown = refusal(&format!("{study} --set belt.frction=1"));
        assert!(
            unknown.starts_with("belt.frction: unknown key"),
            "{unknown}"
        );
    }
}

#[test]
fn a_value_out_of_range_is_refused_before_the_study_begins() {
    for (line, option) in [
        ("admissible --mu 99", "--mu = 99"),
        ("regions --mu 99", "--mu = 99"),
        ("bifurcation --mu 99", "--mu = 99"),
        ("poincare --v-belt=-200", "--v-belt = -200"),
        ("stiffness --v-belt=-0.4,-200", "--v-belt = -200"),
    ] {
        let message = refusal(line);
        let expected = format!("{option} is outside the allowed range");
        assert!(message.starts_with(&expected), "{line}: {message}");
    }
}

#[test]
fn an_effect_without_a_contact_that_has_it_is_refused() {
    let line = "effects --effect seam --runs 1 --contact";
    let expected = "--effect seam has no effect here; use --contact compliant";
    assert_eq!(refusal(&format!("{line} rigid")), expected);
    assert_eq!(refusal(&format!("{line} rigid,compliant")), "accepted");
    assert_eq!(refusal("effects --runs 1 --contact rigid"), "accepted");
}

#[test]
fn what_is_given_twice_is_computed_once() {
    for (twice, once) in [
        (
            "effects --runs 1 --effect none,none",
            "effects --runs 1 --effect none",
        ),
        (
            "effects --runs 1 --contact compliant,compliant --controller hybrid,hybrid --effect push-along,push-along --level 0.02,0.02",
            "effects --runs 1 --contact compliant --controller hybrid --effect push-along --level 0.02",
        ),
        (
            "ablation --on rigid,rigid --without probe,probe",
            "ablation --on rigid --without probe",
        ),
        (
            "loop --controller pid,pid --tip=0.1,0.1",
            "loop --controller pid --tip=0.1",
        ),
        (
            "regions --theta2 positive,positive --slip negative,negative",
            "regions --theta2 positive --slip negative",
        ),
        (
            "sliding-range --controller pid,pid --converters ideal,ideal --posture elbow-up,elbow-up --mu 0.6,0.6 --reference step,step",
            "sliding-range --controller pid --converters ideal --posture elbow-up --mu 0.6 --reference step",
        ),
        (
            "closed-loop-bifurcation --controller pid,pid --converters ideal,ideal --v-belt=-0.4,-0.4",
            "closed-loop-bifurcation --controller pid --converters ideal --v-belt=-0.4",
        ),
    ] {
        let rows = [twice, once].map(|line| study(line).unwrap().row_count());
        assert_eq!(rows[0], rows[1], "{twice}");
    }
}
