//! RODAS, Hairer and Wanner's linearly implicit Runge–Kutta pair of order 4(3): six stages,
//! L-stable, stiffly accurate (*Solving Ordinary Differential Equations II*, section IV.7; coefficients
//! of their `rodas.f`, method 1).
//!
//! It serves compliant contacts: at a stiffness of 10⁸ N/m, transients decay within microseconds,
//! which would force an explicit method to take tiny steps throughout. A step costs one Jacobian by
//! differences, one factorisation and six evaluations, on stack memory. `diffsol` 0.18 also has
//! such methods, but with heap vectors in every step; as the plant takes only a step or two per
//! control tick, this would be most of its cost.

use nalgebra::{Const, DimMin, SMatrix, SVector, ToTypenum};

const GAMMA: f64 = 0.25;
/// Times of the stages, as fractions of the step.
const ALPHA: [f64; 4] = [0.0, 0.386, 0.21, 0.63];
/// Weights of h ∂f/∂t in the stages.
const GAMMA_SUM: [f64; 4] = [0.25, -0.1043, 0.1035, -0.0362];
const A: [&[f64]; 5] = [
    &[],
    &[1.544],
    &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
    &[
        3.314_825_187_068_521,
        2.896_124_015_972_201,
        0.998_641_913_997_781_7,
    ],
    &[
        1.221_224_509_226_641,
        6.019_134_481_288_629,
        12.537_083_329_320_87,
        -0.687_886_036_105_895,
    ],
];
const C: [&[f64]; 6] = [
    &[],
    &[-5.6688],
    &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
    &[
        -0.107_352_905_815_137_5,
        -9.594_562_251_023_355,
        -20.470_286_148_096_16,
    ],
    &[
        7.496_443_313_967_647,
        -10.246_804_314_643_52,
        -33.999_903_528_199_05,
        11.708_908_932_061_6,
    ],
    &[
        8.083_246_795_921_522,
        -7.981_132_988_064_893,
        -31.521_594_328_743_71,
        16.319_305_431_231_36,
        -6.058_818_238_834_054,
    ],
];

/// Equations of N states.
pub trait Equations<const N: usize> {
    /// Time derivative of the state `x` at `t_s`.
    fn derivative(&self, t_s: f64, x: &SVector<f64, N>) -> SVector<f64, N>;

    /// Returns whether the derivative depends on the state only, so that ∂f/∂t is not needed.
    fn is_autonomous(&self) -> bool {
        false
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug)]
pub struct RosenbrockStep<const N: usize> {
    /// State at the end, of order 4.
    pub end: SVector<f64, N>,
    /// Error relative to the tolerance: the step is accepted if this is at most 1.
    pub error: f64,
}

impl<const N: usize> RosenbrockStep<N> {
    /// Returns the factor from this step's size to that of the next step or attempt.
    pub fn growth(&self) -> f64 {
        if !self.error.is_finite() {
            return 0.1;
        }
        // error^(−1/4), computed with square roots, which are the same on every host.
        (0.9 / self.error.max(1e-12).sqrt().sqrt()).clamp(0.2, 6.0)
    }
}

/// Derivative and Jacobian at the start of a step, used for all attempts at it.
#[derive(Clone, Debug)]
pub struct Linearised<const N: usize> {
    t_s: f64,
    start: SVector<f64, N>,
    slope: SVector<f64, N>,
    time_slope: SVector<f64, N>,
    jacobian: SMatrix<f64, N, N>,
}

impl<const N: usize> Linearised<N>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>> + ToTypenum,
{
    /// Linearises at (`t_s`, `start`) by differences.
    pub fn new(equations: &impl Equations<N>, t_s: f64, start: &SVector<f64, N>) -> Self {
        let slope = equations.derivative(t_s, start);
        let mut jacobian = SMatrix::<f64, N, N>::zeros();
        let mut moved = *start;
        for column in 0..N {
            // Half the digits of the state; for values near zero, half the digits of 1e-3.
            let step = 1.5e-8 * start[column].abs().max(1e-3);
            moved[column] = start[column] + step;
            let exact = moved[column] - start[column];
            let difference = equations.derivative(t_s, &moved) - slope;
            jacobian.set_column(column, &(difference / exact));
            moved[column] = start[column];
        }
        let time_slope = if equations.is_autonomous() {
            SVector::zeros()
        } else {
            let step = 1.5e-8 * t_s.abs().max(1e-2);
            let later = t_s + step;
            (equations.derivative(later, start) - slope) / (later - t_s)
        };
        Self {
            t_s,
            start: *start,
            slope,
            time_slope,
            jacobian,
        }
    }

    /// Integrates over `h`, with the error of every component weighted by `tolerance` · (1 + |x|).
    pub fn step(&self, equations: &impl Equations<N>, h: f64, tolerance: f64) -> RosenbrockStep<N> {
        let failed = RosenbrockStep {
            end: self.start,
            error: f64::NAN,
        };
        let mut matrix = -self.jacobian;
        for i in 0..N {
            matrix[(i, i)] += 1.0 / (GAMMA * h);
        }
        let factors = matrix.lu();
        let mut k = [SVector::<f64, N>::zeros(); 6];
        for stage in 0..4 {
            let slope = if stage == 0 {
                self.slope
            } else {
                let mut x = self.start;
                for (k, a) in k.iter().zip(A[stage]) {
                    x += k * *a;
                }
                equations.derivative(self.t_s + ALPHA[stage] * h, &x)
            };
            let mut right = slope + self.time_slope * (GAMMA_SUM[stage] * h);
            for (k, c) in k.iter().zip(C[stage]) {
                right += k * (c / h);
            }
            if !factors.solve_mut(&mut right) {
                return failed;
            }
            k[stage] = right;
        }
        let mut end = self.start;
        for (k, a) in k.iter().zip(A[4]) {
            end += k * *a;
        }
        for stage in 4..6 {
            let mut right = equations.derivative(self.t_s + h, &end);
            for (k, c) in k.iter().zip(C[stage]) {
                right += k * (c / h);
            }
            if !factors.solve_mut(&mut right) {
                return failed;
            }
            k[stage] = right;
            end += right;
        }
        let mut square = 0.0;
        for i in 0..N {
            let scale = tolerance * (1.0 + self.start[i].abs().max(end[i].abs()));
            square += (k[5][i] / scale) * (k[5][i] / scale);
        }
        RosenbrockStep {
            end,
            error: (square / N as f64).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A damped, driven oscillator: x'' + 2 x' + 5 x = cos t, started on its exact solution.
    struct Driven;

    impl Equations<2> for Driven {
        fn derivative(&self, t_s: f64, x: &SVector<f64, 2>) -> SVector<f64, 2> {
            SVector::from([x[1], libm::cos(t_s) - 5.0 * x[0] - 2.0 * x[1]])
        }
    }

    fn steady(t_s: f64) -> SVector<f64, 2> {
        let (sine, cosine) = (libm::sin(t_s), libm::cos(t_s));
        SVector::from([0.2 * cosine + 0.1 * sine, 0.1 * cosine - 0.2 * sine])
    }

    fn error_after(steps: u32) -> f64 {
        let h = 2.0 / f64::from(steps);
        let mut x = steady(0.0);
        for step in 0..steps {
            let t_s = f64::from(step) * h;
            x = Linearised::new(&Driven, t_s, &x).step(&Driven, h, 1.0).end;
        }
        (x - steady(2.0)).norm()
    }

    #[test]
    fn halving_the_step_divides_the_error_by_sixteen() {
        let ratio = error_after(10) / error_after(20);
        assert!((11.0..24.0).contains(&ratio), "{ratio}");
    }

    /// Prothero and Robinson's x' = λ (x − cos t) − sin t.
    struct Stiff(f64);

    impl Equations<1> for Stiff {
        fn derivative(&self, t_s: f64, x: &SVector<f64, 1>) -> SVector<f64, 1> {
            SVector::from([self.0 * (x[0] - libm::cos(t_s)) - libm::sin(t_s)])
        }
    }

    #[test]
    fn a_stiff_transient_decays_in_one_long_step() {
        let stiff = Stiff(-1e8);
        let start = SVector::from([2.0]);
        let step = Linearised::new(&stiff, 0.0, &start).step(&stiff, 0.1, 1e-6);
        assert!((step.end[0] - libm::cos(0.1)).abs() < 1e-4, "{step:?}");
    }
}
