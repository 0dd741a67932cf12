//! The lines p = 0 and b = 0, accurate to rounding.

use painleve_plant::belt_line::{BeltLine, bisected, positive_stretches};
use painleve_shared::{Arm, GeneralisedTorque, LinkMotion, Pose, Posture, Slip};

use super::Theta2;

/// Number of points of a curve b = 0 over the whole range of θ1.
const CURVE_POINTS: usize = 2000;

/// The posture at one θ1 with the tip on the belt.
pub(super) struct RegionColumn<'a> {
    arm: &'a Arm<f64>,
    /// Link angles, rad.
    pub(super) theta: LinkMotion<f64>,
    /// Ratio θ̇2/θ̇1 without normal velocity of the tip.
    pub(super) ratio: f64,
}

impl<'a> RegionColumn<'a> {
    pub(super) fn new(arm: &'a Arm<f64>, theta1: f64, theta2: Theta2) -> Option<Self> {
        let [length_1, length_2] = arm.link_length_m();
        let cosine = arm.height_m() / length_2 - length_1 / length_2 * libm::cos(theta1);
        // At θ2 = 0 the tip cannot move along the belt.
        (cosine.abs() < 1.0).then(|| {
            let theta = LinkMotion::new(theta1, theta2.sign() * libm::acos(cosine));
            Self {
                arm,
                theta,
                ratio: -libm::sin(theta.first()) / libm::sin(theta.second())
                    * (length_1 / length_2),
            }
        })
    }

    /// Returns b at a rate θ̇1.
    pub(super) fn b_m_s2(&self, rate: f64) -> f64 {
        let rates = LinkMotion::new(rate, self.ratio * rate);
        let pose = Pose::new(&self.theta);
        self.arm
            .contact_terms(&self.theta, &rates, &pose, &GeneralisedTorque::zeros())
            .b_m_s2()
    }

    pub(super) fn p_per_kg(&self, mu: f64, slip: Slip) -> f64 {
        self.arm.p_per_kg(&Pose::new(&self.theta), mu, slip)
    }

    /// Returns the two rates θ̇1 at which b = 0, in ascending order.
    fn rates_of_zero_b(&self) -> Option<[f64; 2]> {
        let (minus, zero, plus) = (self.b_m_s2(-1.0), self.b_m_s2(0.0), self.b_m_s2(1.0));
        let (square, linear) = (0.5 * (plus + minus) - zero, 0.5 * (plus - minus));
        let discriminant = linear * linear - 4.0 * square * zero;
        if discriminant < 0.0 || square == 0.0 {
            return None;
        }
        // In the form without cancellation.
        let far = -0.5 * (linear + linear.signum() * discriminant.sqrt());
        let roots = [far / square, if far == 0.0 { 0.0 } else { zero / far }];
        Some([roots[0].min(roots[1]), roots[0].max(roots[1])])
    }
}

/// Returns the angles θ1 at which p = 0, degrees.
pub(super) fn zeros_of_p(arm: &Arm<f64>, mu: f64, theta2: Theta2, slip: Slip) -> Vec<f64> {
    let mut zeros = Vec::new();
    for posture in [Posture::ElbowUp, Posture::ElbowDown] {
        let line = BeltLine::new(arm, posture);
        let stretches = positive_stretches(|tau| line.p_per_kg(tau, mu, slip));
        // The ends of the whole line are not zeros.
        let inside = |tau: &f64| tau.abs() < core::f64::consts::FRAC_PI_2;
        let ends = stretches.into_iter().flat_map(|(from, to)| [from, to]);
        let thetas = ends.filter(inside).map(|tau| line.theta_rad(tau));
        zeros.extend(
            thetas
                .filter(|theta| theta.second() * theta2.sign() > 0.0)
                .map(|theta| theta.first().to_degrees()),
        );
    }
    zeros.sort_unstable_by(f64::total_cmp);
    zeros
}

/// Returns the curves along which b = 0: over each interval of θ1 that has such rates, the larger
/// rates forwards and the smaller rates backwards, closed where they meet.
pub(super) fn zeros_of_b(arm: &Arm<f64>, reach: f64, theta2: Theta2) -> Vec<Vec<[f64; 2]>> {
    let roots =
        |theta1: f64| RegionColumn::new(arm, theta1, theta2).and_then(|c| c.rates_of_zero_b());
    let points: Vec<(f64, Option<[f64; 2]>)> = (1..CURVE_POINTS)
        .map(|index| {
            // Denser towards both ends, where θ̇2 grows without bound.
            let part = core::f64::consts::PI * (index as f64 / CURVE_POINTS as f64 - 0.5);
            let theta1 = reach * libm::sin(part);
            (theta1, roots(theta1))
        })
        .collect();
    let meeting = |known: f64, unknown: f64| {
        let theta1 = bisected(known, unknown, |theta1| roots(theta1).is_some());
        roots(theta1).map(|rates| (theta1, rates))
    };
    let mut curves = Vec::new();
    let mut start = 0;
    for stretch in points.chunk_by(|one, next| one.1.is_some() == next.1.is_some()) {
        let end = start + stretch.len();
        let mut known: Vec<(f64, [f64; 2])> = stretch
            .iter()
            .filter_map(|(theta1, rates)| Some((*theta1, (*rates)?)))
            .collect();
        if let (Some(first), Some(last)) = (known.first().copied(), known.last().copied()) {
            // The two rates meet where this interval borders on one without such rates.
            if let Some(before) = start.checked_sub(1).and_then(|index| points.get(index)) {
                known.splice(0..0, meeting(first.0, before.0));
            }
            if let Some(after) = points.get(end) {
                known.extend(meeting(last.0, after.0));
            }
            for place in [1, 0] {
                let curve = known
                    .iter()
                    .map(|(theta1, rates)| [theta1.to_degrees(), rates[place]]);
                curves.push(curve.collect());
            }
        }
        start = end;
    }
    curves
}
