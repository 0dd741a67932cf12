//! Grids of parameter values: `FROM:TO:STEP` or `a,b,c`.

use std::str::FromStr;

/// Largest number of values in a grid.
const MOST_VALUES: f64 = 1e6;

/// Largest magnitude of a value: above any number of a study, and short enough to write in decimals.
const LARGEST: f64 = 1e9;

/// Most decimals: an `f64` cannot resolve more for numbers near one.
const MOST_DECIMALS: usize = 15;

/// Finite values in the order given; at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    values: Vec<f64>,
}

impl Grid {
    /// The values, in order.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Creates a grid of one value.
    pub fn of(value: f64) -> Self {
        Self {
            values: vec![value],
        }
    }

    fn range(text: &str, from: f64, to: f64, step: f64) -> Result<Self, String> {
        if step == 0.0 {
            return Err(format!(
                "'{text}' has step 0; give a step that leads from FROM to TO"
            ));
        }
        let steps = (to - from) / step;
        if steps < 0.0 {
            return Err(format!(
                "'{text}' is empty: step {step} leads away from {to}; start at {from} with step {}",
                -step
            ));
        }
        if steps >= MOST_VALUES {
            let count = steps + 1.0;
            return Err(format!(
                "'{text}' has {count:e} values; at most {MOST_VALUES:e} are allowed"
            ));
        }
        // Multiples of a decimal step are rounded to decimals: 3 · 0.1 is 0.3.
        let decimals = decimals(from).max(decimals(step));
        // The end belongs to the range if the last multiple is within rounding of it.
        let slack = 0.5 * f64::EPSILON * from.abs().max(to.abs());
        let values = (0..=steps.round() as u64)
            .map(|index| rounded(from + index as f64 * step, decimals))
            .filter(|value| (value - to) * step.signum() <= slack)
            .collect();
        Ok(Self { values })
    }
}

impl FromStr for Grid {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim().is_empty() {
            return Err(format!(
                "'{text}' holds no values; give FROM:TO:STEP or a list, for example 0.4,0.6"
            ));
        }
        let separator = if text.contains(':') { ':' } else { ',' };
        let values = text
            .split(separator)
            .map(|part| match part.trim().parse::<f64>() {
                Ok(value) if value.abs() <= LARGEST => Ok(value + 0.0),
                _ => Err(format!(
                    "'{part}' in '{text}' is not a number from -{LARGEST:e} to {LARGEST:e}; give FROM:TO:STEP or a list a,b,c"
                )),
            })
            .collect::<Result<Vec<_>, _>>()?;
        match (separator, values.as_slice()) {
            (':', &[from, to, step]) => Self::range(text, from, to, step),
            (':', parts) => Err(format!(
                "'{text}' has {} parts; a range has three, FROM:TO:STEP, for example -1:-0.1:0.005",
                parts.len()
            )),
            _ => Ok(Self {
                values: once(&values),
            }),
        }
    }
}

/// Returns the number of decimals of the shortest text that parses to this value.
fn decimals(value: f64) -> usize {
    let text = value.to_string();
    text.split_once('.')
        .map_or(0, |(_, decimals)| decimals.len())
}

/// Returns the nearest number with this many decimals; never a negative zero.
fn rounded(value: f64, decimals: usize) -> f64 {
    if decimals > MOST_DECIMALS {
        return value;
    }
    format!("{value:.decimals$}").parse().unwrap_or(value) + 0.0
}

/// Returns the values of a list on the command line in their order, each once.
pub fn once<T: Clone + PartialEq>(values: &[T]) -> Vec<T> {
    let mut once: Vec<T> = Vec::new();
    for value in values {
        if !once.contains(value) {
            once.push(value.clone());
        }
    }
    once
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn values(text: &str) -> Vec<f64> {
        text.parse::<Grid>().unwrap().values
    }

    #[test]
    fn ranges_hold_decimals_and_both_ends() {
        assert_eq!(values("0.1:0.5:0.1"), [0.1, 0.2, 0.3, 0.4, 0.5]);
        assert_eq!(values("-0.1:0.1:0.1"), [-0.1, 0.0, 0.1]);
        assert_eq!(values("1:0.25:-0.25"), [1.0, 0.75, 0.5, 0.25]);
        assert_eq!(values("0:1:0.4"), [0.0, 0.4, 0.8]);
        assert_eq!(values("2:2:1"), [2.0]);
        assert_eq!(values("0:3e-3:1e-3"), [0.0, 0.001, 0.002, 0.003]);
        let speeds = values("-1:-0.1:0.005");
        assert_eq!((speeds.len(), speeds[180]), (181, -0.1));
        assert_eq!(speeds[85].to_string(), "-0.575");
        // A negative zero would print as -0.
        assert!(values("-0.1:0.1:0.1")[1].is_sign_positive());
    }

    #[test]
    fn lists_keep_their_order() {
        assert_eq!(values("0.6"), [0.6]);
        assert_eq!(values(" 3, -1 ,2"), [3.0, -1.0, 2.0]);
    }

    #[test]
    fn invalid_grids_are_reported_with_the_allowed_form() {
        for (text, part) in [
            ("", "holds no values"),
            ("  ", "holds no values"),
            ("0.1,,0.3", "'' in '0.1,,0.3' is not a number"),
            ("0.4,high", "'high' in '0.4,high' is not a number"),
            ("nan", "not a number from -1e9 to 1e9"),
            ("0:1e308:1e302", "'1e308' in"),
            ("0:inf:1", "'inf' in '0:inf:1'"),
            ("0:1", "has 2 parts"),
            ("0:1:2:3", "has 4 parts"),
            ("0:1:0", "step 0"),
            ("0:1:-0", "step 0"),
            ("0:1:-0.1", "leads away from 1; start at 0 with step 0.1"),
            ("-0.1:-1:0.005", "step 0.005 leads away from -1"),
            ("0:1:1e-9", "at most 1e6"),
        ] {
            let message = text.parse::<Grid>().unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    proptest! {
        #[test]
        fn a_range_counts_as_in_whole_numbers(
            from in -1000_i64..1000, count in 1_i64..300, step in 1_i64..50, digits in 0_u32..5, down: bool,
        ) {
            let step = if down { -step } else { step };
            let scale = 10_f64.powi(digits as i32);
            let decimal = |whole: i64| whole as f64 / scale;
            let to = from + (count - 1) * step;
            let text = format!("{}:{}:{}", decimal(from), decimal(to), decimal(step));
            let expected: Vec<f64> = (0..count).map(|i| decimal(from + i * step)).collect();
            prop_assert_eq!(values(&text), expected);
        }

        #[test]
        fn no_text_panics(text in "[-0-9.:,ea inf]{0,20}") {
            let _ = text.parse::<Grid>();
        }
    }

    #[test]
    fn what_is_given_twice_is_there_once() {
        assert_eq!(once(&[3, 1, 3]), [3, 1]);
    }
}
