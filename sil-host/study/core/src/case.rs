//! A closed loop to study: its controller, its posture, its converters and its reference.
//! Every case is a scenario.

use core::fmt;
use std::collections::BTreeMap;
use std::str::FromStr;

use painleve_firmware::refer::reference::{Program, Segment};
use painleve_plant::converters::ConverterSettings;
use painleve_plant::scenario::{InitialState, RunSettings, Scenario};
use painleve_shared::{Arm, ArmParameters, Posture, Slip};
use serde::{Serialize, Serializer};

use crate::StudyError;
use crate::initial::{Initial, START};

/// The controller of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControllerChoice {
    /// The paper's PID.
    Pid,
    /// The paper's hybrid law with the paper's gains.
    HybridPaper,
    /// The same law with the friction of a known belt instead of the measured friction. In the
    /// paper's continuous law the torque depends on the friction that it causes; this variant
    /// is that law with the algebraic loop solved at every instant.
    HybridPaperModel,
    /// The built-in hybrid law.
    Hybrid,
    /// The controller of another built-in scenario or of a scenario file.
    Scenario(String),
}

impl ControllerChoice {
    /// The paper's controllers and the built-in hybrid law.
    pub const ALL: [Self; 4] = [
        Self::Pid,
        Self::HybridPaper,
        Self::HybridPaperModel,
        Self::Hybrid,
    ];

    /// Returns its scenario, for no posture in particular.
    ///
    /// # Errors
    /// [`StudyError`] naming the controller if the scenario does not exist or a key is wrong.
    pub fn load_unplaced(&self) -> Result<Scenario, StudyError> {
        let (name, _) = self.source(Posture::ElbowDown);
        Ok(Scenario::load_unplaced(name, &[])?)
    }

    /// Returns the converters that suit its arm: those of hardware for the paper's, its own for that of a scenario.
    pub fn usual_converters(&self) -> ConverterChoice {
        match self {
            Self::Scenario(_) => ConverterChoice::Own,
            _ => ConverterChoice::Hardware,
        }
    }

    /// Returns the built-in scenario or file for a posture, and the overrides to apply to it.
    fn source(&self, posture: Posture) -> (&str, &'static [&'static str]) {
        match (self, posture) {
            (Self::Pid, Posture::ElbowUp) => ("pid-elbow-up", &[]),
            (Self::Pid, Posture::ElbowDown) => ("pid-elbow-down", &[]),
            // The paper's K'_I is 650 from x0,d and 0 from x0,u.
            (Self::HybridPaper | Self::HybridPaperModel, Posture::ElbowUp) => (
                "paper-gains",
                &["controller.law.hybrid.force_integral_gain_per_s=0"],
            ),
            (Self::HybridPaper | Self::HybridPaperModel, Posture::ElbowDown) => {
                ("paper-gains", &[])
            }
            (Self::Hybrid, Posture::ElbowUp) => ("hybrid-elbow-up", &[]),
            (Self::Hybrid, Posture::ElbowDown) => ("hybrid-elbow-down", &[]),
            (Self::Scenario(name), _) => (name, &[]),
        }
    }
}

impl fmt::Display for ControllerChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pid => "pid",
            Self::HybridPaper => "hybrid-paper",
            Self::HybridPaperModel => "hybrid-paper-model",
            Self::Hybrid => "hybrid",
            Self::Scenario(name) => name,
        })
    }
}

impl FromStr for ControllerChoice {
    type Err = std::convert::Infallible;

    /// Any other name is a scenario, looked up when the case is made.
    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let known = Self::ALL
            .into_iter()
            .find(|controller| controller.to_string() == name);
        Ok(known.unwrap_or_else(|| Self::Scenario(name.into())))
    }
}

impl Serialize for ControllerChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The converters of a case (encoders, force cell, torque stages) and their sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum ConverterChoice {
    /// Close to the paper's continuous control: 10 kHz, at least 22 bits, no noise, no delay.
    Ideal,
    /// 1 kHz, 14-bit encoders, 12-bit force and torque, noise, a delay of one sample.
    Hardware,
    /// The converters of the controller's scenario.
    Own,
}

impl ConverterChoice {
    /// Returns the name of a scenario with these converters, for messages.
    fn origin(self, controller: &ControllerChoice) -> String {
        match self {
            Self::Ideal => format!("controller {controller} with ideal converters"),
            Self::Hardware => format!("controller {controller} with hardware converters"),
            Self::Own => format!("controller {controller}"),
        }
    }
}

/// The shape of the reference from the start to its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Minimum jerk, with its duration in s.
    MinimumJerk(f32),
    /// Constant speed, with its duration in s.
    Ramp(f32),
    /// A step.
    Step,
}

impl Reference {
    /// Returns its duration, s.
    pub fn duration_s(self) -> f64 {
        match self {
            Self::MinimumJerk(duration_s) | Self::Ramp(duration_s) => f64::from(duration_s),
            Self::Step => 0.0,
        }
    }

    /// Returns the reference to a target (m) as an entry of the controller's queue.
    pub fn to(self, target_m: f64) -> Program {
        let target_m = target_m as f32;
        let segment = match self {
            Self::MinimumJerk(duration_s) => Segment::MinimumJerk {
                target_m,
                duration_s,
            },
            Self::Ramp(duration_s) => Segment::Ramp {
                target_m,
                duration_s,
            },
            Self::Step => Segment::Step {
                target_m,
                duration_s: 0.0,
            },
        };
        Program {
            segments: [segment].into_iter().collect(),
        }
    }
}

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MinimumJerk(duration_s) => write!(f, "minimum-jerk:{duration_s}"),
            Self::Ramp(duration_s) => write!(f, "ramp:{duration_s}"),
            Self::Step => f.write_str("step"),
        }
    }
}

impl FromStr for Reference {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = || {
            format!("'{text}' is not a reference; give minimum-jerk:SECONDS, ramp:SECONDS or step")
        };
        let Some((kind, seconds)) = text.split_once(':') else {
            return (text == "step").then_some(Self::Step).ok_or_else(allowed);
        };
        let duration_s: f32 = seconds.parse().map_err(|_| allowed())?;
        if !(1e-3..=1e4).contains(&duration_s) {
            return Err(format!(
                "'{text}' lasts {duration_s} s; a reference lasts 0.001 to 10000 s"
            ));
        }
        match kind {
            "minimum-jerk" => Ok(Self::MinimumJerk(duration_s)),
            "ramp" => Ok(Self::Ramp(duration_s)),
            _ => Err(allowed()),
        }
    }
}

impl Serialize for Reference {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Returns the initial state of a closed loop in a posture, far from the edge that a tip meets with this slip: the paper's
/// x0,d or x0,u; for an arm of another shape or the other slip, at rest on the belt at the same fraction of its reach.
///
/// # Errors
/// [`StudyError::Range`] if the arm is out of range.
pub fn start(
    arm: &ArmParameters<f64>,
    posture: Posture,
    slip: Slip,
) -> Result<InitialState, StudyError> {
    let arm = Arm::new(*arm)?;
    let initial = match posture {
        Posture::ElbowDown => Initial::D,
        Posture::ElbowUp => Initial::U,
    };
    match initial.angles_deg(&arm).filter(|_| slip == Slip::Positive) {
        Some([theta_1, theta_2]) => Ok(InitialState::at_rest(theta_1, theta_2)),
        None => at_rest_on_belt(&arm, -START * arm.reach_on_belt_m(), posture),
    }
}

/// Returns an arm at rest in a posture with its tip on the belt at `tip_t_m` (m).
///
/// # Errors
/// [`StudyError`] if the position is out of reach.
pub fn at_rest_on_belt(
    arm: &Arm<f64>,
    tip_t_m: f64,
    posture: Posture,
) -> Result<InitialState, StudyError> {
    let theta = arm
        .link_angles_on_belt_rad(tip_t_m, posture)
        .ok_or_else(|| StudyError::OutOfReach {
            tip_t_m,
            reach_m: arm.reach_on_belt_m(),
        })?;
    Ok(InitialState::at_rest(
        theta.first().to_degrees(),
        theta.second().to_degrees(),
    ))
}

/// Returns the scenario of a case: the controller's scenario without its reference, then the
/// converters, then the overrides in the order given, then the start in the posture.
///
/// # Errors
/// [`StudyError`] naming the controller if the scenario does not exist or a key is wrong.
pub fn scenario(
    controller: &ControllerChoice,
    posture: Posture,
    converters: ConverterChoice,
    overrides: &[String],
) -> Result<Scenario, StudyError> {
    let (name, changes) = controller.source(posture);
    let changes: Vec<String> = changes.iter().map(ToString::to_string).collect();
    let mut scenario = Scenario::load_unplaced(name, &changes)?;
    // The scenario's own start may be out of reach of the arm to study.
    scenario.controller.reference = Program::default();
    match converters {
        ConverterChoice::Ideal => {
            let ideal = Scenario::load_unplaced("paper-gains", &[])?;
            scenario.run.tick_hz = ideal.run.tick_hz;
            scenario.converters = ideal.converters;
            if *controller == ControllerChoice::Pid {
                scenario.controller.estimator = ideal.controller.estimator;
            }
        }
        ConverterChoice::Hardware => {
            scenario.run.tick_hz = RunSettings::default().tick_hz;
            scenario.converters = ConverterSettings::default();
            if let ControllerChoice::HybridPaper | ControllerChoice::HybridPaperModel = controller {
                // These gains need the wide control loop of the PID scenario.
                let wide = Scenario::load_unplaced("pid-elbow-down", &[])?;
                scenario.controller.estimator = wide.controller.estimator;
            }
        }
        ConverterChoice::Own => {}
    }
    let origin = converters.origin(controller);
    let mut scenario = scenario.with_overrides(&origin, overrides)?;
    if *controller == ControllerChoice::HybridPaperModel {
        let (friction, speed_m_s) = (scenario.belt.friction, scenario.belt.profile.speed_m_s(0.0));
        let model = format!(
            "controller.law.hybrid.friction={{ model = {{ friction = {friction:?}, belt_speed_m_s = {speed_m_s:?} }} }}"
        );
        scenario = scenario.with_overrides(&origin, &[model])?;
    }
    scenario.initial = start(&scenario.arm, posture, scenario.slip_at_rest())?;
    Ok(scenario)
}

/// Returns the seed of each controller's converters, named `noise of hybrid` and so on.
///
/// # Errors
/// [`StudyError`] naming the controller if the scenario does not exist or a key is wrong.
pub fn noise_seeds(
    controllers: &[ControllerChoice],
    overrides: &[String],
) -> Result<BTreeMap<String, u64>, StudyError> {
    let seed = |controller| {
        let scenario = scenario(
            controller,
            Posture::ElbowDown,
            ConverterChoice::Own,
            overrides,
        )?;
        Ok((format!("noise of {controller}"), scenario.run.seed))
    };
    controllers.iter().map(seed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_firmware::law::LawSettings;

    #[test]
    fn cases_are_the_built_in_scenarios_behind_other_converters() {
        for posture in [Posture::ElbowUp, Posture::ElbowDown] {
            for controller in ControllerChoice::ALL {
                for converters in [ConverterChoice::Ideal, ConverterChoice::Hardware] {
                    let scenario = scenario(&controller, posture, converters, &[]).unwrap();
                    let ideal = converters == ConverterChoice::Ideal;
                    assert_eq!(scenario.run.tick_hz, if ideal { 10_000 } else { 1000 });
                    assert_eq!(
                        scenario.converters.encoder.bits,
                        if ideal { 24 } else { 14 }
                    );
                    let theta = painleve_plant::mechanics::motion::theta(
                        &scenario.initial.state(&scenario.arm).unwrap(),
                    );
                    assert_eq!(Posture::of(&theta), posture);
                }
            }
        }
        let own = |posture| {
            scenario(
                &ControllerChoice::HybridPaper,
                posture,
                ConverterChoice::Own,
                &[],
            )
            .unwrap()
        };
        let integral = |scenario: Scenario| match scenario.controller.law.of_set() {
            Some(LawSettings::Hybrid(law)) => law.force_integral_gain_per_s,
            _ => panic!("not the hybrid law"),
        };
        assert_eq!(integral(own(Posture::ElbowDown)), 650.0);
        assert_eq!(integral(own(Posture::ElbowUp)), 0.0);
    }

    #[test]
    fn overrides_come_last_and_an_arm_of_another_shape_starts_on_the_belt() {
        for shape in [
            "arm.height_m=0.36",
            "arm.height_m=0.415",
            "arm.link_length_m=[0.3, 0.2]",
        ] {
            let case = scenario(
                &ControllerChoice::Hybrid,
                Posture::ElbowUp,
                ConverterChoice::Ideal,
                &["run.tick_hz=2000".into(), shape.into()],
            )
            .unwrap();
            assert_eq!(case.run.tick_hz, 2000);
            let plant = painleve_plant::mechanics::ArmOnBelt::new(
                &case.plant_parameters(),
                case.initial.state(&case.arm).unwrap(),
            )
            .unwrap();
            let start_m = START * plant.arm().reach_on_belt_m();
            assert!((plant.motion().tip_t_m(plant.state()) - start_m).abs() < 1e-12);
            assert!(plant.motion().gap_m(plant.state()).abs() < 1e-15);
        }
    }

    #[test]
    fn references_round_trip_through_text() {
        for text in ["minimum-jerk:3", "ramp:2.5", "step"] {
            assert_eq!(text.parse::<Reference>().unwrap().to_string(), text);
        }
        for text in [
            "", "jerk", "jerk:3", "ramp", "ramp:", "ramp:0", "ramp:-1", "ramp:nan", "step:1",
        ] {
            assert!(
                text.parse::<Reference>().unwrap_err().contains(text),
                "{text}"
            );
        }
        let error = "ramp:1e9".parse::<Reference>().unwrap_err();
        assert!(error.contains("0.001 to 10000 s"), "{error}");
    }

    #[test]
    fn an_unknown_controller_is_reported_with_the_known_ones() {
        let Ok(controller) = "no-such-law".parse::<ControllerChoice>();
        let error = scenario(&controller, Posture::ElbowUp, ConverterChoice::Own, &[]).unwrap_err();
        assert!(error.to_string().contains("no-such-law"), "{error}");
    }
}
