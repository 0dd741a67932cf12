//! What is known of an arm before its slides, and how well.

use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_identify::parameters::Drawn;
use painleve_identify::{Parameter, Parameters, Prior};
use painleve_plant::decimal::as_written;
use painleve_plant::scenario::{Knowledge, Scenario};

/// Where the values of an arm come from that has been drawn and commissioned.
const DRAWN: &str = "drawn, zeros by plumb line";

/// Returns what the scenario's controller knows: values, with the deviations of an arm that has been drawn.
pub fn prior(scenario: &Scenario, drawn: &Drawn) -> Prior {
    let configuration = scenario.controller_configuration();
    let arm = configuration.arm;
    let mut correction = configuration.settings.estimator.encoders;
    let mut parameters =
        Parameters::of_arm(arm.link_length_m.map(as_written), as_written(arm.height_m));
    for (parameter, values_rad) in terms(&mut correction) {
        for (joint, value_rad) in values_rad.iter().enumerate() {
            parameters.set(parameter(joint), as_written(*value_rad));
        }
    }
    drawn.prior(parameters)
}

/// A parameter of each joint's encoder.
pub(super) type OfJoint = fn(usize) -> Parameter;

/// Returns the parameters of the encoders, each with its setting.
pub(crate) fn terms(correction: &mut EncoderCorrection) -> [(OfJoint, &mut [f32; 2]); 5] {
    [
        (Parameter::Zero, &mut correction.zero_rad),
        (Parameter::Sine, &mut correction.sine_rad),
        (Parameter::Cosine, &mut correction.cosine_rad),
        (Parameter::SecondSine, &mut correction.second_sine_rad),
        (Parameter::SecondCosine, &mut correction.second_cosine_rad),
    ]
}

/// Forgets what slides have shown, and lets the governor keep a distance for what a drawing, a plumb line and a tape leave
/// unknown.
pub(crate) fn suppose_drawn(scenario: &mut Scenario) {
    let told_m = told_m(scenario);
    let prior = prior(scenario, &Drawn::default());
    let deviation_m = libm::hypot(prior.tip_deviation_m(), told_m);
    scenario.controller.estimator.tip_deviation_m = setting(deviation_m);
    let deviation = |parameter: Parameter| prior.deviations[parameter.index()];
    scenario.knowledge = Knowledge {
        source: DRAWN.into(),
        told_m: rounded(told_m),
        ..of_geometry(&prior.parameters, deviation)
    };
}

/// Returns the knowledge of the geometry alone.
pub(super) fn of_geometry(
    parameters: &Parameters,
    deviation: impl Fn(Parameter) -> f64,
) -> Knowledge {
    let deviation = |parameter: Parameter| rounded(deviation(parameter));
    let larger = |one: OfJoint, other: OfJoint| {
        [0, 1].map(|joint| deviation(one(joint)).max(deviation(other(joint))))
    };
    let [length_1, _] = parameters.link_length_m();
    let ratio = deviation(Parameter::Ratio) * length_1;
    let length = deviation(Parameter::Length);
    let length_2 = libm::hypot(parameters.get(Parameter::Ratio) * length, ratio);
    Knowledge {
        encoder_zero_rad: [0, 1].map(|joint| deviation(Parameter::Zero(joint))),
        encoder_once_rad: larger(Parameter::Sine, Parameter::Cosine),
        encoder_twice_rad: larger(Parameter::SecondSine, Parameter::SecondCosine),
        link_length_m: [length, rounded(length_2)],
        height_m: deviation(Parameter::Height),
        ..Knowledge::default()
    }
}

/// Returns whether a scenario has never been commissioned or identified.
pub fn is_new(scenario: &Scenario) -> bool {
    let of_new = Knowledge {
        told_m: scenario.knowledge.told_m,
        ..Knowledge::default()
    };
    scenario.knowledge == of_new
}

/// Returns the deviation of the tip that the operator has told, m: for play of the gears, say.
pub(super) fn told_m(scenario: &Scenario) -> f64 {
    let told_m = scenario.knowledge.told_m;
    if is_new(scenario) {
        told_m.max(as_written(scenario.controller.estimator.tip_deviation_m))
    } else {
        told_m
    }
}

/// Returns a deviation of the tip, m, as a setting.
pub(super) fn setting(deviation_m: f64) -> f32 {
    rounded(deviation_m) as f32
}

/// Returns a number to eight decimals, which is what a file needs.
pub(super) fn rounded(value: f64) -> f64 {
    (value * 1e8).round() / 1e8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_told_deviation_is_kept_beside_what_is_known() {
        for key in ["controller.estimator.tip_deviation_m", "knowledge.told_m"] {
            let told = [format!("{key}=0.003")];
            let mut scenario = Scenario::default().with_overrides("play", &told).unwrap();
            assert!(is_new(&scenario) && told_m(&scenario) == 0.003);
            let mut deviations_m = Vec::new();
            for _ in 0..2 {
                suppose_drawn(&mut scenario);
                assert!(!is_new(&scenario) && told_m(&scenario) == 0.003);
                deviations_m.push(scenario.controller.estimator.tip_deviation_m);
            }
            let drawn_m = prior(&scenario, &Drawn::default()).tip_deviation_m();
            let expected_m = setting(libm::hypot(drawn_m, 0.003));
            assert_eq!(deviations_m, [expected_m; 2]);
        }
    }
}
