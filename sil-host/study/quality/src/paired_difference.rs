//! The difference of two success rates in the same runs, and its confidence interval.

use crate::proportion::Z;

/// Difference of two success rates in pairs of runs, with the 95 % interval of Agresti and Min (2005):
/// that of Wald with half a run added to each of the four outcomes of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairedDifference {
    /// The second rate less the first, −1 … 1; 0 without pairs.
    pub difference: f64,
    /// Lower bound of the interval.
    pub lower: f64,
    /// Upper bound of the interval.
    pub upper: f64,
}

impl PairedDifference {
    /// Creates the difference from the numbers of pairs in which only the second (`gained`) or only
    /// the first (`lost`) run succeeds, and the number of all pairs.
    pub fn new(gained: usize, lost: usize, pairs: usize) -> Self {
        if pairs == 0 {
            return Self {
                difference: 0.0,
                lower: -1.0,
                upper: 1.0,
            };
        }
        let [gained, lost, pairs] = [gained, lost, pairs].map(|count| count as f64);
        let count = pairs + 2.0;
        let middle = (gained - lost) / count;
        let discordant = gained + lost + 1.0;
        let variance = (discordant - (gained - lost) * (gained - lost) / count) / (count * count);
        let half = Z * libm::sqrt(variance.max(0.0));
        Self {
            difference: (gained - lost) / pairs,
            lower: (middle - half).max(-1.0),
            upper: (middle + half).min(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact coverage: the pairs are trinomial, so all outcomes can be summed.
    #[test]
    fn the_interval_contains_the_true_difference_as_often_as_it_says() {
        const PAIRS: usize = 60;
        let choose = |n: usize, k: usize| {
            (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
        };
        for (gain, loss) in [(0.02, 0.1), (0.1, 0.1), (0.05, 0.4)] {
            let mut covered = 0.0;
            for gained in 0..=PAIRS {
                for lost in 0..=PAIRS - gained {
                    let same = PAIRS - gained - lost;
                    let probability = choose(PAIRS, gained)
                        * choose(PAIRS - gained, lost)
                        * f64::powi(gain, gained as i32)
                        * f64::powi(loss, lost as i32)
                        * f64::powi(1.0 - gain - loss, same as i32);
                    let found = PairedDifference::new(gained, lost, PAIRS);
                    if (found.lower..=found.upper).contains(&(gain - loss)) {
                        covered += probability;
                    }
                }
            }
            assert!((0.93..0.99).contains(&covered), "{gain} {loss}: {covered}");
        }
    }

    #[test]
    fn no_pairs_say_nothing_and_equal_pairs_no_difference() {
        assert_eq!(PairedDifference::new(0, 0, 0).lower, -1.0);
        let equal = PairedDifference::new(3, 3, 100);
        assert_eq!(equal.difference, 0.0);
        assert!((equal.lower + equal.upper).abs() < 1e-12);
    }
}
