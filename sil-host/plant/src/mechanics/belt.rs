//! Belt speed over time.

use painleve_shared::settings;

use super::belt_file::BeltFile;

settings! {
    /// Friction and speed of the belt.
    pub struct BeltSettings {
        /// Friction coefficient μ between tip and belt.
        friction: f64 = 0.6, 0.0..=10.0;
        /// Speed of the belt over time, positive along +t.
        profile: BeltProfile = BeltProfile::default();
    }
}

settings! {
    /// Speed of the belt, v_belt, as a function of time; positive along +t.
    pub enum BeltProfile by "kind" {
        /// Always the same speed.
        "constant" => Constant {
            /// Speed.
            speed_m_s: f64, -100.0..=100.0, "m/s";
        },
        /// One speed before `at_s`, another from then on.
        "step" => Step {
            /// Speed before the step.
            from_m_s: f64, -100.0..=100.0, "m/s";
            /// Speed from the step on.
            to_m_s: f64, -100.0..=100.0, "m/s";
            /// Time of the step.
            at_s: f64, 0.0..=1e7, "s";
        },
        /// A change of speed at constant acceleration.
        "ramp" => Ramp {
            /// Speed before the ramp.
            from_m_s: f64, -100.0..=100.0, "m/s";
            /// Speed after the ramp.
            to_m_s: f64, -100.0..=100.0, "m/s";
            /// Time at which the ramp starts.
            start_s: f64, 0.0..=1e7, "s";
            /// Duration of the ramp.
            duration_s: f64, 1e-6..=1e7, "s";
        },
        /// A sine around a mean speed.
        "sine" => Sine {
            /// Mean speed.
            mean_m_s: f64, -100.0..=100.0, "m/s";
            /// Amplitude.
            amplitude_m_s: f64, -100.0..=100.0, "m/s";
            /// Frequency.
            frequency_hz: f64, 1e-6..=1e3, "Hz";
        },
        /// Speeds from a CSV file with the columns `time_s,speed_m_s`, interpolated.
        "file" => File {
            /// Path of the file.
            path: BeltFile;
        },
    }
}

impl Default for BeltProfile {
    /// Returns the profile of the paper's section III: −0.4 m/s.
    fn default() -> Self {
        Self::Constant { speed_m_s: -0.4 }
    }
}

impl BeltProfile {
    /// Returns the speed at time `t_s`, m/s.
    #[inline]
    pub fn speed_m_s(&self, t_s: f64) -> f64 {
        match *self {
            Self::Constant { speed_m_s } => speed_m_s,
            Self::File { ref path } => path.speed_m_s(t_s),
            Self::Step {
                from_m_s,
                to_m_s,
                at_s,
            } => {
                if t_s < at_s {
                    from_m_s
                } else {
                    to_m_s
                }
            }
            Self::Ramp {
                from_m_s,
                to_m_s,
                start_s,
                duration_s,
            } => {
                let progress = ((t_s - start_s) / duration_s).clamp(0.0, 1.0);
                from_m_s + (to_m_s - from_m_s) * progress
            }
            Self::Sine {
                mean_m_s,
                amplitude_m_s,
                frequency_hz,
            } => {
                let phase = core::f64::consts::TAU * frequency_hz * t_s;
                mean_m_s + amplitude_m_s * libm::sin(phase)
            }
        }
    }

    /// Returns the acceleration at time `t_s`, m/s²; at a corner, the
    /// acceleration just after it.
    #[inline]
    pub fn acceleration_m_s2(&self, t_s: f64) -> f64 {
        match *self {
            Self::Constant { .. } | Self::Step { .. } => 0.0,
            Self::File { ref path } => path.acceleration_m_s2(t_s),
            Self::Ramp {
                from_m_s,
                to_m_s,
                start_s,
                duration_s,
            } => {
                if (start_s..start_s + duration_s).contains(&t_s) {
                    (to_m_s - from_m_s) / duration_s
                } else {
                    0.0
                }
            }
            Self::Sine {
                amplitude_m_s,
                frequency_hz,
                ..
            } => {
                let rate = core::f64::consts::TAU * frequency_hz;
                amplitude_m_s * rate * libm::cos(rate * t_s)
            }
        }
    }

    /// Returns the distance the belt moves from `from_s` to `to_s`, m.
    pub fn displacement_m(&self, from_s: f64, to_s: f64) -> f64 {
        self.position_m(to_s) - self.position_m(from_s)
    }

    /// Returns the integral of the speed from a fixed time, m.
    fn position_m(&self, t_s: f64) -> f64 {
        match *self {
            Self::Constant { speed_m_s } => speed_m_s * t_s,
            Self::File { ref path } => path.position_m(t_s),
            Self::Step {
                from_m_s,
                to_m_s,
                at_s,
            } => from_m_s * t_s + (to_m_s - from_m_s) * (t_s - at_s).max(0.0),
            Self::Ramp {
                from_m_s,
                to_m_s,
                start_s,
                duration_s,
            } => {
                let inside = (t_s - start_s).clamp(0.0, duration_s);
                let after = (t_s - start_s - duration_s).max(0.0);
                let change = to_m_s - from_m_s;
                from_m_s * t_s + change * (0.5 * inside * inside / duration_s + after)
            }
            Self::Sine {
                mean_m_s,
                amplitude_m_s,
                frequency_hz,
            } => {
                let rate = core::f64::consts::TAU * frequency_hz;
                mean_m_s * t_s + amplitude_m_s * (1.0 - libm::cos(rate * t_s)) / rate
            }
        }
    }

    /// Returns the next time after `t_s` at which speed or acceleration jumps or turns back, s; infinite if there is
    /// none. Between two of them both are monotone, so that the ends of a step show what happens within it.
    #[inline]
    pub fn next_corner_s(&self, t_s: f64) -> f64 {
        let corners = match *self {
            Self::Constant { .. } => [f64::INFINITY; 2],
            Self::Sine { frequency_hz, .. } => {
                let quarter_s = 0.25 / frequency_hz;
                // Rounding may put the first one at `t_s`.
                let next = libm::floor(t_s / quarter_s) + 1.0;
                [next * quarter_s, (next + 1.0) * quarter_s]
            }
            Self::File { ref path } => [path.next_corner_s(t_s), f64::INFINITY],
            Self::Step { at_s, .. } => [at_s, f64::INFINITY],
            Self::Ramp {
                start_s,
                duration_s,
                ..
            } => [start_s, start_s + duration_s],
        };
        corners
            .into_iter()
            .find(|corner| *corner > t_s)
            .unwrap_or(f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::settings::Settings;
    use proptest::prelude::*;

    fn profiles() -> impl Strategy<Value = BeltProfile> {
        let speed = -1.0_f64..1.0;
        prop_oneof![
            speed
                .clone()
                .prop_map(|speed_m_s| BeltProfile::Constant { speed_m_s }),
            (speed.clone(), speed.clone(), 0.0..2.0_f64).prop_map(|(from_m_s, to_m_s, at_s)| {
                BeltProfile::Step {
                    from_m_s,
                    to_m_s,
                    at_s,
                }
            }),
            (speed.clone(), speed.clone(), 0.0..2.0_f64, 0.1..2.0_f64).prop_map(
                |(from_m_s, to_m_s, start_s, duration_s)| BeltProfile::Ramp {
                    from_m_s,
                    to_m_s,
                    start_s,
                    duration_s,
                }
            ),
            (speed.clone(), speed, 0.1..5.0_f64).prop_map(
                |(mean_m_s, amplitude_m_s, frequency_hz)| BeltProfile::Sine {
                    mean_m_s,
                    amplitude_m_s,
                    frequency_hz,
                }
            ),
        ]
    }

    /// Files with rows at 0.5, 1.5, … s.
    fn files() -> impl Strategy<Value = BeltProfile> {
        prop::collection::vec(-1.0_f64..1.0, 2..5).prop_map(|speeds| {
            let rows = speeds.iter().enumerate();
            let rows = rows.map(|(row, speed)| format!("{row}.5,{speed}\n"));
            file(&format!("time_s,speed_m_s\n{}", rows.collect::<String>())).unwrap()
        })
    }

    fn file(text: &str) -> Result<BeltProfile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("belt.csv");
        std::fs::write(&path, text).unwrap();
        let path = BeltFile::read(path.to_str().unwrap())?;
        Ok(BeltProfile::File { path })
    }

    #[test]
    fn a_file_gives_the_speed_between_its_rows_and_names_its_mistakes() {
        let profile = file("time_s,speed_m_s\n1,-0.4\n2,-0.2\n").unwrap();
        for (t_s, speed_m_s) in [(0.0, -0.4), (1.5, -0.3), (9.0, -0.2)] {
            assert!((profile.speed_m_s(t_s) - speed_m_s).abs() < 1e-12, "{t_s}");
        }
        assert!((profile.displacement_m(0.0, 3.0) - -0.9).abs() < 1e-12);
        let message = file("time_s,speed_m_s\n0,0\n1,101\n").unwrap_err();
        let expected = "line 3: speed_m_s = 101 is outside the allowed range -100 to 100";
        assert!(message.ends_with(expected), "{message}");
    }

    proptest! {
        #[test]
        fn displacement_and_acceleration_belong_to_the_speed(
            profile in prop_oneof![profiles(), files()], t in 0.001_f64..4.0,
        ) {
            let step = 1e-6;
            prop_assume!(profile.next_corner_s(t - step) > t + step);
            let speed = profile.displacement_m(t - step, t + step) / (2.0 * step);
            let acceleration =
                (profile.speed_m_s(t + step) - profile.speed_m_s(t - step)) / (2.0 * step);
            prop_assert!((speed - profile.speed_m_s(t)).abs() < 1e-8);
            prop_assert!((acceleration - profile.acceleration_m_s2(t)).abs() < 1e-5);
            let settings = BeltSettings { profile, ..Default::default() };
            prop_assert!(settings.validate().is_ok());
        }
    }

    #[test]
    fn bad_numbers_are_named() {
        let settings = BeltSettings {
            profile: BeltProfile::Constant {
                speed_m_s: f64::NAN,
            },
            ..Default::default()
        };
        assert_eq!(settings.validate().unwrap_err().key, "profile.speed_m_s");
    }
}
