//! Axis ranges that are robust to outliers, and their labels.

use std::ops::Range;

use super::decimate::Extent;

/// Fraction of the bins that may lie off scale at either end.
const OUTLIERS: f64 = 0.01;
/// All values are shown unless they make the axis this many times longer.
const WORTH_CLIPPING: f64 = 2.5;
/// Margin above and below the curve, as a fraction of its height.
const MARGIN: f64 = 0.08;

/// The range of a value axis, and the values beyond it.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueAxis {
    /// From bottom to top; never empty, always finite.
    pub range: Range<f64>,
    /// Smallest value, if it is below the range.
    pub off_scale_min: Option<f64>,
    /// Largest value, if it is above the range.
    pub off_scale_max: Option<f64>,
}

impl ValueAxis {
    /// Chooses the range for a set of curves.
    ///
    /// All values are shown if the ordinary ones stay readable; otherwise the
    /// axis ends slightly beyond the range of all but the most extreme one percent.
    /// The range always contains `include` and spans at least `minimum_span`, so
    /// that noise on a constant does not fill the panel.
    pub fn new(
        extents: impl Iterator<Item = Extent>,
        include: Option<f64>,
        minimum_span: f64,
    ) -> Self {
        let mut minima = Vec::new();
        let mut maxima = Vec::new();
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for extent in extents.filter(|extent| !extent.is_empty()) {
            least = least.min(extent.min);
            greatest = greatest.max(extent.max);
            // An infinite extreme hides the other values of its bin; the first and last values
            // stand in for them.
            minima.extend(
                [extent.min, extent.first]
                    .into_iter()
                    .find(|v| v.is_finite()),
            );
            maxima.extend(
                [extent.max, extent.last]
                    .into_iter()
                    .find(|v| v.is_finite()),
            );
        }
        minima.sort_unstable_by(f64::total_cmp);
        maxima.sort_unstable_by(f64::total_cmp);

        let (Some(ordinary_min), Some(ordinary_max)) = (
            quantile(&minima, OUTLIERS),
            quantile(&maxima, 1.0 - OUTLIERS),
        ) else {
            return Self::padded(include.unwrap_or(0.0), include.unwrap_or(0.0), minimum_span);
        };
        let with_include = |low: f64, high: f64| {
            include.map_or((low, high), |value| (low.min(value), high.max(value)))
        };
        let ordinary = with_include(
            ordinary_min.min(ordinary_max),
            ordinary_max.max(ordinary_min),
        );
        let ordinary_span = (ordinary.1 - ordinary.0).max(minimum_span);

        let everything = with_include(least, greatest);
        let (low, high) = if everything.1 - everything.0 <= WORTH_CLIPPING * ordinary_span {
            everything
        } else {
            // Each end stretches on its own: a spike upwards does not move the lower end.
            let room = 0.25 * ordinary_span;
            (
                everything.0.max(ordinary.0 - room),
                everything.1.min(ordinary.1 + room),
            )
        };
        let mut axis = Self::padded(low, high, minimum_span);
        axis.off_scale_min = (least < axis.range.start).then_some(least);
        axis.off_scale_max = (greatest > axis.range.end).then_some(greatest);
        axis
    }

    fn padded(low: f64, high: f64, minimum_span: f64) -> Self {
        // Values beyond this limit are indistinguishable in print, and their difference
        // must stay finite.
        let (low, high) = (low.clamp(-1e300, 1e300), high.clamp(-1e300, 1e300));
        let relative = 1e-9 * low.abs().max(high.abs());
        let missing = (minimum_span.max(relative) - (high - low)).max(0.0);
        let margin = MARGIN * (high - low + missing) + 0.5 * missing;
        Self {
            range: low - margin..high + margin,
            off_scale_min: None,
            off_scale_max: None,
        }
    }

    /// Clamps a value to the range.
    pub fn clamp(&self, value: f64) -> f64 {
        value.clamp(self.range.start, self.range.end)
    }

    /// Returns a note on the off-scale values; empty if there are none.
    pub fn off_scale_note(&self, unit: &str) -> String {
        match (self.off_scale_min, self.off_scale_max) {
            (None, None) => String::new(),
            (Some(min), None) => format!("off scale: down to {} {unit}", short(min)),
            (None, Some(max)) => format!("off scale: up to {} {unit}", short(max)),
            (Some(min), Some(max)) => {
                format!("off scale: {} … {} {unit}", short(min), short(max))
            }
        }
    }
}

/// Returns labels of an axis of base-10 logarithms within its range: powers of ten, with as many multiples between them as
/// four labels need.
pub fn logarithmic(range: &Range<f64>) -> Vec<(f64, String)> {
    let steps: [(&[i32], i32); 4] = [
        (&[1], 0),
        (&[1, 2, 5], 0),
        (&[1, 2, 3, 4, 5, 6, 7, 8, 9], 0),
        (
            &[10, 12, 15, 17, 20, 25, 30, 35, 40, 45, 50, 60, 70, 80, 90],
            1,
        ),
    ];
    let mut labels = Vec::new();
    for (multiples, more) in steps {
        let decades = range.start.floor() as i32..=range.end.ceil() as i32;
        labels = decades
            .flat_map(|decade| {
                multiples
                    .iter()
                    .map(move |multiple| (*multiple, decade - more))
            })
            .map(|(multiple, decade)| {
                let value = f64::from(multiple) * 10_f64.powi(decade);
                let decimals = (-decade).max(0) as usize;
                (value.log10(), format!("{value:.decimals$}"))
            })
            .filter(|(place, _)| range.contains(place))
            .collect();
        if labels.len() >= 4 {
            break;
        }
    }
    labels
}

/// Formats a label with enough decimals to distinguish values `step` apart.
pub fn label(value: f64, step: f64) -> String {
    if !(1e-6..1e7).contains(&step) {
        // One digit more than separates the value from its neighbours.
        let digits = (value.abs() / step).log10().ceil().clamp(1.0, 15.0) as usize;
        return format!("{value:.digits$e}").replace('-', "−");
    }
    // Ticks are at 1, 2 or 5 times a power of ten below the step.
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    let is_zero = text
        .trim_start_matches('-')
        .chars()
        .all(|c| c == '0' || c == '.');
    match text.strip_prefix('-') {
        Some(positive) if is_zero => positive.to_owned(),
        Some(positive) => format!("−{positive}"),
        None => text,
    }
}

/// Formats a value with three digits, for notes.
fn short(value: f64) -> String {
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    if value.abs() >= 1e5 {
        return format!("{value:.1e}").replace('-', "−");
    }
    label(value, value.abs() / 100.0)
}

/// Returns the value below which a fraction `p` of the sorted values lies.
fn quantile(sorted: &[f64], p: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    sorted.get((p * last as f64).round() as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn axis(values: &[f64]) -> ValueAxis {
        ValueAxis::new(
            values.iter().map(|&value| Extent::of(value)),
            Some(0.0),
            1.0,
        )
    }

    #[test]
    fn a_spike_is_clamped_and_noted_but_a_frequent_value_is_shown() {
        let mut values = vec![10.0; 1000];
        values[500] = 480.0;
        let spiky = axis(&values);
        assert!(spiky.range.end < 20.0, "{spiky:?}");
        assert_eq!(spiky.off_scale_max, Some(480.0));
        assert_eq!(spiky.off_scale_note("N"), "off scale: up to 480 N");
        values[500] = f64::INFINITY;
        assert_eq!(axis(&values).off_scale_note("N"), "off scale: up to ∞ N");

        values[..300].fill(480.0);
        values[500] = 10.0;
        assert!(axis(&values).range.end > 480.0);
        // A mild overshoot stays in the picture.
        values.fill(10.0);
        values[500] = 16.0;
        assert_eq!(axis(&values).off_scale_note("N"), "");
    }

    #[test]
    fn labels_have_enough_decimals_for_their_step() {
        assert_eq!(label(0.148, 0.02), "0.15");
        assert_eq!(label(-0.148, 0.005), "−0.148");
        assert_eq!(label(-1e-17, 0.5), "0.0");
        assert_eq!(label(20.0, 10.0), "20");
        assert_eq!(label(-3e9, 1e9), "−3.0e9");
        assert_eq!(short(-1234.5), "−1234");
        assert_eq!(short(12.345), "12.3");
    }

    proptest! {
        #[test]
        fn any_range_is_finite_and_not_empty(
            values in prop::collection::vec(
                prop_oneof![
                    any::<f64>(), -10.0..10.0, Just(f64::INFINITY), Just(f64::NAN), Just(0.148),
                ],
                0..50,
            ),
        ) {
            let axis = axis(&values);
            let span = axis.range.end - axis.range.start;
            prop_assert!(span.is_finite() && span >= 1.0, "{axis:?}");
            prop_assert!(axis.range.contains(&0.0));
            for value in values.into_iter().filter(|value| !value.is_nan()) {
                prop_assert!((axis.range.start..=axis.range.end).contains(&axis.clamp(value)));
                let _ = (label(value, span / 5.0), short(value));
            }
        }
    }

    #[test]
    fn a_logarithmic_axis_has_as_many_labels_as_it_needs() {
        let names = |low: f64, high: f64| {
            let labels = logarithmic(&(low.log10()..high.log10()));
            labels.into_iter().map(|(_, name)| name).collect::<Vec<_>>()
        };
        assert_eq!(
            names(0.005, 2000.0),
            ["0.01", "0.1", "1", "10", "100", "1000"]
        );
        assert_eq!(
            names(0.9, 201.0),
            ["1", "2", "5", "10", "20", "50", "100", "200"]
        );
        assert_eq!(names(0.29, 0.61), ["0.3", "0.4", "0.5", "0.6"]);
        assert_eq!(names(0.024, 0.041), ["0.025", "0.030", "0.035", "0.040"]);
    }
}
