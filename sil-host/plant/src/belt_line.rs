//! Postures with the tip on the belt, as an analytic curve.
//!
//! As functions of z_t, the link angles have square-root singularities where the arm is straight. With
//! z_t = R sin τ, where R is the reach, they have none: the area of the triangle of both links is
//! ¼ R cos τ √(d² − (l1 − l2)²), d = |z|, and p is an analytic function of τ from −π/2 to π/2.

use core::ops::Range;

use nalgebra::Matrix2;
use painleve_shared::{Arm, LinkMotion, Pose, Posture, Slip};

/// Usable fraction of the reach: at the full reach the arm is straight.
const USED_REACH: f64 = 0.97;

/// Number of points of the first search. A quantity has few extrema, so that each lies
/// between its own points.
const POINTS: usize = 4096;

/// Number of points between a tip and an edge at which a dip of p/Q22 is looked for.
const POINTS_TO_EDGE: usize = 128;

/// The tip on the belt of an arm in one posture.
#[derive(Clone, Copy, Debug)]
pub struct BeltLine<'a> {
    arm: &'a Arm<f64>,
    posture: Posture,
}

impl<'a> BeltLine<'a> {
    /// Creates the belt line of an arm in a posture.
    pub fn new(arm: &'a Arm<f64>, posture: Posture) -> Self {
        Self { arm, posture }
    }

    /// Returns z_t at τ, m.
    pub fn tip_t_m(&self, tau: f64) -> f64 {
        self.arm.reach_on_belt_m() * libm::sin(tau)
    }

    /// Returns τ at z_t (m); `None` out of reach.
    pub fn tau(&self, tip_t_m: f64) -> Option<f64> {
        let sine = tip_t_m / self.arm.reach_on_belt_m();
        (sine.abs() <= 1.0).then(|| libm::asin(sine))
    }

    /// Returns the link angles at τ, rad.
    pub fn theta_rad(&self, tau: f64) -> LinkMotion<f64> {
        let (height, hole) = (self.arm.height_m(), self.arm.hole_m());
        let [length_1, length_2] = self.arm.link_length_m();
        let tip = self.tip_t_m(tau);
        let direction = libm::atan2(tip, height);
        let distance = libm::hypot(tip, height);
        // 2 l sin β and 2 l cos β, with β the angle between either link and the tip's direction.
        let sine = self.arm.reach_on_belt_m()
            * libm::cos(tau)
            * (libm::sqrt(distance * distance - hole * hole) / distance);
        let shift = (length_1 - length_2) * (length_1 + length_2) / distance;
        let angle_1 = libm::atan2(sine, distance + shift);
        let angle_2 = libm::atan2(sine, distance - shift);
        match self.posture {
            Posture::ElbowUp => LinkMotion::new(direction - angle_1, direction + angle_2),
            Posture::ElbowDown => LinkMotion::new(direction + angle_1, direction - angle_2),
        }
    }

    /// Returns Q at τ, 1/kg.
    pub fn inverse_tip_inertia_per_kg(&self, tau: f64) -> Matrix2<f64> {
        self.arm
            .inverse_tip_inertia_per_kg(&Pose::new(&self.theta_rad(tau)))
    }

    /// Returns p at τ, 1/kg.
    pub fn p_per_kg(&self, tau: f64, friction: f64, slip: Slip) -> f64 {
        self.arm
            .p_per_kg(&Pose::new(&self.theta_rad(tau)), friction, slip)
    }

    /// Returns p/Q22 at τ.
    pub fn p_ratio(&self, tau: f64, friction: f64, slip: Slip) -> f64 {
        p_ratio(self.arm, &self.theta_rad(tau), friction, slip)
    }

    /// Returns the friction coefficient at which p is zero at τ; infinite if there is none.
    pub fn friction_of_zero_p(&self, tau: f64, slip: Slip) -> f64 {
        let q = self.inverse_tip_inertia_per_kg(tau);
        let pull = slip.sign::<f64>() * q.m21;
        if pull > 0.0 {
            q.m22 / pull
        } else {
            f64::INFINITY
        }
    }

    /// Returns how far a tip is before the edge p = 0 that is next along the belt in the direction of this sign, m; negative
    /// if the tip is beyond it. `None` if p is positive from the tip as far as the arm reaches, or if p/Q22 falls and rises
    /// again before the edge: a tip that is held there is held by its least value.
    pub fn before_edge_m(
        &self,
        tip_t_m: f64,
        direction: f64,
        friction: f64,
        slip: Slip,
    ) -> Option<f64> {
        let sign = direction.signum();
        let mut stretches = positive_stretches(|tau| self.p_per_kg(tau, friction, slip));
        if sign < 0.0 {
            stretches = stretches
                .into_iter()
                .rev()
                .map(|(from, to)| (-to, -from))
                .collect();
        }
        let tip = sign * tip_t_m;
        // A tip where p is not positive has left the stretch behind it.
        let (_, end) = stretches
            .into_iter()
            .take_while(|&(start, _)| self.tip_t_m(start) <= tip)
            .last()?;
        if end >= core::f64::consts::FRAC_PI_2 {
            return None;
        }
        let before_m = self.tip_t_m(end) - tip;
        if before_m > 0.0 {
            let start = self.tau(tip)?;
            let p_ratio = |number: usize| {
                let tau = start + (end - start) * (number as f64 / POINTS_TO_EDGE as f64);
                self.p_ratio(sign * tau, friction, slip)
            };
            let (mut last, mut falls) = (p_ratio(0), false);
            for next in (1..=POINTS_TO_EDGE).map(p_ratio) {
                if falls && next > last {
                    return None;
                }
                falls |= next < last;
                last = next;
            }
        }
        Some(before_m)
    }
}

/// Returns p/Q22 of an arm at these link angles (rad), with the tip anywhere.
pub fn p_ratio(arm: &Arm<f64>, theta_rad: &LinkMotion<f64>, friction: f64, slip: Slip) -> f64 {
    let pose = Pose::new(theta_rad);
    arm.p_per_kg(&pose, friction, slip) / arm.inverse_tip_inertia_per_kg(&pose).m22
}

/// Returns the intervals of τ on which `value` is positive, in order, to rounding.
pub fn positive_stretches(value: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let mut points = samples(&value);
    // Between two points of equal sign the value may still cross zero twice.
    let mut extrema: Vec<(f64, f64)> = points
        .windows(3)
        .filter_map(|three| {
            let [left, middle, right] = three else {
                return None;
            };
            let sign = middle.1.signum();
            let towards_zero =
                sign * middle.1 <= sign * left.1 && sign * middle.1 <= sign * right.1;
            towards_zero.then(|| {
                let tau = minimum(left.0, right.0, |tau| sign * value(tau));
                (tau, value(tau))
            })
        })
        .collect();
    points.append(&mut extrema);
    points.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));

    let mut stretches = Vec::new();
    let mut start = points
        .first()
        .filter(|point| point.1 > 0.0)
        .map(|point| point.0);
    for pair in points.windows(2) {
        let [before, after] = pair else { continue };
        if (before.1 > 0.0) == (after.1 > 0.0) {
            continue;
        }
        let root = bisected(before.0, after.0, |tau| {
            (value(tau) > 0.0) == (before.1 > 0.0)
        });
        match start.take() {
            Some(start) => stretches.push((start, root)),
            None => start = Some(root),
        }
    }
    if let (Some(start), Some(end)) = (start, points.last()) {
        stretches.push((start, end.0));
    }
    stretches
}

/// The smallest value of a function of τ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Least {
    /// Where it is.
    pub tau: f64,
    /// The value.
    pub value: f64,
}

/// Returns where `value` is smallest, and the value there.
pub fn least(value: impl Fn(f64) -> f64) -> Least {
    let points = samples(&value);
    let lowest = (0..points.len())
        .min_by(|&one, &other| points[one].1.total_cmp(&points[other].1))
        .unwrap_or(0);
    let left = points[lowest.saturating_sub(1)].0;
    let right = points[(lowest + 1).min(points.len() - 1)].0;
    let tau = minimum(left, right, &value);
    let refined = value(tau);
    let (tau, value) = if refined < points[lowest].1 {
        (tau, refined)
    } else {
        points[lowest]
    };
    Least { tau, value }
}

fn samples(value: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..=POINTS)
        .map(|index| {
            let tau = core::f64::consts::PI * (index as f64 / POINTS as f64 - 0.5);
            (tau, value(tau))
        })
        .collect()
}

/// Bisects, to rounding, for the end of a property that holds at `holds` and not at `fails`.
pub fn bisected(mut holds: f64, mut fails: f64, property: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (holds + fails);
        if middle == holds || middle == fails {
            return holds;
        }
        if property(middle) {
            holds = middle;
        } else {
            fails = middle;
        }
    }
}

/// Golden-section search for the single minimum of a function between two points.
fn minimum(left: f64, right: f64, value: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut left, mut right) = (left, right);
    let (mut one, mut two) = (
        right - ratio * (right - left),
        left + ratio * (right - left),
    );
    let (mut at_one, mut at_two) = (value(one), value(two));
    // Near a minimum, values differ by less than rounding within the square root of rounding.
    while right - left > 1e-9 {
        if at_one <= at_two {
            (right, two, at_two) = (two, one, at_one);
            one = right - ratio * (right - left);
            at_one = value(one);
        } else {
            (left, one, at_one) = (one, two, at_two);
            two = left + ratio * (right - left);
            at_two = value(two);
        }
    }
    0.5 * (left + right)
}

/// Returns the intervals of z_t (m) in which p is at least a fraction of Q22 in a posture and slip,
/// within the usable reach; the longest comes first.
pub fn admissible_m(
    arm: &Arm<f64>,
    posture: Posture,
    friction: f64,
    slip: Slip,
    least_p_ratio: f64,
) -> Vec<Range<f64>> {
    let line = BeltLine::new(arm, posture);
    let reach_m = USED_REACH * arm.reach_on_belt_m();
    let p =
        |tau| line.p_per_kg(tau, friction, slip) - least_p_ratio * line.p_per_kg(tau, 0.0, slip);
    let mut stretches: Vec<_> = positive_stretches(p)
        .into_iter()
        .map(|(from, to)| line.tip_t_m(from).max(-reach_m)..line.tip_t_m(to).min(reach_m))
        .filter(|stretch| stretch.start < stretch.end)
        .collect();
    stretches.sort_by(|one, other| (other.end - other.start).total_cmp(&(one.end - one.start)));
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::ArmParameters;

    #[test]
    fn the_curve_agrees_with_the_inverse_kinematics() {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        for posture in [Posture::ElbowUp, Posture::ElbowDown] {
            let line = BeltLine::new(&arm, posture);
            for tip in [-0.184, -0.1, 0.0, 0.05, 0.17, 0.1841] {
                let theta = line.theta_rad(line.tau(tip).unwrap());
                let expected = arm.link_angles_on_belt_rad(tip, posture).unwrap();
                assert!((theta - expected).amax() < 1e-9, "{theta:?} {expected:?}");
                assert!((arm.tip_m(&Pose::new(&theta)).x - tip).abs() < 1e-15);
            }
            assert_eq!(line.tau(0.185), None);
        }
    }

    #[test]
    fn roots_closer_than_the_grid_are_found_to_rounding() {
        let stretches = positive_stretches(|t| (t - 0.3) * (t - 0.3) - 1e-10);
        let expected = [
            (-core::f64::consts::FRAC_PI_2, 0.3 - 1e-5),
            (0.3 + 1e-5, core::f64::consts::FRAC_PI_2),
        ];
        assert_eq!(stretches.len(), 2);
        for (stretch, expected) in stretches.iter().zip(expected) {
            assert!((stretch.0 - expected.0).abs() < 1e-12, "{stretch:?}");
            assert!((stretch.1 - expected.1).abs() < 1e-12, "{stretch:?}");
        }
        let [(start, _)] = positive_stretches(|t| t - 0.25)[..] else {
            panic!("one stretch");
        };
        assert!((start - 0.25).abs() < 1e-16);
        assert!(positive_stretches(|_| -1.0).is_empty());
        assert_eq!(positive_stretches(|_| 1.0).len(), 1);
    }

    #[test]
    fn the_minimum_is_found_inside_and_at_the_ends() {
        let Least { tau, value } = least(|t| 2.0 + (t - 0.1234).powi(2));
        assert!((tau - 0.1234).abs() < 1e-7 && value == 2.0, "{tau} {value}");
        assert_eq!(least(|t| t).tau, -core::f64::consts::FRAC_PI_2);
    }

    #[test]
    fn the_edge_is_the_one_ahead_of_the_tip_up_to_the_full_reach() {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        let before_m = |posture, tip_m: f64, direction| {
            let line = BeltLine::new(&arm, posture);
            line.before_edge_m(tip_m, direction, 0.6, Slip::Positive)
        };
        // The stretches for μ = 0.6 end at 0.16470 m and 0.18269 m; on the other side, both end with the reach.
        for (posture, tip_m, edge_m) in [
            (Posture::ElbowDown, 0.163, 0.16470),
            (Posture::ElbowDown, 0.17, 0.16470),
            (Posture::ElbowUp, 0.18, 0.18269),
        ] {
            let found_m = before_m(posture, tip_m, 1.0).unwrap();
            assert!((found_m - (edge_m - tip_m)).abs() < 1e-5, "{found_m}");
            assert_eq!(before_m(posture, 0.1, -1.0), None);
        }
        // For μ = 0.95 elbow up, p/Q22 is least, but positive, near −0.06 m; the edge ahead is at 0.165 m.
        let line = BeltLine::new(&arm, Posture::ElbowUp);
        let ahead_m = |tip_m| line.before_edge_m(tip_m, 1.0, 0.95, Slip::Positive);
        assert_eq!(ahead_m(-0.1), None);
        assert!((ahead_m(0.0).unwrap() - 0.165).abs() < 2e-3);
        let line = BeltLine::new(&arm, Posture::ElbowDown);
        let mirrored = line.before_edge_m(0.163, 1.0, 0.6, Slip::Negative);
        assert_eq!(mirrored, None);
        assert_eq!(line.before_edge_m(-0.1, 1.0, 0.05, Slip::Positive), None);
    }
}
