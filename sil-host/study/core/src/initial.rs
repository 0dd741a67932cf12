//! Initial conditions of a bifurcation study: the paper's by letter, or drawn at random.
//!
//! Random initial conditions come from a ChaCha stream numbered by the row. A row is therefore
//! the same wherever and whenever it is computed.

use core::fmt;

use painleve_plant::State;
use painleve_plant::scenario::InitialState;
use painleve_shared::{Arm, ArmParameters, Posture};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// The initial condition of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// The paper's x0,a: θ = (32°, 18.27°), at rest on the belt, in the paradox. An arm of another shape starts in the same
    /// posture at the same fraction of its reach, as from `D` and `U`.
    A,
    /// The paper's x0,d: θ = (−11.4°, −35.1°), at rest on the belt, elbow down.
    D,
    /// The paper's x0,u: θ = (−35.1°, −11.4°), at the same place, elbow up.
    U,
    /// A random initial condition, by its number within its cell, from 1.
    Random(u32),
}

/// A list of initial conditions, for example `a,d,random:3`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Initials(Vec<Initial>);

/// Largest number of random initial conditions per cell.
const MOST_RANDOM: u32 = 1_000_000;

impl Initials {
    /// The initial conditions in order; at least one.
    pub fn list(&self) -> &[Initial] {
        &self.0
    }
}

impl core::str::FromStr for Initials {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut list: Vec<Initial> = Vec::new();
        for part in text.split(',').map(str::trim) {
            let more: Vec<Initial> = match (part, part.split_once(':')) {
                (_, Some(("random", number))) => match number.parse() {
                    Ok(number @ 1..=MOST_RANDOM) => (1..=number).map(Initial::Random).collect(),
                    _ => {
                        return Err(format!(
                            "'{part}' in '{text}': the number must be from 1 to {MOST_RANDOM}"
                        ));
                    }
                },
                ("a", _) => vec![Initial::A],
                ("d", _) => vec![Initial::D],
                ("u", _) => vec![Initial::U],
                _ => {
                    return Err(format!(
                        "'{part}' in '{text}' is not an initial condition; give a, d, u or random:N, for example a,d,random:3"
                    ));
                }
            };
            if more.first().is_some_and(|first| list.contains(first)) {
                return Err(format!(
                    "'{part}' appears twice in '{text}'; give every initial condition once"
                ));
            }
            list.extend(more);
        }
        Ok(Self(list))
    }
}

impl fmt::Display for Initial {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random(number) => write!(formatter, "random:{number}"),
            _ => formatter.write_str(self.group()),
        }
    }
}

/// Largest tip height of a random start above the belt, m.
const RANDOM_HEIGHT_M: f64 = 0.03;

/// Largest rate of a joint in a random start, rad/s.
const RANDOM_RATE_RAD_S: f64 = 5.0;

/// z_t of the paper's x0,d and x0,u as a fraction of the reach: −0.1624 m of 0.1841 m.
pub(crate) const START: f64 = -0.882;

/// z_t of the paper's x0,a: 0.1771 m of 0.1841 m.
const INCONSISTENT: f64 = 0.962;

/// Fraction of the reach in which random starts lie; at the full reach the arm is straight.
const RANDOM_REACH: f64 = 0.98;

impl Initial {
    /// Returns its name without a number.
    pub fn group(self) -> &'static str {
        match self {
            Self::A => "a",
            Self::D => "d",
            Self::U => "u",
            Self::Random(_) => "random",
        }
    }

    /// Returns θ1 and θ2 of an arm, degrees; `None` if they are random.
    pub fn angles_deg(self, arm: &Arm<f64>) -> Option<[f64; 2]> {
        let [theta_1, theta_2] = InitialState::X0_D_DEG;
        let (of_paper, share, posture) = match self {
            Self::A => ([32.0, 18.27], INCONSISTENT, Posture::ElbowDown),
            Self::D => ([theta_1, theta_2], START, Posture::ElbowDown),
            Self::U => ([theta_2, theta_1], START, Posture::ElbowUp),
            Self::Random(_) => return None,
        };
        let paper = ArmParameters::<f64>::default();
        if (arm.link_length_m(), arm.height_m()) == (paper.link_length_m, paper.height_m) {
            return Some(of_paper);
        }
        let theta = arm.link_angles_on_belt_rad(share * arm.reach_on_belt_m(), posture)?;
        Some(theta.to_array().map(f64::to_degrees))
    }

    /// Returns the initial state for an arm. A random one has its tip anywhere within reach, up to 3 cm
    /// above the belt (less above a high belt), the elbow on either side and each joint rate at up to
    /// 5 rad/s. It depends only on
    /// `seed`, `row` and the arm.
    pub fn state(self, arm: &Arm<f64>, seed: u64, row: u64) -> State {
        match self.angles_deg(arm) {
            Some(angles) => {
                let [theta_1, theta_2] = angles.map(f64::to_radians);
                State::new(theta_1, theta_2, 0.0, 0.0)
            }
            None => random_state(arm, seed, row),
        }
    }
}

fn random_state(arm: &Arm<f64>, seed: u64, row: u64) -> State {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(row);
    // Avoids the hole around the first joint that links of unequal lengths leave.
    let over_hole_m = RANDOM_REACH * (arm.height_m() - arm.hole_m());
    let highest_m = (arm.height_m() * 0.5).min(over_hole_m).min(RANDOM_HEIGHT_M);
    let height_m = highest_m * generator.random::<f64>();
    let depth_m = arm.height_m() - height_m;
    let reach_m = arm.reach_m();
    let widest_m = RANDOM_REACH * libm::sqrt((reach_m - depth_m) * (reach_m + depth_m));
    let mut symmetric = |limit: f64| generator.random_range(-limit..=limit);
    let tip_m = nalgebra::Vector2::new(symmetric(widest_m), -depth_m);
    let rates = [(); 2].map(|()| symmetric(RANDOM_RATE_RAD_S));
    let posture = if generator.random() {
        Posture::ElbowUp
    } else {
        Posture::ElbowDown
    };
    // Within reach by construction, also straight down.
    let theta = arm
        .link_angles_rad(&tip_m, posture)
        .unwrap_or_else(painleve_shared::LinkMotion::zeros);
    State::new(theta.first(), theta.second(), rates[0], rates[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::mechanics::motion::theta;
    use painleve_plant::mechanics::{ArmOnBelt, PlantParameters};
    use painleve_shared::Pose;
    use proptest::prelude::*;

    #[test]
    fn lists_are_read_and_written() {
        let list: Initials = "a, d,u,random:2".parse().unwrap();
        let names: Vec<String> = list.list().iter().map(ToString::to_string).collect();
        assert_eq!(names, ["a", "d", "u", "random:1", "random:2"]);
    }

    #[test]
    fn invalid_lists_are_reported_with_the_allowed_form() {
        for (text, part) in [
            (
                "",
                "'' in '' is not an initial condition; give a, d, u or random:N",
            ),
            ("a,b", "'b' in 'a,b'"),
            ("random", "'random' in 'random' is not"),
            ("random:0", "from 1 to 1000000"),
            ("random:x", "from 1 to"),
            ("random:-1", "from 1 to"),
            ("a,d,a", "'a' appears twice"),
            ("random:2,random:3", "'random:3' appears twice"),
        ] {
            let message = text.parse::<Initials>().unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn an_arm_of_another_shape_starts_like_the_papers_at_the_same_fraction_of_its_reach() {
        let other = ArmParameters {
            link_length_m: [0.6, 0.5],
            height_m: 0.99,
            ..Default::default()
        };
        for (initial, posture) in [
            (Initial::A, Posture::ElbowDown),
            (Initial::D, Posture::ElbowDown),
            (Initial::U, Posture::ElbowUp),
        ] {
            let [paper, other] = [ArmParameters::default(), other].map(|parameters| {
                let arm = Arm::new(parameters).unwrap();
                let theta = theta(&initial.state(&arm, 1, 0));
                assert_eq!(Posture::of(&theta), posture);
                let pose = Pose::new(&theta);
                assert!(arm.gap_m(&pose).abs() < 1e-3);
                arm.tip_m(&pose).x / arm.reach_on_belt_m()
            });
            assert!((paper - other).abs() < 1e-3, "{initial}: {paper} {other}");
        }
    }

    proptest! {
        /// The plant, which refuses starts inside the belt, accepts them too.
        #[test]
        fn random_states_are_all_different_and_over_the_belt(
            seed: u64, row in 0_u64..u64::MAX, height_m in 0.05_f64..0.41,
        ) {
            let parameters = PlantParameters {
                arm: ArmParameters { height_m, ..Default::default() },
                ..Default::default()
            };
            let arm = Arm::new(parameters.arm).unwrap();
            let state = Initial::Random(1).state(&arm, seed, row);
            prop_assert_eq!(state, Initial::Random(1).state(&arm, seed, row));
            prop_assert!(state != Initial::Random(1).state(&arm, seed, row + 1));
            prop_assert!(state != Initial::Random(1).state(&arm, seed ^ 1, row));
            prop_assert!(ArmOnBelt::new(&parameters, state).is_ok());
        }
    }
}
