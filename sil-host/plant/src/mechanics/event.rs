//! Location of events inside a step: the tip lands, slip vanishes, contact ends.

/// Resolution of event times, s.
const RESOLUTION_S: f64 = 1e-15;

/// Finds a time between `before` and `after` at which `margin` turns negative, up to rounding, by
/// the ITP method (Oliveira and Takahashi 2020). Both arguments are a time (s) with the margin at
/// that time: not negative before, negative after. The returned time is on the negative side, so
/// that the event has happened there.
pub fn first_negative(before: (f64, f64), after: (f64, f64), margin: impl Fn(f64) -> f64) -> f64 {
    let (mut lower, mut at_lower) = before;
    let (mut upper, mut at_upper) = after;
    let slack = libm::log2(((upper - lower) / RESOLUTION_S).max(1.0)).ceil() as i32 + 1;
    let truncation = 0.2 / (upper - lower);
    // The method ends after `slack` halvings; the higher bound allows for rounding.
    for iteration in 0..2 * slack {
        let width = upper - lower;
        if width <= RESOLUTION_S {
            break;
        }
        let middle = 0.5 * (lower + upper);
        // Regula falsi, pushed towards the middle, limited to the convergence of bisection.
        let falsi = (lower * at_upper - upper * at_lower) / (at_upper - at_lower);
        let towards_middle = (middle - falsi).signum();
        let push = (truncation * width * width).min((middle - falsi).abs());
        let radius = 0.5 * (libm::ldexp(RESOLUTION_S, (slack - iteration).clamp(0, 60)) - width);
        let pushed = falsi + towards_middle * push;
        let point = if (pushed - middle).abs() <= radius.max(0.0) {
            pushed
        } else {
            middle - towards_middle * radius.max(0.0)
        };
        let inside = |t: f64| t > lower && t < upper;
        let point = if inside(point) { point } else { middle };
        if !inside(point) {
            break;
        }
        let value = margin(point);
        if value < 0.0 {
            (upper, at_upper) = (point, value);
        } else {
            (lower, at_lower) = (point, value);
        }
    }
    upper
}

/// Returns whether a quantity stays above `threshold` within a step, judged by its values, slopes
/// and curvatures at both ends: the quintic through them lies in the hull of its Bernstein
/// coefficients.
pub fn stays_above(threshold: f64, h: f64, start: [f64; 3], end: [f64; 3]) -> bool {
    let [g0, v0, a0] = start;
    let [g1, v1, a1] = end;
    let (first, second) = (h / 5.0, h * h / 20.0);
    [
        g0,
        g0 + v0 * first,
        g0 + 2.0 * v0 * first + a0 * second,
        g1 - 2.0 * v1 * first + a1 * second,
        g1 - v1 * first,
        g1,
    ]
    .into_iter()
    .all(|coefficient| coefficient > threshold)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn locate(lower: f64, upper: f64, margin: impl Fn(f64) -> f64) -> f64 {
        let ends = [lower, upper].map(|t| (t, margin(t)));
        first_negative(ends[0], ends[1], margin)
    }

    proptest! {
        #[test]
        fn roots_are_found_on_the_negative_side(root in 0.001_f64..0.999, curve in -0.9_f64..0.9) {
            let margin = |t: f64| (root - t) * (1.0 + curve * t) * 3.0;
            let found = locate(0.0, 1.0, margin);
            prop_assert!(margin(found) < 0.0);
            prop_assert!((found - root).abs() < 4e-15);
        }

        #[test]
        fn a_quintic_that_dips_below_is_never_accepted(
            c in proptest::array::uniform6(-1.0_f64..3.0),
        ) {
            let value = |t: f64| c.iter().rev().fold(0.0, |sum, a| sum * t + a);
            let slope = |t: f64| (1..6).rev().fold(0.0, |sum, i| sum * t + i as f64 * c[i]);
            let curvature = |t: f64| (2..6).rev().fold(0.0, |sum, i| sum * t + (i * (i - 1)) as f64 * c[i]);
            let ends = |t: f64| [value(t), slope(t), curvature(t)];
            let lowest = (0..=200).map(|i| value(f64::from(i) / 200.0)).fold(f64::INFINITY, f64::min);
            prop_assert!(lowest > 0.0 || !stays_above(0.0, 1.0, ends(0.0), ends(1.0)));
        }
    }

    #[test]
    fn a_steep_root_is_found_too() {
        let found = locate(0.0, 1.0, |t| if t < 0.7 { 1e-12 } else { -1e6 });
        assert!((found - 0.7).abs() < 1e-14);
    }
}
