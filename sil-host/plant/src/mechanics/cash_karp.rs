//! Cash and Karp's Runge–Kutta pair of order 5(4), the cheaper method for truncated steps.
//!
//! A controller changes the torque every millisecond or sooner. Error control would allow
//! [`dop853`](super::dop853) steps ten times as long, so most of the accuracy of its thirteen
//! evaluations is wasted. Six evaluations are enough: at 1 ms in sliding, this pair estimates an
//! error of 2 % of a tolerance of 1e-9 (`docs/benchmarks.md` shows error against cost).
//!
//! Coefficients: Cash and Karp, *A variable order Runge–Kutta method for initial value problems
//! with rapidly varying right-hand sides*, ACM Transactions on Mathematical Software 16 (1990).

use nalgebra::SVector;

use super::dop853::Tolerance;

/// Times of the five stages after the start, as fractions of the step.
pub const NODES: [f64; 5] = [1.0 / 5.0, 3.0 / 10.0, 3.0 / 5.0, 1.0, 7.0 / 8.0];

/// Result of a short step.
#[derive(Clone, Copy, Debug)]
pub struct ShortStep<const N: usize> {
    /// State at the end, of order 5.
    pub end: SVector<f64, N>,
    /// Error of the embedded solution of order 4 relative to the tolerance: the step is accepted if
    /// this is at most 1.
    pub error: f64,
}

impl<const N: usize> ShortStep<N> {
    /// Integrates from (`t`, `x`) over `h`; `slope` is the derivative at (`t`, `x`). `derivative`
    /// also receives the number of the stage, from 0, whose time is `t` + [`NODES`] `h`.
    #[inline]
    pub fn take<F>(
        derivative: F,
        t: f64,
        x: &SVector<f64, N>,
        slope: &SVector<f64, N>,
        h: f64,
        tolerance: &Tolerance,
    ) -> Self
    where
        F: Fn(usize, f64, &SVector<f64, N>) -> SVector<f64, N>,
    {
        let at = |stage: usize, x: &SVector<f64, N>| derivative(stage, t + h * NODES[stage], x);
        let k1 = *slope;
        let k2 = at(0, &(x + k1 * (h / 5.0)));
        let k3 = at(1, &(x + (k1 * (3.0 / 40.0) + k2 * (9.0 / 40.0)) * h));
        let k4 = at(
            2,
            &(x + (k1 * (3.0 / 10.0) - k2 * (9.0 / 10.0) + k3 * (6.0 / 5.0)) * h),
        );
        let k5 = at(
            3,
            &(x + (k1 * (-11.0 / 54.0) + k2 * (5.0 / 2.0) - k3 * (70.0 / 27.0)
                + k4 * (35.0 / 27.0))
                * h),
        );
        let k6 = at(
            4,
            &(x + (k1 * (1631.0 / 55296.0)
                + k2 * (175.0 / 512.0)
                + k3 * (575.0 / 13824.0)
                + k4 * (44275.0 / 110_592.0)
                + k5 * (253.0 / 4096.0))
                * h),
        );
        let end = x
            + (k1 * (37.0 / 378.0)
                + k3 * (250.0 / 621.0)
                + k4 * (125.0 / 594.0)
                + k6 * (512.0 / 1771.0))
                * h;
        let difference = (k1 * (37.0 / 378.0 - 2825.0 / 27648.0)
            + k3 * (250.0 / 621.0 - 18575.0 / 48384.0)
            + k4 * (125.0 / 594.0 - 13525.0 / 55296.0)
            - k5 * (277.0 / 14336.0)
            + k6 * (512.0 / 1771.0 - 1.0 / 4.0))
            * h;
        let mut square = 0.0;
        for i in 0..N {
            let scale = tolerance.absolute + tolerance.relative * x[i].abs().max(end[i].abs());
            square += (difference[i] / scale) * (difference[i] / scale);
        }
        Self {
            end,
            error: (square / N as f64).sqrt(),
        }
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

    /// ẋ = cos t², a derivative that depends on time and state.
    fn slope(t: f64, x: &Vector2<f64>) -> Vector2<f64> {
        2.0 * t * Vector2::new(-x.y, x.x)
    }

    fn step(h: f64) -> ShortStep<2> {
        let x = Vector2::new(0.36_f64.cos(), 0.36_f64.sin());
        ShortStep::take(
            |_, t, x| slope(t, x),
            0.6,
            &x,
            &slope(0.6, &x),
            h,
            &TOLERANCE,
        )
    }

    fn error(h: f64) -> f64 {
        let square = (0.6 + h) * (0.6 + h);
        (step(h).end - Vector2::new(square.cos(), square.sin())).norm()
    }

    #[test]
    fn the_step_converges_with_order_5() {
        let order = (error(0.2) / error(0.1)).log2();
        assert!((5.5..6.8).contains(&order), "local order {order}");
    }

    #[test]
    fn the_estimate_converges_with_order_4_and_lies_above_the_error() {
        let order = (step(0.2).error / step(0.1).error).log2();
        assert!((4.5..5.8).contains(&order), "local order {order}");
        assert!(step(0.1).error * 1e-9 > error(0.1));
    }

    #[test]
    fn a_nan_step_is_rejected() {
        let x = Vector2::new(f64::NAN, 0.0);
        let error = ShortStep::take(|_, t, x| slope(t, x), 0.0, &x, &x, 0.1, &TOLERANCE).error;
        assert!(error.is_nan());
    }
}
