//! Estimates joint angles and rates from encoder counts.
//!
//! Each joint has a tracking loop (second-order Luenberger observer). One count of a 14-bit encoder
//! per millisecond is 0.38 rad/s, so differencing cannot detect a lift-off; the loop spreads a count
//! over its time constant instead. The acceleration commanded by the control law is fed forward, so
//! a slow loop does not lag behind the commanded motion. A loop predicts the next angle after a tick has been
//! answered, so that the next tick only corrects it.
//!
//! Both poles are at z = exp(−ω T), with gains 1 − z² and (1 − z)²/T.
//!
//! Errors of the encoders that are known are [corrected](super::encoder_correction) beforehand.
//!
//! An encoder on the motor side of an elastic gear leads the link by the gear's twist under the torque.

use painleve_shared::counts::{EncoderCounts, EncoderScale};
use painleve_shared::{JointMotion, JointTorque, LinkMotion, Pose, Real, settings};

use super::encoder_correction::EncoderCorrection;

settings! {
    /// Settings of the tracking loops.
    #[derive(Copy)]
    pub struct JointEstimatorSettings {
        /// Bandwidth ω of both tracking loops; at most three times the control rate.
        bandwidth_rad_s: f32 = 500.0, 1.0..=3e5, "rad/s";
        /// Largest joint rate; a faster reading latches the fault `EncoderJump`.
        rate_limit_rad_s: f32 = 100.0, 1.0..=1e4, "rad/s";
        /// Twist of each gear for each N·m of commanded torque, if the encoders are on the motors; 0 if they
        /// are on the links. Tracking loops and hybrid law are slower where the arm's natural frequency on
        /// these gears is below ω.
        gear_compliance_rad_nm: [f32; 2] = [0.0; 2], 0.0..=0.1, "rad/(N·m)";
        /// Correction of the encoders' readings.
        encoders: EncoderCorrection = EncoderCorrection::default();
        /// Standard deviation of the tip's distance from the edges by what is not known of encoders, links and belt; 0
        /// for an arm that is known exactly. The governor keeps a distance for it. Play of the gears counts 1 m a radian;
        /// of a commissioned arm, it is part of `knowledge.told_m`.
        tip_deviation_m: f32 = 0.0, 0.0..=1.0, "m";
    }
}

/// Why the tracking loops have started from the readings of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    /// They are the first, or the first after so long that a joint may have made half a turn.
    FirstReadings,
    /// They differ from the previous ones by more than the joint can have moved.
    EncoderJump,
}

/// Estimator of both joints' angles q' = (θ1, θ2 − θ1) and rates, with its gains. The encoders have the same resolution.
#[derive(Clone, Debug, Default)]
pub struct JointEstimator {
    settings: JointEstimatorSettings,
    scales: [EncoderScale; 2],
    /// One count of an encoder, rad.
    pub(super) rad_per_count: f32,
    /// Steady innovation in counts that an acceleration q̈' of 1 rad/s² causes if it is not fed forward: T²/(1 − z)².
    pub(super) lag_counts_s2: f32,
    /// Largest count by which a joint can move in a tick.
    jump_counts: u32,
    tick_s: f32,
    pub(super) angle_gain: f32,
    rate_gain_per_s: f32,
    /// The last readings; absent before the first, and until then all estimates are zero.
    readings: Option<[EncoderCounts; 2]>,
    /// Unwrapped angles, counts from angle zero.
    counts: [i32; 2],
    /// What is added to the encoders' angles, rad.
    correction_rad: JointMotion<f32>,
    /// Joint angles q', rad.
    pub(super) angles_rad: JointMotion<f32>,
    rates_rad_s: JointMotion<f32>,
    /// Measured less expected angles at the last tick, rad.
    pub(super) innovation_rad: JointMotion<f32>,
    /// Whether the last readings differed from the previous ones.
    pub(super) moved: bool,
    /// Ticks predicted since the last readings.
    predicted_ticks: u32,
}

impl JointEstimator {
    /// Makes an estimator for encoders with these scalings, read `tick_hz` times a second.
    pub fn new(settings: &JointEstimatorSettings, scales: [EncoderScale; 2], tick_hz: f32) -> Self {
        let tick_s = 1.0 / tick_hz;
        let pole = libm::expf(-settings.bandwidth_rad_s * tick_s);
        let rad_per_count: f32 = scales[0].rad_per_count();
        let rate_gain_per_s = (1.0 - pole) * (1.0 - pole) * tick_hz;
        let most_counts = settings.rate_limit_rad_s * tick_s / rad_per_count;
        Self {
            settings: *settings,
            scales,
            rad_per_count,
            lag_counts_s2: tick_s / rate_gain_per_s / rad_per_count,
            // One count beyond the limit allows for the rounding of two readings.
            jump_counts: (most_counts as u32).saturating_add(2),
            tick_s,
            angle_gain: 1.0 - pole * pole,
            rate_gain_per_s,
            ..Self::default()
        }
    }

    /// Returns whether the encoders can give these readings.
    #[inline]
    pub fn can_read(&self, [reading_1, reading_2]: [EncoderCounts; 2]) -> bool {
        let [scale_1, scale_2] = &self.scales;
        scale_1.contains(reading_1) && scale_2.contains(reading_2)
    }

    /// Corrects the prediction with the readings of one tick.
    ///
    /// `elapsed_ticks` is the time since the previous readings (1 unless readings were lost);
    /// `acceleration_rad_s2` is the expected acceleration of q' in the ticks that have not been predicted; `torque_nm`
    /// is the torque that twists the gears. The first readings set the angles with zero rates.
    ///
    /// # Errors
    /// [`Restart`] if the loops have started from these readings: they are the first, or a joint seems to have
    /// moved faster than it can.
    #[inline]
    pub fn correct(
        &mut self,
        readings: &[EncoderCounts; 2],
        elapsed_ticks: u32,
        acceleration_rad_s2: &JointMotion<f32>,
        torque_nm: &JointTorque<f32>,
    ) -> Result<(), Restart> {
        let Some(before) = self.readings.replace(*readings) else {
            self.start(readings);
            return Err(Restart::FirstReadings);
        };
        if elapsed_ticks > self.predicted_ticks {
            self.bridge(acceleration_rad_s2, elapsed_ticks);
        }
        let most = self.jump_counts.saturating_mul(self.predicted_ticks);
        if self.predicted_ticks > 1 && most >= self.scales[0].modulus() / 2 {
            // The readings do not show in which direction a joint has turned.
            self.start(readings);
            return Err(Restart::FirstReadings);
        }
        let moved = [0, 1].map(|i| self.scales[i].difference(before[i], readings[i]));
        if moved.iter().any(|counts| counts.unsigned_abs() > most) {
            self.start(readings);
            return Err(Restart::EncoderJump);
        }
        self.predicted_ticks = 0;
        self.moved = moved != [0; 2];
        self.counts = [0, 1].map(|i| self.counts[i].wrapping_add(moved[i]));
        let [soft_1, soft_2] = self.settings.gear_compliance_rad_nm;
        let twist_rad = JointMotion::new(soft_1 * torque_nm.first(), soft_2 * torque_nm.second());
        let measured_rad = self.encoders_rad() + self.correction_rad - twist_rad;
        self.innovation_rad = measured_rad - self.angles_rad;
        self.angles_rad += self.innovation_rad * self.angle_gain;
        self.rates_rad_s += self.innovation_rad * self.rate_gain_per_s;
        Ok(())
    }

    /// Returns the angles that the encoders show, rad.
    #[inline]
    fn encoders_rad(&self) -> JointMotion<f32> {
        JointMotion::from_array(self.counts.map(|counts| counts as f32 * self.rad_per_count))
    }

    /// Predicts angles and rates `ticks` later, given the expected acceleration of q' (rad/s²) until then.
    #[inline(always)]
    pub fn predict(&mut self, acceleration_rad_s2: &JointMotion<f32>, ticks: u32) {
        let (limit, time_s) = (self.settings.rate_limit_rad_s, ticks as f32 * self.tick_s);
        self.predicted_ticks = self.predicted_ticks.saturating_add(ticks);
        let before = self.rates_rad_s;
        let after = before + *acceleration_rad_s2 * time_s;
        // An acceleration that is wrong, as with gains too high for the control rate, drives no angle away.
        self.rates_rad_s = after.map(|rate| rate.within(limit));
        self.angles_rad += (before + self.rates_rad_s) * 0.5 * time_s;
    }

    /// Predicts the ticks of frames that have not arrived.
    #[inline(never)]
    fn bridge(&mut self, acceleration_rad_s2: &JointMotion<f32>, elapsed_ticks: u32) {
        self.predict(acceleration_rad_s2, elapsed_ticks - self.predicted_ticks);
    }

    /// Leaves out the whole turns by which a joint of an arm without torque has been turned: targets are within half a turn
    /// of zero. Returns whether there are any.
    #[inline(never)]
    pub fn unwind(&mut self) -> bool {
        let Some(readings) = self.readings else {
            return false;
        };
        let counts = [0, 1].map(|i| self.scales[i].counts_from_zero(readings[i]));
        let turned = [0, 1].map(|i| counts[i].wrapping_sub(self.counts[i]) as f32);
        self.angles_rad += JointMotion::from_array(turned) * self.rad_per_count;
        self.counts = counts;
        turned != [0.0; 2]
    }

    /// Corrects the next readings, which are expected near this pose.
    #[inline]
    pub fn expect_pose(&mut self, pose: &Pose<f32>) {
        self.correction_rad = self.settings.encoders.in_pose(pose);
    }

    /// Restarts both loops from these readings, at rest.
    fn start(&mut self, readings: &[EncoderCounts; 2]) {
        self.moved = true;
        self.predicted_ticks = 0;
        self.counts = [0, 1].map(|i| self.scales[i].counts_from_zero(readings[i]));
        let encoders_rad = self.encoders_rad();
        // A zero may be off by some degrees, and changes the rest of the correction; that changes itself by little.
        let near_rad = encoders_rad + JointMotion::from_array(self.settings.encoders.zero_rad);
        self.expect_pose(&Pose::new(&near_rad.to_links()));
        self.angles_rad = encoders_rad + self.correction_rad;
        self.rates_rad_s = JointMotion::zeros();
        self.innovation_rad = JointMotion::zeros();
    }

    /// Returns the link angles θ = (θ1, θ2), rad; zero before the first readings.
    pub fn theta_rad(&self) -> LinkMotion<f32> {
        self.angles_rad.to_links()
    }

    /// Returns the link rates θ̇, rad/s; zero before the second readings.
    pub fn theta_dot_rad_s(&self) -> LinkMotion<f32> {
        self.rates_rad_s.to_links()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALE: EncoderScale = EncoderScale {
        bits: 14,
        offset: EncoderCounts(16_000),
    };

    fn estimator() -> JointEstimator {
        JointEstimator::new(&JointEstimatorSettings::default(), [SCALE; 2], 1000.0)
    }

    fn track(motion: impl Fn(f64) -> (f64, f64), acceleration: f32, ticks: u32) -> JointEstimator {
        let mut estimator = estimator();
        for tick in 0..ticks {
            let (one, two) = motion(f64::from(tick) * 1e-3);
            let readings = [SCALE.reading(one), SCALE.reading(two)];
            let expected = JointMotion::new(acceleration, 0.0);
            if tick > 0 {
                estimator.predict(&expected, 1);
            }
            let corrected = estimator.correct(&readings, 1, &expected, &JointTorque::zeros());
            let first = Err(Restart::FirstReadings);
            assert_eq!(corrected, if tick == 0 { first } else { Ok(()) });
        }
        estimator
    }

    #[test]
    fn a_constant_rate_is_found_from_coarse_counts_through_a_wrap() {
        // θ1 passes the encoder's wrap; the elbow turns the other way.
        let state = track(|t| (0.1 + 1.7 * t, -0.3 - 0.4 * t), 0.0, 400);
        let rate = state.theta_dot_rad_s();
        assert!((rate.first() - 1.7).abs() < 0.1, "{rate:?}");
        assert!((rate.second() - 1.3).abs() < 0.2, "{rate:?}");
        let theta = state.theta_rad();
        assert!(
            (theta.first() - (0.1 + 1.7 * 0.399)).abs() < 6e-4,
            "{theta:?}"
        );
    }

    #[test]
    fn a_known_acceleration_leaves_no_lag() {
        let with = track(|t| (5.0 * t * t, 0.0), 10.0, 200)
            .theta_dot_rad_s()
            .first();
        let without = track(|t| (5.0 * t * t, 0.0), 0.0, 200)
            .theta_dot_rad_s()
            .first();
        let truth = 10.0 * 0.199;
        assert!((with - truth).abs() < 0.05, "{with}");
        assert!((without - truth).abs() > (with - truth).abs());
    }

    #[test]
    fn behind_gears_that_twist_the_loops_follow_the_links() {
        let settings = JointEstimatorSettings {
            gear_compliance_rad_nm: [1e-3, 2e-3],
            ..Default::default()
        };
        let mut estimator = JointEstimator::new(&settings, [SCALE; 2], 1000.0);
        // The torque alternates, so that the motors move, and the links stay.
        for tick in 0..400 {
            let share = f64::from(tick % 20) / 10.0 - 1.0;
            let torque = JointTorque::new(2.0 * share as f32, -3.0 * share as f32);
            let readings = [
                SCALE.reading(0.2 + 1e-3 * 2.0 * share),
                SCALE.reading(0.1 - 2e-3 * 3.0 * share),
            ];
            let still = JointMotion::zeros();
            let _ = estimator.correct(&readings, 1, &still, &torque);
            if tick > 100 {
                let error = (estimator.theta_rad() - LinkMotion::new(0.2, 0.3)).amax();
                assert!(error < 5e-4, "{tick}: {error}");
                let rate = estimator.theta_dot_rad_s().amax();
                assert!(rate < 0.1, "{tick}: {rate}");
            }
            estimator.predict(&still, 1);
        }
    }

    #[test]
    fn the_fastest_joint_on_the_finest_encoder_at_the_lowest_rate_is_no_jump() {
        let settings = JointEstimatorSettings {
            rate_limit_rad_s: 1e4,
            ..Default::default()
        };
        let scale = EncoderScale { bits: 24, ..SCALE };
        let mut estimator = JointEstimator::new(&settings, [scale; 2], 10.0);
        let (still, no_torque) = (JointMotion::zeros(), JointTorque::zeros());
        for angle in [0.0, 1.0] {
            let readings = [scale.reading(angle); 2];
            let followed = estimator.correct(&readings, 1, &still, &no_torque);
            assert_ne!(followed, Err(Restart::EncoderJump));
        }
    }

    #[test]
    fn after_an_outage_in_which_a_joint_may_have_made_half_a_turn_the_loops_start_anew() {
        let back = [SCALE.reading(0.3), SCALE.reading(0.1)];
        let (still, no_torque) = (JointMotion::zeros(), JointTorque::zeros());
        // 100 rad/s for 31 ms are less than half a turn.
        for (lost_ticks, found) in [(30, Ok(())), (40, Err(Restart::FirstReadings))] {
            let mut state = track(|t| (1.5 * t, 0.1), 0.0, 200);
            for _ in 0..lost_ticks {
                state.predict(&still, 1);
            }
            assert_eq!(state.correct(&back, lost_ticks, &still, &no_torque), found);
        }
        let mut state = track(|t| (1.5 * t, 0.1), 0.0, 200);
        for _ in 0..10_000_000 {
            state.predict(&still, 1);
        }
        let _ = state.correct(&back, 10_000_000, &still, &no_torque);
        assert!((state.theta_rad().first() - 0.3).abs() < 1e-3);
        assert_eq!(state.theta_dot_rad_s().first(), 0.0);
    }

    #[test]
    fn a_jump_is_reported_and_the_loops_restart_from_it() {
        let jumped = [SCALE.reading(0.5), SCALE.reading(0.1)];
        let mut state = track(|t| (0.2 + t, 0.1), 0.0, 10);
        let jump = state.correct(&jumped, 1, &JointMotion::zeros(), &JointTorque::zeros());
        assert_eq!(jump, Err(Restart::EncoderJump));
        assert!((state.theta_rad() - LinkMotion::new(0.5, 0.6)).amax() < 6e-4);
        assert_eq!(state.theta_dot_rad_s(), LinkMotion::zeros());
        // Over a longer time the same difference is a plausible motion.
        let mut state = track(|_| (0.2, 0.1), 0.0, 10);
        let moved = state.correct(&jumped, 10, &JointMotion::zeros(), &JointTorque::zeros());
        assert!(moved.is_ok());
    }
}
