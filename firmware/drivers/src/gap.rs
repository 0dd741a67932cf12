//! Checks encoders, force cell and torques against each other: the belt is where the model says.
//!
//! A tip deep inside the belt, or a force on a tip far above it, cannot be: an encoder is frozen at a plausible
//! angle, slips on its shaft or is zeroed wrongly, or the force cell is.
//!
//! Nor can a tip rest near the belt without a force on it: it falls, or the drive presses it down. Then the force
//! cell or its line is dead and reads zero, or both encoders are frozen.
//!
//! Nor can a force stay the same to the count while the torques of a driven arm change: the force cell is stuck.
//!
//! A check takes three steps, for as many ticks.

use painleve_shared::counts::{EncoderScale, ForceCounts, LinearScale, TorqueCounts};
use painleve_shared::{Arm, JointMotion, Real};

use crate::plausibility::SensorReadings;

/// Largest error of the height of the tip, as a part of the height of the arm's base over the belt: errors of
/// the links' lengths and of the encoders' zeros stay below.
const HEIGHT_TOLERANCE: f32 = 0.05;

/// Smallest force that counts as contact, as a part of the force cell's range.
const FORCE_TOLERANCE: f32 = 0.05;

/// Largest force on a tip in the air, as a part of the force cell's range.
const NO_FORCE: f32 = 0.005;

/// Largest change of the height of a tip at rest, as a part of the height of the arm's base over the belt. A
/// tip that is thrown upwards stays within it for some 30 ms.
const REST_TOLERANCE: f32 = 0.002;

/// Time for which a tip may rest near the belt without a force, s.
const REST_LIMIT_S: f32 = 0.2;

/// Time for which a force may stay the same to the count, s. In the built-in scenarios it is 4 ms, or 39 ms with
/// a cell without noise.
const STUCK_LIMIT_S: f32 = 0.2;

/// Change of a torque during this time, as a part of the torque stages' range, from which the force has to
/// change.
const STUCK_TORQUE: f32 = 0.01;

/// Scalings of an arm's converters, and their rate.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Encoders of θ1 and of the elbow.
    pub encoders: [EncoderScale; 2],
    /// Force cell, N.
    pub force: LinearScale<f32>,
    /// Torque stages, N·m.
    pub torque: LinearScale<f32>,
    /// Rate of the checks, Hz.
    pub check_hz: f32,
}

/// Readings under check.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// θ2, rad.
    theta_2_rad: f32,
    cosine_1: f32,
    /// Height of the tip over the belt, m.
    gap_m: f32,
    normal_force: ForceCounts,
    /// `None` while the drive is not active.
    torques: Option<[TorqueCounts; 2]>,
}

/// Model and scalings of an arm on its belt.
#[derive(Clone, Debug)]
pub struct GapCheck {
    arm: Arm<f32>,
    encoders: [EncoderScale; 2],
    /// One count of each encoder, rad.
    rad_per_count: [f32; 2],
    force: LinearScale<f32>,
    /// The readings under check; `None` if they are not complete.
    sample: Option<Sample>,
    /// Checks for which a tip may rest near the belt without a force.
    rest_limit: u32,
    /// Checks for which it has, and its height over the belt at the first of them, m.
    rests: u32,
    rest_gap_m: f32,
    /// Checks for which a force may stay the same.
    stuck_limit: u32,
    /// Change of a torque, counts, from which a force has to change.
    stuck_torque: i32,
    unchanged: UnchangedForce,
}

/// A force that has not changed.
#[derive(Clone, Copy, Debug, Default)]
struct UnchangedForce {
    force: ForceCounts,
    /// Checks since it changed.
    checks: u32,
    /// Smallest and largest torques meanwhile.
    lowest: [TorqueCounts; 2],
    highest: [TorqueCounts; 2],
}

impl UnchangedForce {
    fn new(force: ForceCounts, torques: [TorqueCounts; 2]) -> Self {
        Self {
            force,
            checks: 0,
            lowest: torques,
            highest: torques,
        }
    }

    /// Returns the largest change of a torque, counts.
    fn torque_change(&self) -> i32 {
        let [low_1, low_2] = self.lowest;
        let [high_1, high_2] = self.highest;
        (high_1.0 - low_1.0).max(high_2.0 - low_2.0)
    }
}

impl GapCheck {
    /// Makes a check of this arm.
    pub fn new(arm: Arm<f32>, scales: Scales) -> Self {
        Self {
            arm,
            encoders: scales.encoders,
            rad_per_count: scales.encoders.map(|scale| scale.rad_per_count()),
            force: scales.force,
            sample: None,
            rest_limit: (REST_LIMIT_S * scales.check_hz) as u32,
            rests: 0,
            rest_gap_m: 0.0,
            stuck_limit: (STUCK_LIMIT_S * scales.check_hz) as u32,
            stuck_torque: (STUCK_TORQUE * scales.torque.maximum_counts() as f32) as i32,
            unchanged: UnchangedForce::default(),
        }
    }

    /// Begins a check of these readings. The torques are `None` while the drive is not active: a tip may rest
    /// without a force then, because somebody may hold the arm.
    pub fn begin(&mut self, readings: &SensorReadings, torques: Option<[TorqueCounts; 2]>) {
        let ([Some(joint_1), Some(joint_2)], [_, Some(normal_force)]) =
            (readings.joints, readings.forces)
        else {
            self.sample = None;
            return;
        };
        let [scale_1, scale_2] = &self.encoders;
        let [rad_1, rad_2] = self.rad_per_count;
        let joints = JointMotion::new(
            scale_1.counts_from_zero(joint_1) as f32 * rad_1,
            scale_2.counts_from_zero(joint_2) as f32 * rad_2,
        );
        let theta_rad = joints.to_links();
        let (_, cosine_1) = theta_rad.first().sine_cosine();
        self.sample = Some(Sample {
            theta_2_rad: theta_rad.second(),
            cosine_1,
            gap_m: 0.0,
            normal_force,
            torques,
        });
    }

    /// Continues the check: computes the tip's height.
    pub fn measure(&mut self) {
        if let Some(sample) = &mut self.sample {
            let (_, cosine_2) = sample.theta_2_rad.sine_cosine();
            sample.gap_m = self.arm.gap_of_cosines_m(sample.cosine_1, cosine_2);
        }
    }

    /// Ends the check: returns whether the readings contradict each other, or those before, or the torques.
    pub fn contradicts(&mut self) -> bool {
        let Some(Sample {
            gap_m,
            normal_force,
            torques,
            ..
        }) = self.sample.take()
        else {
            return false;
        };
        let tolerance_m = HEIGHT_TOLERANCE * self.arm.height_m();
        let force_n = self.force.value(normal_force.0);
        let touches = force_n > FORCE_TOLERANCE * self.force.range;
        let rests = torques.is_some()
            && force_n < NO_FORCE * self.force.range
            && gap_m < tolerance_m
            && (gap_m - self.rest_gap_m).abs() < REST_TOLERANCE * self.arm.height_m();
        self.rests = if rests {
            self.rests.saturating_add(1)
        } else {
            self.rest_gap_m = gap_m;
            0
        };
        let is_dead = self.rests > self.rest_limit;
        let is_stuck = self.is_stuck(normal_force, torques.filter(|_| touches));
        gap_m < -tolerance_m || touches && gap_m > tolerance_m || is_dead || is_stuck
    }

    /// Returns whether the force has stayed the same for too long under changing torques of a drive that presses.
    fn is_stuck(&mut self, force: ForceCounts, torques: Option<[TorqueCounts; 2]>) -> bool {
        let unchanged = &mut self.unchanged;
        match torques {
            Some(torques) if force == unchanged.force => {
                for (joint, torque) in torques.into_iter().enumerate() {
                    unchanged.lowest[joint] = unchanged.lowest[joint].min(torque);
                    unchanged.highest[joint] = unchanged.highest[joint].max(torque);
                }
                unchanged.checks = unchanged.checks.saturating_add(1);
                unchanged.checks > self.stuck_limit && unchanged.torque_change() > self.stuck_torque
            }
            _ => {
                *unchanged = UnchangedForce::new(force, torques.unwrap_or_default());
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;
    use painleve_shared::counts::EncoderCounts;

    const FORCE: LinearScale<f32> = LinearScale {
        bits: 12,
        range: 20.0,
    };
    const TORQUE: LinearScale<f32> = LinearScale {
        bits: 12,
        range: 5.0,
    };

    fn check() -> GapCheck {
        let arm = Arm::new(ArmParameters::default()).expect("the paper's arm");
        let scales = Scales {
            encoders: [EncoderScale::default(); 2],
            force: FORCE,
            torque: TORQUE,
            check_hz: 1000.0,
        };
        GapCheck::new(arm, scales)
    }

    fn joints(degrees: [f64; 2]) -> [EncoderCounts; 2] {
        let scale = EncoderScale::default();
        let [theta_1, theta_2] = degrees.map(f64::to_radians);
        [scale.reading(theta_1), scale.reading(theta_2 - theta_1)]
    }

    fn counts(force_n: f32) -> ForceCounts {
        ForceCounts(FORCE.counts(force_n).0)
    }

    fn torques(counts: i32) -> Option<[TorqueCounts; 2]> {
        Some([TorqueCounts(counts), TorqueCounts(7)])
    }

    /// Returns the result of the three steps of a check.
    fn result(
        check: &mut GapCheck,
        joints: [EncoderCounts; 2],
        normal_force: ForceCounts,
        torques: Option<[TorqueCounts; 2]>,
    ) -> bool {
        let readings = SensorReadings {
            joints: joints.map(Some),
            forces: [Some(normal_force); 2],
            ..SensorReadings::default()
        };
        check.begin(&readings, torques);
        check.measure();
        check.contradicts()
    }

    fn contradicts(degrees: [f64; 2], force_n: f32) -> bool {
        result(&mut check(), joints(degrees), counts(force_n), torques(0))
    }

    /// Returns the check, of a thousand a second, at which a tip that rests on the belt for a second is found implausible.
    fn found_at(force_n: f32, torques: Option<[TorqueCounts; 2]>) -> Option<u32> {
        let mut check = check();
        (0..1000).find(|_| result(&mut check, joints(ON_BELT), counts(force_n), torques))
    }

    /// Returns the same for a force, counts, and a torque, counts, of each tick.
    fn stuck_at(force: impl Fn(i32) -> i32, torque: impl Fn(i32) -> i32) -> Option<i32> {
        let mut check = check();
        (0..1000).find(|tick| {
            let force = ForceCounts(force(*tick));
            result(&mut check, joints(ON_BELT), force, torques(torque(*tick)))
        })
    }

    #[test]
    fn a_force_that_stays_the_same_while_torques_change_is_not_plausible() {
        let swing = |tick: i32| 2 * (tick % 20);
        assert_eq!(stuck_at(|_| 1000, swing), Some(201));
        // The torques change by less, the force changes by a count now and then, or the tip is in the air.
        assert_eq!(stuck_at(|_| 1000, |tick| tick % 20), None);
        assert_eq!(stuck_at(|tick| 1000 + tick / 200 % 2, swing), None);
        assert_eq!(stuck_at(|_| 60, swing), None);
    }

    #[test]
    fn a_driven_tip_that_rests_on_the_belt_without_a_force_is_not_plausible() {
        assert_eq!(found_at(0.0, torques(0)), Some(200));
        assert_eq!(found_at(0.0, None), None);
        assert_eq!(found_at(0.5, torques(0)), None);
    }

    /// x0,d of the paper: the tip is on the belt.
    const ON_BELT: [f64; 2] = [-11.4, -35.1];

    #[test]
    fn a_tip_on_the_belt_and_a_tip_in_the_air_are_plausible() {
        assert!(!contradicts(ON_BELT, 10.0));
        assert!(!contradicts(ON_BELT, 0.0));
        assert!(!contradicts([-40.0, -60.0], 0.0));
    }

    #[test]
    fn a_tip_inside_the_belt_or_pressed_in_the_air_is_not() {
        assert!(contradicts([0.0, -10.0], 10.0));
        assert!(contradicts([0.0, -10.0], 0.0));
        assert!(contradicts([-40.0, -60.0], 10.0));
    }
}
