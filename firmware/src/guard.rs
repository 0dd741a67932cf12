//! Contact guard: finds the torque closest to the wanted one that keeps the tip pressed on the
//! belt.
//!
//! While sliding, f_n = −b/p, and b = b₀ + n·u is affine in the joint torques u. The condition f_n
//! ≥ f_min is therefore a half-plane, n·u ≤ −p f_min − b₀. The torque limits form a box around it,
//! and the nearest point has a closed form.

use nalgebra::Vector2;
use painleve_shared::{JointTorque, Real, settings};

settings! {
    /// Settings of the contact guard.
    #[derive(Copy)]
    pub struct GuardSettings {
        /// Whether the contact guard is active.
        enabled: bool = true;
        /// Least predicted normal force f_min.
        minimum_force_n: f32 = 1.0, 0.0..=1e3, "N";
    }
}

/// The half-plane n·u ≤ c of the joint torques that keep the tip on the belt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPlane {
    /// n, 1/(kg·m).
    pub normal: Vector2<f32>,
    /// c, m/s².
    pub bound: f32,
}

/// Returns the torque (N·m) within ±`limit_nm` nearest to `wanted_nm` in the half-plane, and
/// whether the half-plane changed it. If box and half-plane do not meet, returns the corner of the
/// box that comes closest to satisfying it.
#[inline]
pub fn nearest_torque_nm(
    wanted_nm: &JointTorque<f32>,
    plane: &HalfPlane,
    limit_nm: f32,
) -> (JointTorque<f32>, bool) {
    let limited = wanted_nm.map(|torque| torque.within(limit_nm));
    let normal = &plane.normal;
    let square = normal.norm_squared();
    if normal.dot(limited.vector()) <= plane.bound || square <= 0.0 {
        return (limited, false);
    }
    // Project the wanted torque onto the line.
    let step = (plane.bound - normal.dot(wanted_nm.vector())) / square;
    let foot = wanted_nm.vector() + normal * step;
    // If the projection is outside the box, the nearest point of the line inside the box has one
    // torque at its limit and the other from the line.
    let first = foot.x.within(limit_nm);
    let second = along(plane.bound - normal.x * first, normal.y, foot.y);
    if second.abs() <= limit_nm {
        return (JointTorque::new(first, second), true);
    }
    let second = second.within(limit_nm);
    let first = along(plane.bound - normal.y * second, normal.x, first);
    if first.abs() <= limit_nm {
        (JointTorque::new(first, second), true)
    } else {
        let corner = normal.map(|component| -limit_nm.copysign(component));
        (JointTorque::from_vector(corner), true)
    }
}

/// Returns `rest / slope`, or `otherwise` where the slope is too small.
fn along(rest: f32, slope: f32, otherwise: f32) -> f32 {
    let value = rest / slope;
    if value.is_finite() { value } else { otherwise }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMIT_NM: f32 = 5.0;

    fn inside(torque: &JointTorque<f32>, plane: &HalfPlane) -> bool {
        let slack = 1e-3 * (1.0 + plane.bound.abs() + plane.normal.norm() * LIMIT_NM);
        plane.normal.dot(torque.vector()) <= plane.bound + slack
    }

    #[test]
    fn a_torque_that_keeps_the_tip_pressed_is_left_alone() {
        let plane = HalfPlane {
            normal: Vector2::new(3.0, -1.0),
            bound: 1.0,
        };
        let wanted = JointTorque::new(0.1, 0.2);
        assert_eq!(
            nearest_torque_nm(&wanted, &plane, LIMIT_NM),
            (wanted, false)
        );
    }

    proptest! {
        /// Compares the result with a search over the whole box.
        #[test]
        fn no_torque_within_limits_is_nearer(
            w1 in -8.0_f32..8.0, w2 in -8.0_f32..8.0, n1 in -50.0_f32..50.0, n2 in -50.0_f32..50.0,
            bound in -200.0_f32..200.0,
        ) {
            let wanted = JointTorque::new(w1, w2);
            let plane = HalfPlane { normal: Vector2::new(n1, n2), bound };
            let (found, _) = nearest_torque_nm(&wanted, &plane, LIMIT_NM);
            prop_assert!(found.amax() <= LIMIT_NM);
            let grid = (0..=80).flat_map(|i| (0..=80).map(move |j| {
                Vector2::new(i as f32, j as f32) * (2.0 * LIMIT_NM / 80.0) - Vector2::repeat(LIMIT_NM)
            }));
            let admissible = grid.clone().filter(|torque| n1 * torque.x + n2 * torque.y <= bound);
            let mut any = false;
            for other in admissible {
                any = true;
                let apart = (found - wanted).vector().norm();
                prop_assert!(apart <= (other - wanted.vector()).norm() + 1e-3);
            }
            if any {
                prop_assert!(inside(&found, &plane), "{:?} {:?}", found, plane);
            }
        }
    }
}
