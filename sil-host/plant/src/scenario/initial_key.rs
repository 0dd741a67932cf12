//! The two ways to give the start of the arm, of which a scenario has one: `initial.theta1_deg` and
//! `initial.theta2_deg`, or `initial.tip_m` with `initial.elbow`.

use super::InitialState;
use super::error::KeyError;

/// The place of the tip.
const TIP: &str = "initial.tip_m";
/// The side of the elbow.
const ELBOW: &str = "initial.elbow";
/// The angles.
const ANGLES: [&str; 2] = ["initial.theta1_deg", "initial.theta2_deg"];

/// Checks that a start is given in one way.
///
/// # Errors
/// The key that does not fit the others, and why.
pub(super) fn check(initial: &InitialState) -> Result<(), (&'static str, KeyError)> {
    let Some(_) = initial.tip_m else {
        return match initial.elbow {
            Some(_) => Err((ELBOW, KeyError::Needs { other: TIP.into() })),
            None => Ok(()),
        };
    };
    let angles = [initial.theta1_deg, initial.theta2_deg];
    match ANGLES
        .into_iter()
        .zip(angles)
        .find(|(_, angle)| angle.is_some())
    {
        Some((other, _)) => Err((
            TIP,
            KeyError::Excludes {
                other: other.into(),
            },
        )),
        None => Ok(()),
    }
}

/// Returns a start without what the override of `key` replaces: of the two ways, the later one counts.
pub(super) fn before_override(initial: InitialState, key: &str) -> InitialState {
    match key {
        TIP => InitialState {
            theta1_deg: None,
            theta2_deg: None,
            ..initial
        },
        _ if ANGLES.contains(&key) => InitialState {
            tip_m: None,
            elbow: None,
            ..initial
        },
        _ => initial,
    }
}

#[cfg(test)]
mod tests {
    use crate::mechanics::motion::theta;
    use crate::scenario::{Scenario, ScenarioError};
    use painleve_shared::Arm;
    use painleve_shared::kinematics::{Pose, Posture};

    fn load(text: &str, overrides: &[&str]) -> Result<Scenario, ScenarioError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.toml");
        std::fs::write(&path, text).unwrap();
        let overrides: Vec<_> = overrides.iter().map(ToString::to_string).collect();
        Scenario::load(&path.display().to_string(), &overrides)
    }

    /// Returns where the tip starts, its height over the belt, and the side of the elbow.
    fn start(scenario: &Scenario) -> (f64, f64, Posture) {
        let theta = theta(&scenario.initial.state(&scenario.arm).unwrap());
        let (arm, pose) = (Arm::new(scenario.arm).unwrap(), Pose::new(&theta));
        (arm.tip_m(&pose).x, arm.gap_m(&pose), Posture::of(&theta))
    }

    #[test]
    fn a_tip_on_the_belt_is_a_start_for_any_arm() {
        let text = "initial = { tip_m = 0.05, elbow = \"up\" }";
        for changes in [
            &[][..],
            &["arm.height_m=0.39"],
            &["arm.link_length_m=[0.26, 0.19]"],
        ] {
            let (tip_m, gap_m, posture) = start(&load(text, changes).unwrap());
            assert!(
                (tip_m - 0.05).abs() < 1e-12 && gap_m.abs() < 1e-12,
                "{tip_m} {gap_m}"
            );
            assert_eq!(posture, Posture::ElbowUp);
        }
        let down = start(&load("initial.tip_m = -0.1", &[]).unwrap());
        assert_eq!(down.2, Posture::ElbowDown);
    }

    #[test]
    fn the_later_override_counts() {
        let tip = load(
            "initial.theta1_deg = -11.4",
            &["initial.tip_m=0.02", "initial.elbow=up"],
        );
        assert!((start(&tip.unwrap()).0 - 0.02).abs() < 1e-12);
        let text = "initial = { tip_m = 0.02, elbow = \"up\" }";
        let angles = load(text, &["initial.theta1_deg=32", "initial.theta2_deg=18.27"]).unwrap();
        assert_eq!(
            angles.initial,
            crate::scenario::InitialState::at_rest(32.0, 18.27)
        );
    }

    #[test]
    fn a_start_with_comments_is_read_again() {
        let scenario = load("initial = { tip_m = 0.05, elbow = \"up\" }", &[]).unwrap();
        let read = Scenario::from_toml(&scenario.to_commented_toml()).unwrap();
        assert_eq!(read, scenario);
    }

    #[test]
    fn what_cannot_be_a_start_is_refused_with_key_value_and_range() {
        for (text, overrides, parts) in [
            (
                "initial = { tip_m = 0.3 }",
                &[][..],
                &[
                    "mine.toml",
                    "initial.tip_m = 0.3 is outside the allowed range -0.184102 to 0.184102",
                ][..],
            ),
            (
                "initial.tip_m = 30",
                &[],
                &["initial.tip_m = 30", "-20 to 20"],
            ),
            (
                "run.seed = 1",
                &["initial.tip_m=0.2"],
                &["initial.tip_m = 0.2", "0.184"],
            ),
            (
                "initial = { tip_m = 0.1, theta2_deg = 3.0 }",
                &[],
                &["initial.tip_m: it cannot be combined with initial.theta2_deg"],
            ),
            (
                "initial.elbow = \"up\"",
                &[],
                &["initial.elbow: initial.tip_m is missing"],
            ),
            (
                "initial = { tip_m = 0.1, elbow = \"left\" }",
                &[],
                &["initial.elbow", "unknown name 'left'; known: down, up"],
            ),
            (
                "run.seed = 1",
                &["initial.tip_t=0.1"],
                &["did you mean 'tip_m'?", "elbow"],
            ),
        ] {
            let message = load(text, overrides).unwrap_err().to_string();
            for part in parts {
                assert!(message.contains(part), "{part} is not in: {message}");
            }
        }
    }
}
