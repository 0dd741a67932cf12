//! A success rate and its confidence interval.

use serde::Serialize;

/// 97.5 % quantile of the standard normal distribution.
pub(crate) const Z: f64 = 1.959_963_984_540_054;

/// Number of successes in a number of runs, with Wilson's 95 % interval, which also holds near 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proportion {
    /// Number of successes.
    pub successes: usize,
    /// Number of runs.
    pub runs: usize,
    /// Success rate, 0 … 1; 0 without runs.
    pub rate: f64,
    /// Lower bound of the interval.
    pub lower: f64,
    /// Upper bound of the interval.
    pub upper: f64,
}

impl Proportion {
    /// Creates the proportion from the number of successes and the number of runs.
    pub fn new(successes: usize, runs: usize) -> Self {
        if runs == 0 {
            return Self {
                successes,
                runs,
                rate: 0.0,
                lower: 0.0,
                upper: 1.0,
            };
        }
        let (n, rate) = (runs as f64, successes as f64 / runs as f64);
        let scale = 1.0 + Z * Z / n;
        let middle = (rate + Z * Z / (2.0 * n)) / scale;
        let half = Z * libm::sqrt(rate * (1.0 - rate) / n + Z * Z / (4.0 * n * n)) / scale;
        Self {
            successes,
            runs,
            rate,
            lower: (middle - half).max(0.0),
            upper: (middle + half).min(1.0),
        }
    }
}

impl core::fmt::Display for Proportion {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "{} of {}: {:.2} % ({:.2} … {:.2} %)",
            self.successes,
            self.runs,
            100.0 * self.rate,
            100.0 * self.lower,
            100.0 * self.upper
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newcombe (1998), table I, method 3.
    #[test]
    fn intervals_are_those_of_the_literature() {
        for (successes, runs, lower, upper) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let found = Proportion::new(successes, runs);
            assert!((found.lower - lower).abs() < 5e-5, "{found:?}");
            assert!((found.upper - upper).abs() < 5e-5, "{found:?}");
        }
        assert_eq!(Proportion::new(20, 20).upper, 1.0);
        assert_eq!(Proportion::new(0, 0).upper, 1.0);
    }
}
