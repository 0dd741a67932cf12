//! Friction that changes along the belt and over time.

use painleve_shared::settings;

use super::friction_file::FrictionFile;

/// Length of the transition between two patches, m.
const SEAM_M: f64 = 1e-3;

settings! {
    /// Change of the belt's friction coefficient μ. The sum is limited to at least zero.
    pub enum FrictionChange by "kind" {
        /// No change.
        "none" => None,
        /// A sudden change.
        "step" => Step {
            /// Change of μ.
            change: f64, -2.0..=2.0;
            /// Time of the step.
            at_s: f64, 0.0..=1e7, "s";
        },
        /// A change at a constant rate.
        "ramp" => Ramp {
            /// Total change of μ.
            change: f64, -2.0..=2.0;
            /// Time at which the ramp starts.
            start_s: f64, 0.0..=1e7, "s";
            /// Duration of the ramp.
            duration_s: f64, 1e-6..=1e7, "s";
        },
        /// A sinusoidal change over time.
        "sine" => Sine {
            /// Amplitude of μ.
            amplitude: f64, -2.0..=2.0;
            /// Frequency.
            frequency_hz: f64, 1e-6..=1e3, "Hz";
        },
        /// Patches of equal length on the belt, on which μ is either raised or lowered by the same
        /// amount.
        "patches" => Patches {
            /// Amount of μ.
            amplitude: f64, -2.0..=2.0;
            /// Length of a patch.
            length_m: f64, 2e-3..=1e3, "m";
            /// Determines which patches are raised.
            seed: u64;
        },
        /// Changes from a CSV file with the columns `time_s,change` or `along_belt_m,change`,
        /// interpolated.
        "file" => File {
            /// Path of the file.
            path: FrictionFile;
        },
    }
}

impl FrictionChange {
    /// Returns the change of μ at time `t_s` and position `along_belt_m` on the belt, which moves
    /// with it.
    pub fn at(&self, t_s: f64, along_belt_m: f64) -> f64 {
        match *self {
            Self::None => 0.0,
            Self::File { ref path } => path.at(t_s, along_belt_m),
            Self::Step { change, at_s } => {
                if t_s < at_s {
                    0.0
                } else {
                    change
                }
            }
            Self::Ramp {
                change,
                start_s,
                duration_s,
            } => change * ((t_s - start_s) / duration_s).clamp(0.0, 1.0),
            Self::Sine {
                amplitude,
                frequency_hz,
            } => amplitude * libm::sin(core::f64::consts::TAU * frequency_hz * t_s),
            Self::Patches {
                amplitude,
                length_m,
                seed,
            } => {
                let patch = libm::floor(along_belt_m / length_m);
                let inside_m = along_belt_m - patch * length_m;
                let here = sign(seed, patch);
                let share = inside_m / SEAM_M;
                if share < 1.0 {
                    let before = sign(seed, patch - 1.0);
                    amplitude * (before + (here - before) * share)
                } else {
                    amplitude * here
                }
            }
        }
    }
}

/// Returns +1 or −1 for a patch, from the bits of its number.
fn sign(seed: u64, patch: f64) -> f64 {
    // The seed alone is mixed first: otherwise small seeds would only permute the same patches.
    let bits = mixed(mixed(seed) ^ (patch as i64).cast_unsigned());
    if bits & 1 == 0 { 1.0 } else { -1.0 }
}

/// Mixes bits by the steps of SplitMix64.
fn mixed(bits: u64) -> u64 {
    let bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_seed_does_not_permute_the_same_patches() {
        let raised = |seed| {
            (0..64)
                .filter(|patch| sign(seed, f64::from(*patch)) > 0.0)
                .count()
        };
        assert!((1..16).any(|seed| raised(seed) != raised(0)));
    }

    #[test]
    fn patches_are_balanced_and_repeatable() {
        let patches = FrictionChange::Patches {
            amplitude: 0.1,
            length_m: 0.05,
            seed: 7,
        };
        let values: Vec<f64> = (-1000..1000)
            .map(|patch| patches.at(0.0, (f64::from(patch) + 0.5) * 0.05))
            .collect();
        let up = values.iter().filter(|value| **value > 0.0).count();
        assert!((900..1100).contains(&up), "{up}");
        assert!(values.iter().all(|value| value.abs() == 0.1));
        assert_eq!(patches.at(3.0, 0.02), patches.at(5.0, 0.02));
    }
}
