//! Dormand and Prince's Runge–Kutta pair of order 8(5,3) with dense output of order 7
//! (Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*,
//! section II.10; coefficients of their `dop853.f`).
//!
//! One step is one function call on stack memory: no allocation, no dispatch. The plant needs a step, an error estimate
//! and a polynomial; it locates contact events itself, so the rest of a solver library would be unused.

use nalgebra::SVector;

/// Error tolerance of one step: |error| ≤ absolute + relative·|x|, as a root mean square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Relative to each component.
    pub relative: f64,
    /// In the unit of the component.
    pub absolute: f64,
}

/// The stages of one step from (`t`, `x`) to (`t + h`, `end`).
#[derive(Clone, Debug)]
pub struct Dop853Step<const N: usize> {
    /// Start time, s.
    pub t: f64,
    /// Step size, s.
    pub h: f64,
    /// State at the start.
    pub start: SVector<f64, N>,
    /// State at the end, of order 8.
    pub end: SVector<f64, N>,
    /// Error relative to the tolerance: the step is accepted if this is at most 1.
    pub error: f64,
    stages: [SVector<f64, N>; 16],
}

impl<const N: usize> Dop853Step<N> {
    /// Returns an empty step, as memory for [`Dop853Step::take`].
    pub fn empty() -> Self {
        Self {
            t: 0.0,
            h: 0.0,
            start: SVector::zeros(),
            end: SVector::zeros(),
            error: 0.0,
            stages: [SVector::zeros(); 16],
        }
    }

    /// Integrates from (`t`, `x`) over `h`; `slope` is the derivative at (`t`, `x`).
    pub fn take<F>(
        &mut self,
        derivative: &F,
        t: f64,
        x: &SVector<f64, N>,
        slope: &SVector<f64, N>,
        h: f64,
        tolerance: &Tolerance,
    ) where
        F: Fn(f64, &SVector<f64, N>) -> SVector<f64, N>,
    {
        let k = &mut self.stages;
        k[0] = *slope;
        k[1] = derivative(
            t + 0.052_600_151_958_767_73 * h,
            &(x + (k[0] * 0.052_600_151_958_767_73) * h),
        );
        k[2] = derivative(
            t + 0.078_900_227_938_151_6 * h,
            &(x + (k[0] * 0.019_725_056_984_537_9 + k[1] * 0.059_175_170_953_613_7) * h),
        );
        k[3] = derivative(
            t + 0.118_350_341_907_227_4 * h,
            &(x + (k[0] * 0.029_587_585_476_806_85 + k[2] * 0.088_762_756_430_420_54) * h),
        );
        k[4] = derivative(
            t + 0.281_649_658_092_772_6 * h,
            &(x + (k[0] * 0.241_365_134_159_266_7 - k[2] * 0.884_549_479_328_286_1
                + k[3] * 0.924_834_003_261_792)
                * h),
        );
        k[5] = derivative(
            t + 0.333_333_333_333_333_3 * h,
            &(x + (k[0] * 0.037_037_037_037_037_035
                + k[3] * 0.170_828_608_729_473_86
                + k[4] * 0.125_467_687_566_822_42)
                * h),
        );
        k[6] = derivative(
            t + 0.25 * h,
            &(x + (k[0] * 0.037_109_375
                + k[3] * 0.170_252_211_019_544_05
                + k[4] * 0.060_216_538_980_455_96
                - k[5] * 0.017_578_125)
                * h),
        );
        k[7] = derivative(
            t + 0.307_692_307_692_307_7 * h,
            &(x + (k[0] * 0.037_092_000_118_504_79
                + k[3] * 0.170_383_925_712_239_98
                + k[4] * 0.107_262_030_446_373_28
                - k[5] * 0.015_319_437_748_624_402
                + k[6] * 0.008_273_789_163_814_023)
                * h),
        );
        k[8] = derivative(
            t + 0.651_282_051_282_051_3 * h,
            &(x + (k[0] * 0.624_110_958_716_075_7
                - k[3] * 3.360_892_629_446_941_4
                - k[4] * 0.868_219_346_841_726
                + k[5] * 27.592_099_699_446_71
                + k[6] * 20.154_067_550_477_894
                - k[7] * 43.489_884_181_069_96)
                * h),
        );
        k[9] = derivative(
            t + 0.6 * h,
            &(x + (k[0] * 0.477_662_536_438_264_34
                - k[3] * 2.488_114_619_971_667_7
                - k[4] * 0.590_290_826_836_843
                + k[5] * 21.230_051_448_181_193
                + k[6] * 15.279_233_632_882_423
                - k[7] * 33.288_210_968_984_86
                - k[8] * 0.020_331_201_708_508_627)
                * h),
        );
        k[10] = derivative(
            t + 0.857_142_857_142_857_1 * h,
            &(x + (k[0] * -0.937_142_430_085_987_3
                + k[3] * 5.186_372_428_844_064
                + k[4] * 1.091_437_348_996_729_5
                - k[5] * 8.149_787_010_746_927
                - k[6] * 18.520_065_659_996_96
                + k[7] * 22.739_487_099_350_505
                + k[8] * 2.493_605_552_679_652_3
                - k[9] * 3.046_764_471_898_219_6)
                * h),
        );
        k[11] = derivative(
            t + h,
            &(x + (k[0] * 2.273_310_147_516_538
                - k[3] * 10.534_495_466_737_25
                - k[4] * 2.000_872_058_224_862_5
                - k[5] * 17.958_931_863_118_8
                + k[6] * 27.948_884_529_419_96
                - k[7] * 2.858_998_277_135_023_5
                - k[8] * 8.872_856_933_530_63
                + k[9] * 12.360_567_175_794_303
                + k[10] * 0.643_392_746_015_763_6)
                * h),
        );
        let increment = k[0] * 0.054_293_734_116_568_765
            + k[5] * 4.450_312_892_752_409
            + k[6] * 1.891_517_899_314_500_3
            - k[7] * 5.801_203_960_010_585
            + k[8] * 0.311_164_366_957_819_9
            - k[9] * 0.152_160_949_662_516_1
            + k[10] * 0.201_365_400_804_030_34
            + k[11] * 0.044_710_615_727_772_59;
        self.t = t;
        self.h = h;
        self.start = *x;
        self.end = x + increment * h;

        let error_5 = k[0] * 0.013_120_044_994_194_88
            - k[5] * 1.225_156_446_376_204_4
            - k[6] * 0.495_758_949_657_250_2
            + k[7] * 1.664_377_182_454_986_4
            - k[8] * 0.350_328_848_749_973_66
            + k[9] * 0.334_179_118_713_017_5
            + k[10] * 0.081_923_206_485_115_71
            - k[11] * 0.022_355_307_863_886_294;
        let error_3 = k[0] * -0.189_800_754_072_407_62
            + k[5] * 4.450_312_892_752_409
            + k[6] * 1.891_517_899_314_500_3
            - k[7] * 5.801_203_960_010_585
            - k[8] * 0.422_682_321_323_791_97
            - k[9] * 0.152_160_949_662_516_1
            + k[10] * 0.201_365_400_804_030_34
            + k[11] * 0.022_651_792_198_360_825;
        let (mut square_5, mut square_3) = (0.0, 0.0);
        for i in 0..N {
            let scale = tolerance.absolute + tolerance.relative * x[i].abs().max(self.end[i].abs());
            square_5 += (error_5[i] / scale) * (error_5[i] / scale);
            square_3 += (error_3[i] / scale) * (error_3[i] / scale);
        }
        let weight = square_5 + 0.01 * square_3;
        self.error = if weight > 0.0 {
            h.abs() * square_5 / (weight * N as f64).sqrt()
        } else {
            // Also reached with NaN, which must not count as an accepted step.
            weight
        };
    }

    /// Returns the size for the next step (after an accepted one) or for another attempt.
    pub fn proposed_size(&self) -> f64 {
        // error^(−1/8), computed with square roots, which are the same on every host.
        let factor = 0.9 / self.error.sqrt().sqrt().sqrt();
        self.h * factor.clamp(0.2, 6.0)
    }

    /// Keeps the derivative at the end of the step, with which the next step may start.
    pub fn finish(&mut self, end_slope: &SVector<f64, N>) {
        self.stages[12] = *end_slope;
    }

    /// Returns the polynomial through the step; call it after [`Dop853Step::finish`]. Costs three
    /// evaluations.
    pub fn dense<F>(&mut self, derivative: &F) -> DenseStep<N>
    where
        F: Fn(f64, &SVector<f64, N>) -> SVector<f64, N>,
    {
        let (t, h, x) = (self.t, self.h, self.start);
        let k = &mut self.stages;
        k[13] = derivative(
            t + 0.1 * h,
            &(x + (k[0] * 0.056_167_502_283_047_954 + k[6] * 0.253_500_210_216_624_83
                - k[7] * 0.246_239_037_470_802_5
                - k[8] * 0.124_191_423_263_816_37
                + k[9] * 0.153_291_798_278_765_68
                + k[10] * 0.008_201_052_295_634_69
                + k[11] * 0.007_567_897_660_545_699
                - k[12] * 0.008_298)
                * h),
        );
        k[14] = derivative(
            t + 0.2 * h,
            &(x + (k[0] * 0.031_834_648_163_502_14
                + k[5] * 0.028_300_909_672_366_776
                + k[6] * 0.053_541_988_307_438_566
                - k[7] * 0.054_923_748_571_390_99
                - k[10] * 0.000_108_347_328_697_249_32
                + k[11] * 0.000_382_571_090_835_658_4
                - k[12] * 0.000_340_465_008_687_404_56
                + k[13] * 0.141_312_443_674_632_5)
                * h),
        );
        k[15] = derivative(
            t + 0.777_777_777_777_777_8 * h,
            &(x + (k[0] * -0.428_896_301_583_791_94 - k[5] * 4.697_621_415_361_164
                + k[6] * 7.683_421_196_062_599
                + k[7] * 4.068_989_818_397_11
                + k[8] * 0.356_727_187_455_281_1
                - k[12] * 0.001_399_024_165_159_014_5
                + k[13] * 2.947_514_789_152_772_4
                - k[14] * 9.150_958_472_179_87)
                * h),
        );
        let difference = self.end - x;
        let start_residual = k[0] * h - difference;
        DenseStep {
            t,
            h,
            coefficients: [
                x,
                difference,
                start_residual,
                difference * 2.0 - (k[12] + k[0]) * h,
                (k[0] * -8.428_938_276_109_013 + k[5] * 0.566_714_953_519_377_7
                    - k[6] * 3.068_949_945_949_891_7
                    + k[7] * 2.384_667_656_512_07
                    + k[8] * 2.117_034_582_445_028
                    - k[9] * 0.871_391_583_777_973
                    + k[10] * 2.240_437_430_260_788_3
                    + k[11] * 0.631_578_778_769_468_8
                    - k[12] * 0.088_990_336_451_333_31
                    + k[13] * 18.148_505_520_854_727
                    - k[14] * 9.194_632_392_478_356
                    - k[15] * 4.436_036_387_594_894)
                    * h,
                (k[0] * 10.427_508_642_579_134
                    + k[5] * 242.283_491_775_258_17
                    + k[6] * 165.200_451_717_270_28
                    - k[7] * 374.546_754_722_690_2
                    - k[8] * 22.113_666_853_125_306
                    + k[9] * 7.733_432_668_472_264
                    - k[10] * 30.674_084_731_089_398
                    - k[11] * 9.332_130_526_430_229
                    + k[12] * 15.697_238_121_770_845
                    - k[13] * 31.139_403_219_565_178
                    - k[14] * 9.352_924_358_844_48
                    + k[15] * 35.816_841_486_394_08)
                    * h,
                (k[0] * 19.985_053_242_002_433
                    - k[5] * 387.037_308_749_351_8
                    - k[6] * 189.178_138_195_167_58
                    + k[7] * 527.808_159_205_423_6
                    - k[8] * 11.573_902_539_959_63
                    + k[9] * 6.881_232_694_696_3
                    - k[10] * 1.000_605_096_691_083_8
                    + k[11] * 0.777_713_779_805_344_3
                    - k[12] * 2.778_205_752_353_508
                    - k[13] * 60.196_695_231_264_12
                    + k[14] * 84.320_405_506_677_16
                    + k[15] * 11.992_291_136_182_79)
                    * h,
                (k[0] * -25.693_933_462_703_75
                    - k[5] * 154.189_748_690_236_43
                    - k[6] * 231.529_379_176_045_5
                    + k[7] * 357.639_117_910_614_1
                    + k[8] * 93.405_324_183_624_32
                    - k[9] * 37.458_323_136_451_63
                    + k[10] * 104.099_649_508_962_3
                    + k[11] * 29.840_293_426_660_5
                    - k[12] * 43.533_456_590_011_14
                    + k[13] * 96.324_553_959_188_28
                    - k[14] * 39.177_261_675_615_44
                    - k[15] * 149.726_836_257_985_64)
                    * h,
            ],
        }
    }
}

/// The solution inside one step as a polynomial of degree 7.
#[derive(Clone, Debug)]
pub struct DenseStep<const N: usize> {
    t: f64,
    h: f64,
    coefficients: [SVector<f64, N>; 8],
}

impl<const N: usize> DenseStep<N> {
    /// Returns the state at a time inside the step.
    pub fn at(&self, t: f64) -> SVector<f64, N> {
        let s = (t - self.t) / self.h;
        let r = 1.0 - s;
        let c = &self.coefficients;
        c[0] + (c[1] + (c[2] + (c[3] + (c[4] + (c[5] + (c[6] + c[7] * s) * r) * s) * r) * s) * r)
            * s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    const TOLERANCE: Tolerance = Tolerance {
        relative: 1e-9,
        absolute: 1e-9,
    };

    fn pendulum(_: f64, x: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(x.y, -x.x.sin())
    }

    fn oscillator(_: f64, x: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(x.y, -x.x)
    }

    fn step_of(h: f64) -> Dop853Step<2> {
        let x = Vector2::new(0.3, 0.8);
        let mut step = Dop853Step::empty();
        step.take(&oscillator, 0.0, &x, &oscillator(0.0, &x), h, &TOLERANCE);
        let end_slope = oscillator(h, &step.end);
        step.finish(&end_slope);
        step
    }

    fn exact(t: f64) -> Vector2<f64> {
        let (sine, cosine) = t.sin_cos();
        Vector2::new(0.3 * cosine + 0.8 * sine, 0.8 * cosine - 0.3 * sine)
    }

    #[test]
    fn the_step_converges_with_order_8() {
        let error = |h: f64| (step_of(h).end - exact(h)).norm();
        let order = (error(0.8) / error(0.4)).log2();
        assert!((8.5..9.8).contains(&order), "local order {order}");
    }

    #[test]
    fn the_dense_output_converges_with_order_7() {
        let error = |h: f64| {
            let dense = step_of(h).dense(&oscillator);
            (1..10)
                .map(|i| h * f64::from(i) / 10.0)
                .map(|t| (dense.at(t) - exact(t)).norm())
                .fold(0.0, f64::max)
        };
        let order = (error(0.8) / error(0.4)).log2();
        assert!((7.5..8.8).contains(&order), "local order {order}");
    }

    #[test]
    fn steps_of_the_proposed_size_meet_the_tolerance() {
        let mut x = Vector2::new(2.0, 0.0);
        let (mut t, mut h) = (0.0, 0.01);
        let mut step = Dop853Step::empty();
        while t < 100.0 {
            step.take(&pendulum, t, &x, &pendulum(t, &x), h, &TOLERANCE);
            if step.error <= 1.0 {
                x = step.end;
                t += h;
            }
            h = step.proposed_size();
        }
        let energy = 0.5 * x.y * x.y - x.x.cos();
        assert!(
            (energy + 2.0_f64.cos()).abs() < 1e-7,
            "drift {}",
            energy + 2.0_f64.cos()
        );
    }

    #[test]
    fn a_nan_step_is_rejected() {
        let x = Vector2::new(f64::NAN, 0.0);
        let mut step = Dop853Step::empty();
        step.take(&oscillator, 0.0, &x, &oscillator(0.0, &x), 0.1, &TOLERANCE);
        assert!(step.error.is_nan());
    }
}
