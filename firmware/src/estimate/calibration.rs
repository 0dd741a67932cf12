//! Calibrates the links' length against the belt.
//!
//! With the tip on the belt cos θ₁ + ρ cos θ₂ = H/l₁ in every posture, with ρ = l₂/l₁. The mean of the measured
//! sum therefore gives l₁, and l₂ in proportion; it improves the longer the tip slides. Without calibration, an
//! arm 5 % longer than its data sheet states would miss its references by a centimetre and its edges by more.

use painleve_shared::{Arm, Real, settings};

/// Longest averaging time, s. A tenth and a hundred times of it lost more runs (lab book, *Factors on constants*).
const AVERAGING_S: f32 = 2.0;

settings! {
    /// Settings of the calibration.
    #[derive(Copy)]
    pub struct CalibrationSettings {
        /// Largest deviation from the nominal length, as a fraction of it; 0 for no calibration.
        tolerance: f32 = 0.08, 0.0..=0.5;
    }
}

/// Calibrates the links' length from the gaps measured while the tip is on the belt.
#[derive(Clone, Copy, Debug)]
pub struct LengthCalibrator {
    /// The arm with its nominal lengths, from which every length is scaled: the roundings of one scaling after another
    /// would add up.
    nominal: Arm<f32>,
    /// Largest deviation from the nominal length, m.
    deviation_m: f32,
    /// Number of readings beyond which old ones are forgotten.
    most_readings: f32,
    /// What cos θ₁ + ρ cos θ₂ is on the belt with the nominal lengths, and the mean of what it is more: single precision
    /// would lose small changes in a mean of the sum.
    nominal_sum: f32,
    mean: f32,
    /// Number of readings in the mean.
    readings: f32,
}

impl LengthCalibrator {
    /// Makes a calibrator of the `nominal` arm, updated every `period_s`.
    pub fn new(settings: &CalibrationSettings, nominal: &Arm<f32>, period_s: f32) -> Self {
        let [nominal_m, _] = nominal.link_length_m();
        Self {
            nominal: *nominal,
            deviation_m: settings.tolerance * nominal_m,
            most_readings: (AVERAGING_S / period_s).at_least(1.0),
            nominal_sum: nominal.height_m() / nominal_m,
            mean: 0.0,
            readings: 0.0,
        }
    }

    /// Returns the largest error (m) of a gap whose readings are wrong by at most `reading_error_m`, including
    /// the error of the length, which is averaged from such readings.
    pub fn gap_error_m(&self, reading_error_m: f32) -> f32 {
        if self.readings > 0.0 {
            reading_error_m * (1.0 + 1.0 / self.readings.square_root())
        } else {
            reading_error_m
        }
    }

    /// Updates the mean with the gap (m) that one tick's readings give for the arm's present length while the
    /// tip is on the belt, and scales the arm to the length that follows.
    #[inline]
    pub fn update(&mut self, arm: &mut Arm<f32>, measured_gap_m: f32) {
        if self.deviation_m == 0.0 {
            return;
        }
        let ([present_m, _], [nominal_m, _]) = (arm.link_length_m(), self.nominal.link_length_m());
        let height_m = arm.height_m();
        let excess = (height_m - measured_gap_m) / present_m - self.nominal_sum;
        self.readings = (self.readings + 1.0).at_most(self.most_readings);
        self.mean += (excess - self.mean) / self.readings;
        let length_m = height_m / (self.nominal_sum + self.mean);
        // Rejects non-finite lengths as well.
        if (length_m - nominal_m).abs() <= self.deviation_m {
            arm.scale_from(&self.nominal, length_m);
        }
    }

    /// Restarts the mean at this measured gap (m): the tip is assumed on the belt, because it cannot be below
    /// it.
    #[cold]
    #[inline(never)]
    pub fn restart(&mut self, arm: &mut Arm<f32>, measured_gap_m: f32) {
        self.readings = 0.0;
        self.update(arm, measured_gap_m);
    }

    /// Returns whether the length is calibrated but has no reading yet.
    pub fn is_open(&self) -> bool {
        self.deviation_m > 0.0 && self.readings == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;

    const HEIGHT_M: f32 = 0.3775;

    /// A calibrator with its state and its arm.
    struct Calibration {
        calibrator: LengthCalibrator,
        arm: Arm<f32>,
    }

    impl Calibration {
        fn update(&mut self, gap_m: f32) -> f32 {
            self.calibrator.update(&mut self.arm, gap_m);
            self.arm.link_length_m()[0]
        }
    }

    fn calibration() -> Calibration {
        let parameters = ArmParameters {
            link_length_m: [0.21; 2],
            height_m: HEIGHT_M,
            ..ArmParameters::default()
        };
        let arm = Arm::new(parameters).unwrap();
        Calibration {
            calibrator: LengthCalibrator::new(&CalibrationSettings::default(), &arm, 1e-3),
            arm,
        }
    }

    /// Returns the gap that readings give for the length in use, while the tip is on the belt.
    fn gap_m(true_length_m: f32, used_length_m: f32) -> f32 {
        HEIGHT_M - used_length_m * HEIGHT_M / true_length_m
    }

    #[test]
    fn a_length_within_tolerance_is_found() {
        let mut calibration = calibration();
        let mut length_m = 0.21;
        for _ in 0..10 {
            length_m = calibration.update(gap_m(0.2205, length_m));
        }
        assert!((length_m - 0.2205).abs() < 1e-6, "{length_m}");
    }

    #[test]
    fn errors_of_the_readings_are_averaged() {
        let mut calibration = calibration();
        let mut length_m = 0.21;
        for tick in 0..1000 {
            let error_m = if tick % 2 == 0 { 50e-6 } else { -50e-6 };
            length_m = calibration.update(gap_m(0.205, length_m) + error_m);
        }
        assert!((length_m - 0.205).abs() < 1e-6, "{length_m}");
    }

    #[test]
    fn an_hour_of_readings_leaves_the_arm_as_one_scaling_does() {
        let mut calibration = calibration();
        let nominal = calibration.arm;
        for tick in 0..1_800_000 {
            let used_m = calibration.arm.link_length_m()[0];
            let error_m = if tick % 2 == 0 { 50e-6 } else { -50e-6 };
            calibration.update(gap_m(0.215, used_m) + error_m);
        }
        let [length_m, _] = calibration.arm.link_length_m();
        let mut scaled_once = nominal;
        scaled_once.scale_from(&nominal, length_m);
        assert_eq!(calibration.arm, scaled_once);
    }

    #[test]
    fn a_restart_discards_earlier_readings() {
        let mut calibration = calibration();
        let is_open = |of: &Calibration| of.calibrator.is_open();
        assert!(is_open(&calibration));
        let mut length_m = 0.21;
        for _ in 0..10 {
            length_m = calibration.update(gap_m(0.2205, length_m));
        }
        assert!(!is_open(&calibration));
        let Calibration { calibrator, arm } = &mut calibration;
        calibrator.restart(arm, gap_m(0.205, length_m));
        length_m = arm.link_length_m()[0];
        assert!((length_m - 0.205).abs() < 1e-6, "{length_m}");
    }

    #[test]
    fn the_gap_error_falls_with_the_number_of_readings() {
        let mut calibration = calibration();
        assert_eq!(
            calibration.calibrator.gap_error_m(50e-6),
            50e-6,
            "without readings"
        );
        let errors_m: [f32; 100] = core::array::from_fn(|_| {
            calibration.update(0.0);
            calibration.calibrator.gap_error_m(50e-6)
        });
        assert!((errors_m[0] - 100e-6).abs() < 1e-9 && (errors_m[99] - 55e-6).abs() < 1e-9);
        assert!(errors_m.is_sorted_by(|before, after| before > after));
    }

    #[test]
    fn without_tolerance_readings_change_nothing() {
        let mut calibration = calibration();
        calibration.calibrator.deviation_m = 0.0;
        for gap in [0.0, gap_m(0.2205, 0.21)] {
            assert_eq!(calibration.update(gap), 0.21);
        }
        assert_eq!(calibration.calibrator.gap_error_m(50e-6), 50e-6);
        assert!(!calibration.calibrator.is_open());
    }

    #[test]
    fn a_length_beyond_tolerance_or_not_finite_is_refused() {
        for gap in [gap_m(0.25, 0.21), f32::NAN, f32::INFINITY, HEIGHT_M] {
            assert_eq!(calibration().update(gap), 0.21);
        }
    }
}
