//! The unknowns that solve the equations best, by least squares with what is known beforehand.

use nalgebra::SMatrix;

use super::Estimate;
use super::equation::{COUNT, Equation, Values};
use crate::fit::sharing;

/// Rounds in which the noise is estimated.
const ROUNDS: usize = 4;

/// The most probable unknowns.
pub(super) struct Solution {
    pub unknowns: Values,
    covariance: SMatrix<f64, COUNT, COUNT>,
}

impl Solution {
    /// Solves equations, with the unknowns' standard deviations known beforehand.
    pub fn of(equations: &[Equation], deviations: &Values) -> Self {
        let mut solution = Self {
            unknowns: Values::zeros(),
            covariance: SMatrix::from_diagonal(&deviations.component_mul(deviations)),
        };
        for _ in 0..ROUNDS {
            let noise_nm = [0, 1].map(|joint| noise_nm(equations, joint, &solution.unknowns));
            // In deviations of what is known beforehand, so that one of zero is no special case.
            let mut information = SMatrix::<f64, COUNT, COUNT>::identity();
            let mut gradient = Values::zeros();
            for equation in equations {
                let noise_nm = noise_nm[equation.joint];
                let by = equation.by.component_mul(deviations) / noise_nm;
                information += by * by.transpose();
                gradient += by * (equation.left_over_nm / noise_nm);
            }
            let Some(decomposed) = information.cholesky() else {
                break;
            };
            let scale = SMatrix::from_diagonal(deviations);
            solution = Self {
                unknowns: scale * decomposed.solve(&gradient),
                covariance: scale * decomposed.inverse() * scale,
            };
        }
        solution
    }

    /// Returns the factors of one unknown.
    pub fn unit(&self, index: usize) -> Values {
        let mut factors = Values::zeros();
        factors[index] = 1.0;
        factors
    }

    /// Returns a sum of unknowns.
    pub fn sum(&self, factors: &Values) -> Estimate {
        Estimate {
            value: factors.dot(&self.unknowns),
            deviation: libm::sqrt(factors.dot(&(self.covariance * factors))),
        }
    }
}

/// Returns the noise of an equation of a joint, N·m, times the root of the number of neighbours that share an error.
fn noise_nm(equations: &[Equation], joint: usize, unknowns: &Values) -> f64 {
    let of_joint = equations.iter().filter(|it| it.joint == joint);
    let off: Vec<f64> = of_joint.map(|it| it.off_nm(unknowns)).collect();
    let sum = off.iter().map(|it| it * it).sum::<f64>();
    // Both joints determine the unknowns that they share.
    let freedom = off.len().saturating_sub(COUNT / 2).max(1);
    libm::sqrt(sum * sharing(&off) / freedom as f64).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torques::equation::{FRICTION, OF_JOINT};

    #[test]
    fn a_joint_that_vibrates_does_not_blur_the_other() {
        let equations: Vec<Equation> = (0..400)
            .map(|index| {
                let joint = index % 2;
                let mut by = Values::zeros();
                by[OF_JOINT * joint + FRICTION] = 1.0;
                // No regular pattern.
                let noise = libm::sin(f64::from(index as u32).powi(2));
                Equation {
                    joint,
                    by,
                    left_over_nm: 0.05 + [1e-4, 1e-2][joint] * noise,
                }
            })
            .collect();
        let solution = Solution::of(&equations, &Values::repeat(1.0));
        let deviation = |joint: usize| {
            let friction = solution.unit(OF_JOINT * joint + FRICTION);
            solution.sum(&friction).deviation
        };
        assert!(
            deviation(0) < 0.02 * deviation(1),
            "{} {}",
            deviation(0),
            deviation(1)
        );
    }
}
