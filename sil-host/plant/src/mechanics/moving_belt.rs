//! A belt in motion, whose profile may be replaced at any time.

use super::belt::BeltProfile;

/// The speed of a belt, without its jumps: an integration step that ends at a jump ends at the speed before it, and the next
/// step starts at the speed after it.
#[derive(Clone, Debug)]
pub struct MovingBelt {
    /// The profile until the next jump.
    profile: BeltProfile,
    /// Time (s) of the next jump, and the profile from then on.
    jump: Option<(f64, BeltProfile)>,
    /// Displacement at present minus that by the profile alone, m.
    offset_m: f64,
}

impl MovingBelt {
    /// Starts a belt at time zero.
    pub fn new(profile: &BeltProfile) -> Self {
        let mut belt = Self {
            profile: BeltProfile::default(),
            jump: None,
            offset_m: 0.0,
        };
        belt.replace(0.0, profile);
        belt
    }

    /// Gives the belt another profile from time `t_s` on. Its marks stay where they are.
    pub fn replace(&mut self, t_s: f64, profile: &BeltProfile) {
        let before_m = self.displacement_m(t_s);
        (self.profile, self.jump) = match *profile {
            BeltProfile::Step {
                from_m_s,
                to_m_s,
                at_s,
            } => {
                let [from, to] =
                    [from_m_s, to_m_s].map(|speed_m_s| BeltProfile::Constant { speed_m_s });
                if t_s < at_s {
                    (from, Some((at_s, to)))
                } else {
                    (to, None)
                }
            }
            _ => (profile.clone(), None),
        };
        self.offset_m += before_m - self.displacement_m(t_s);
    }

    /// Carries out a jump of the speed that is due at time `t_s`. Returns whether there was one.
    pub fn jump(&mut self, t_s: f64) -> bool {
        let due = self.jump.take_if(|(at_s, _)| *at_s <= t_s);
        if let Some((at_s, profile)) = &due {
            self.replace(*at_s, profile);
        }
        due.is_some()
    }

    /// Returns the profile until the next jump.
    #[inline]
    pub fn profile(&self) -> &BeltProfile {
        &self.profile
    }

    /// Returns the distance that the belt has moved from time zero to `t_s`, which is no later than the next jump, m.
    pub fn displacement_m(&self, t_s: f64) -> f64 {
        self.offset_m + self.profile.displacement_m(0.0, t_s)
    }

    /// Returns the next time after `t_s` at which speed or acceleration jumps or turns back, s; infinite if there
    /// is none.
    #[inline]
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        let jump_s = self.jump.as_ref().map_or(f64::INFINITY, |(at_s, _)| *at_s);
        self.profile.next_corner_s(t_s).min(jump_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_belt_moves_on_from_where_it_is_whatever_its_profile_becomes() {
        let step = BeltProfile::Step {
            from_m_s: -0.4,
            to_m_s: 0.2,
            at_s: 3.0,
        };
        let mut belt = MovingBelt::new(&step);
        assert_eq!(belt.next_corner_s(0.0), 3.0);
        assert!(!belt.jump(2.9));
        assert_eq!(belt.profile().speed_m_s(3.0), -0.4);
        assert!(belt.jump(3.0) && !belt.jump(3.0));
        assert_eq!(belt.profile().speed_m_s(3.0), 0.2);
        assert!((belt.displacement_m(4.0) - step.displacement_m(0.0, 4.0)).abs() < 1e-12);
        let before_m = belt.displacement_m(10.0);
        let sine = BeltProfile::Sine {
            mean_m_s: -0.5,
            amplitude_m_s: 0.1,
            frequency_hz: 0.7,
        };
        belt.replace(10.0, &sine);
        assert!((belt.displacement_m(10.0) - before_m).abs() < 1e-12);
        // A step that is long past has only its second speed.
        belt.replace(10.0, &step);
        assert_eq!(belt.profile().speed_m_s(10.0), 0.2);
        assert_eq!(belt.next_corner_s(10.0), f64::INFINITY);
    }
}
