//! Where the tip may be set down before the drive is armed.
//!
//! The governor keeps the reference off the edges, but nothing holds back a tip that starts beyond them: there it may be
//! thrown off before the controller has seen its friction.

use core::ops::Range;

use painleve_firmware::estimate::friction::FrictionEstimate;
use painleve_firmware::refer::governor::{EdgeGovernor, Stretch};
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, OutOfRange, Pose, Posture, Slip};

/// Standard deviation of the belt's friction as commissioning measures it, as a part of μ.
const FRICTION_KNOWN: f32 = 0.05;

/// Part of the reach within which an arm is not nearly straight.
const BENT: f32 = 0.75;

/// Places on either side that are tried as the best one.
const PLACES: i16 = 40;

/// Most calls of the governor's search until both edges are known.
const MOST_CALLS: u32 = 200;

/// Where a tip may be set down in a posture, on a belt with the friction and the direction of the scenario's; in both
/// directions if that belt stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct SetDown {
    /// Where p is largest, as far as the tip's place is known, m.
    pub best_m: f64,
    /// The stretch around it in which the governor would let the tip rest, m; `None` if it would not even there.
    pub stretch_m: Option<Range<f64>>,
}

impl SetDown {
    /// Finds the place for a scenario's arm as its controller knows it.
    ///
    /// # Errors
    /// [`OutOfRange`] for an arm that cannot be built.
    pub fn of(scenario: &Scenario, posture: Posture) -> Result<Self, OutOfRange> {
        let configuration = scenario.controller_configuration();
        let arm = Arm::new(configuration.arm)?;
        let coefficient = scenario.belt.friction as f32;
        let deviation = FRICTION_KNOWN * coefficient;
        let speed_m_s = scenario.belt.profile.speed_m_s(0.0);
        let friction = FrictionEstimate {
            coefficient,
            variance: deviation * deviation,
            slip: Slip::of(-speed_m_s),
            slip_seen: speed_m_s != 0.0,
            ..Default::default()
        };
        let reach_m = arm.reach_on_belt_m();
        let farthest_m = BENT * reach_m;
        let place_m = |place: i16| farthest_m * f32::from(place) / f32::from(PLACES);
        let slips = if friction.slip_seen {
            [friction.slip; 2]
        } else {
            [Slip::Positive, Slip::Negative]
        };
        let p_per_kg = |there_m: f32| {
            let theta_rad = arm.link_angles_on_belt_rad(there_m, posture);
            theta_rad.map_or(f32::MIN, |theta_rad| {
                let pose = Pose::new(&theta_rad);
                let [one, other] = slips.map(|slip| arm.p_per_kg(&pose, coefficient, slip));
                one.min(other)
            })
        };
        let settings = &configuration.settings.governor;
        let (tick_s, away_m) = (configuration.tick_s(), configuration.kept_distance_m());
        let least_p = |place_m: f32| p_per_kg(place_m - away_m).min(p_per_kg(place_m + away_m));
        let places = (-PLACES..=PLACES).map(place_m);
        let best_m = places
            .max_by(|one, other| least_p(*one).total_cmp(&least_p(*other)))
            .unwrap_or_default();
        let mut governor = EdgeGovernor::new(settings, tick_s, away_m, reach_m);
        let found = (0..MOST_CALLS).find_map(|_| {
            governor.search(&arm, posture, best_m, &friction, 0.0);
            let is_found = governor.has_edges_for(posture, 0.0);
            is_found.then_some(governor.stretch)
        });
        let clipped = |it: Stretch| {
            f64::from(it.lower_m.max(-farthest_m))..f64::from(it.upper_m.min(farthest_m))
        };
        let best_m = f64::from(best_m);
        Ok(Self {
            best_m,
            stretch_m: found.map(clipped).filter(|it| it.contains(&best_m)),
        })
    }
}

/// Returns what an operator is told of both postures.
///
/// # Errors
/// As [`SetDown::of`].
pub fn advice(scenario: &Scenario) -> Result<String, OutOfRange> {
    let mut places = Vec::new();
    for (posture, side) in [
        (Posture::ElbowDown, "towards +t"),
        (Posture::ElbowUp, "away from +t"),
    ] {
        let SetDown { best_m, stretch_m } = SetDown::of(scenario, posture)?;
        let best_mm = 1e3 * best_m;
        places.push(match stretch_m {
            Some(Range { start, end }) => format!(
                "elbow {side}: {:.0} to {:.0} mm, best {best_mm:.0} mm",
                1e3 * start,
                1e3 * end
            ),
            None => format!("elbow {side}: {best_mm:.0} mm, but p is too small even there"),
        });
    }
    Ok(format!(
        "Set the tip down here, seen from the point below joint 1 (friction coefficient {:.2}): {}. Farther out, the tip may be thrown off at the start.",
        scenario.belt.friction,
        places.join("; ")
    )
    .replace(" -", " −"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set_down(overrides: &[&str], posture: Posture) -> SetDown {
        let overrides: Vec<String> = overrides.iter().map(ToString::to_string).collect();
        let scenario = Scenario::load("edge", &overrides).unwrap();
        SetDown::of(&scenario, posture).unwrap()
    }

    fn stretch(overrides: &[&str], posture: Posture) -> Range<f64> {
        let SetDown { best_m, stretch_m } = set_down(overrides, posture);
        let stretch_m = stretch_m.unwrap();
        assert!(stretch_m.contains(&best_m));
        stretch_m
    }

    #[test]
    fn the_stretch_shrinks_with_what_is_not_known_and_never_reaches_the_straight_arm() {
        let known = stretch(&[], Posture::ElbowDown);
        // 0.75 of the reach; p = 0 at 0.16471 m.
        assert!((known.end - 0.13808).abs() < 1e-5, "{known:?}");
        let drawn = |deviation_m: f64| {
            let key = format!("controller.estimator.tip_deviation_m={deviation_m}");
            stretch(&[&key], Posture::ElbowDown).end
        };
        let (one, two) = (drawn(0.02), drawn(0.03));
        assert!(one < 0.13 && (one - two - 0.02).abs() < 1e-3, "{one} {two}");
    }

    #[test]
    fn a_belt_that_stands_may_start_in_either_direction() {
        let still = "belt.profile={ kind = 'constant', speed_m_s = 0.0 }";
        let moving = stretch(&[], Posture::ElbowDown);
        let standing = stretch(&[still], Posture::ElbowDown);
        assert!(standing.start >= moving.start && standing.end <= moving.end);
        let mirrored = stretch(&[still], Posture::ElbowUp);
        assert!((standing.start + mirrored.end).abs() < 1e-4);
    }

    #[test]
    fn the_operator_is_told_both_postures_and_where_nothing_is_enough() {
        let scenario = Scenario::load("edge", &[]).unwrap();
        let told = advice(&scenario).unwrap();
        assert!(told.contains("towards +t: −1"), "{told}");
        let least = "controller.governor.p_per_kg=100".to_owned();
        let scenario = Scenario::load("edge", &[least]).unwrap();
        assert_eq!(advice(&scenario).unwrap().matches("too small").count(), 2);
    }
}
