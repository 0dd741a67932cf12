//! The long-term motion of an arm, as plain numbers.

use painleve_plant::mechanics::{ArmOnBelt, MotionError};
use painleve_plant::{ContactMode, Event, Probe, Snapshot, State, Step};

use crate::settled::has_settled;

/// Extremes and counts over a time interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attractor {
    /// Largest θ̇1, rad/s: the paper's measure, above zero where the arm keeps bouncing.
    pub max_theta1_dot_rad_s: f64,
    /// Largest tip height over the belt, m.
    pub apex_m: f64,
    /// Number of impacts with the belt, collisions included.
    pub impacts: u64,
    /// Time in contact, s.
    pub contact_s: f64,
    /// Time off the belt, s.
    pub flight_s: f64,
}

/// Interval between checks whether the arm has settled, s.
const SETTLING_LOOK_S: f64 = 1.0;

/// Index of θ̇1 in the state.
const RATE: usize = 2;

impl Default for Attractor {
    fn default() -> Self {
        Self {
            max_theta1_dot_rad_s: f64::NEG_INFINITY,
            apex_m: 0.0,
            impacts: 0,
            contact_s: 0.0,
            flight_s: 0.0,
        }
    }
}

impl Attractor {
    /// Returns the motion during `record_s`, after `transient_s`. Stops integrating a plant that has
    /// settled permanently.
    ///
    /// # Errors
    /// [`MotionError`] if the plant cannot continue.
    pub fn of(plant: &mut ArmOnBelt, transient_s: f64, record_s: f64) -> Result<Self, MotionError> {
        let mut attractor = Self::default();
        if advance_or_settle(plant, transient_s)? {
            attractor.contact_s = record_s;
            attractor.max_theta1_dot_rad_s = plant.state()[RATE];
        } else {
            plant.advance(plant.time_s() + record_s, &mut attractor)?;
        }
        Ok(attractor)
    }

    /// Whether the tip keeps leaving the belt.
    pub fn is_bouncing(&self) -> bool {
        self.flight_s > 0.0
    }

    /// Returns the fraction of the time in contact, 0 … 1.
    pub fn contact_fraction(&self) -> f64 {
        self.contact_s / (self.contact_s + self.flight_s)
    }
}

/// Runs a plant for `duration_s`. Returns early, with `true`, if it has settled permanently.
///
/// # Errors
/// [`MotionError`] if the plant cannot continue.
pub fn advance_or_settle(plant: &mut ArmOnBelt, duration_s: f64) -> Result<bool, MotionError> {
    let start_s = plant.time_s();
    let looks = (duration_s / SETTLING_LOOK_S).ceil() as u64;
    for look in 1..=looks {
        // Computed from whole numbers, so that rounding does not accumulate.
        let elapsed_s = (look as f64 * SETTLING_LOOK_S).min(duration_s);
        plant.advance(start_s + elapsed_s, &mut ())?;
        if has_settled(plant) {
            return Ok(true);
        }
    }
    Ok(false)
}

impl Probe for Attractor {
    fn step(&mut self, step: &dyn Step) {
        let (start, end) = (step.start(), step.end());
        let duration_s = end.time_s - start.time_s;
        let rate = |at: &Snapshot| [at.theta_dot_rad_s.first(), at.theta_ddot_rad_s2.first()];
        let fastest = cubic_maximum(duration_s, rate(&start), rate(&end));
        self.max_theta1_dot_rad_s = self.max_theta1_dot_rad_s.max(fastest);
        if step.mode() == ContactMode::Flight {
            self.flight_s += duration_s;
            let height = |at: &Snapshot| [at.gap_m, at.gap_rate_m_s];
            let highest = cubic_maximum(duration_s, height(&start), height(&end));
            self.apex_m = self.apex_m.max(highest);
        } else {
            self.contact_s += duration_s;
        }
    }

    fn event(&mut self, _: f64, event: Event, state: &State) {
        self.max_theta1_dot_rad_s = self.max_theta1_dot_rad_s.max(state[RATE]);
        if !matches!(event, Event::ModeChange { .. }) {
            self.impacts += 1;
        }
    }
}

/// Returns the maximum of the cubic with these values and slopes at both ends of an interval of
/// length `h`.
fn cubic_maximum(h: f64, [v0, s0]: [f64; 2], [v1, s1]: [f64; 2]) -> f64 {
    let ends = v0.max(v1);
    if !(s0 > 0.0 || s1 < 0.0) {
        return ends;
    }
    // value = v0 + s0 h x + c x² + d x³ on 0 … 1.
    let (rise, difference) = (h * s0, v1 - v0);
    let c = 3.0 * difference - 2.0 * rise - h * s1;
    let d = rise + h * s1 - 2.0 * difference;
    let root = (c * c - 3.0 * d * rise).max(0.0).sqrt();
    // The zero of the slope where the slope falls, in the form without cancellation.
    let at = if c <= 0.0 {
        rise / (root - c)
    } else {
        (-c - root) / (3.0 * d)
    };
    if at > 0.0 && at < 1.0 {
        ends.max(v0 + at * (rise + at * (c + at * d)))
    } else {
        ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::mechanics::PlantParameters;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_maximum_of_a_cubic_is_found(
            c in proptest::array::uniform4(-2.0_f64..2.0), h in 0.01_f64..2.0,
        ) {
            let value = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
            let slope = |t: f64| c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]);
            let seen = (0..=1000).map(|i| value(h * f64::from(i) / 1000.0)).fold(f64::MIN, f64::max);
            let found = cubic_maximum(h, [value(0.0), slope(0.0)], [value(h), slope(h)]);
            prop_assert!((found - seen).abs() < 1e-5 && found > seen - 1e-12, "{found} {seen}");
        }
    }

    fn plant(theta1_deg: f64, theta2_deg: f64) -> ArmOnBelt {
        let initial = State::new(theta1_deg.to_radians(), theta2_deg.to_radians(), 0.0, 0.0);
        ArmOnBelt::new(&PlantParameters::default(), initial).unwrap()
    }

    #[test]
    fn bouncing_and_sliding_are_distinguished() {
        let bouncing = Attractor::of(&mut plant(32.0, 18.27), 20.0, 10.0).unwrap();
        assert!(bouncing.is_bouncing());
        assert!(bouncing.max_theta1_dot_rad_s > 4.0, "{bouncing:?}");
        assert!(bouncing.impacts > 50);
        assert!(
            bouncing.apex_m > 1e-3 && bouncing.apex_m < 0.1,
            "{bouncing:?}"
        );
        assert!((bouncing.contact_s + bouncing.flight_s - 10.0).abs() < 1e-9);

        let mut settling = plant(-11.4, -35.1);
        let quiet = Attractor::of(&mut settling, 250.0, 50.0).unwrap();
        assert!(!quiet.is_bouncing());
        assert_eq!((quiet.contact_fraction(), quiet.impacts), (1.0, 0));
        assert!(quiet.max_theta1_dot_rad_s.abs() < 1e-9);
        assert!(settling.time_s() < 200.0);
    }

    /// Integrating further would not have changed the motion.
    #[test]
    fn an_early_stop_does_not_change_the_result() {
        let early = Attractor::of(&mut plant(-11.4, -35.1), 250.0, 50.0).unwrap();
        let mut late = Attractor::default();
        let mut plant = plant(-11.4, -35.1);
        plant.advance(250.0, &mut ()).unwrap();
        plant.advance(300.0, &mut late).unwrap();
        assert_eq!(early.is_bouncing(), late.is_bouncing());
        assert!((early.max_theta1_dot_rad_s - late.max_theta1_dot_rad_s).abs() < 1e-9);
        assert!((early.contact_s - late.contact_s).abs() < 1e-9);
    }
}
