//! What the force cells show in slides: the friction of the tip on the belt, and the ripple of the normal force.

use painleve_shared::{Arm, LinkMotion, Pose};

use crate::geometry::joint_rad;
use crate::parameters::Parameters;
use crate::{Limits, Reading, Slide};

/// Time constant of the mean force from which the ripple is taken, s.
pub const MEAN_S: f64 = 0.1;

/// Returns the friction coefficient of slides at `tick_hz`: the sum of |f_t| over that of f_n, while the belt does not carry
/// the tip. Not a number if it always does.
pub fn friction(
    slides: &[Slide],
    geometry: &Parameters,
    arm: &Arm<f64>,
    tick_hz: f64,
    limits: &Limits,
) -> f64 {
    let tip_t_m = |reading: &Reading| arm.tip_m(&pose(geometry, reading)).x;
    let ticks = (MEAN_S * tick_hz).max(1.0) as u32;
    let mut sums_n = [0.0; 2];
    for slide in slides {
        let touching: Vec<&Reading> = slide.on_belt(limits).collect();
        let Some(first) = touching.first() else {
            continue;
        };
        let time = |reading: &Reading| reading.tick.wrapping_sub(first.tick) / ticks;
        for of_time in touching.chunk_by(|one, other| time(one) == time(other)) {
            let [from, .., to] = of_time else {
                continue;
            };
            let time_s = f64::from(to.tick.wrapping_sub(from.tick)) / tick_hz;
            let speed_m_s = (tip_t_m(to) - tip_t_m(from)) / time_s;
            let along_n: f64 = of_time.iter().map(|it| it.force_n[0]).sum();
            // Friction pushes the tip as the belt runs.
            if speed_m_s * along_n.signum() > limits.carried_m_s {
                continue;
            }
            for reading in of_time {
                for (sum_n, force_n) in sums_n.iter_mut().zip(reading.force_n) {
                    *sum_n += force_n.abs();
                }
            }
        }
    }
    let [tangential_n, normal_n] = sums_n;
    tangential_n / normal_n
}

/// Returns the acceleration of the tip off the belt by what the controller does not know, root mean square, m/s²: the ripple
/// of the normal force times p. Zero without a reading on the belt.
pub fn ripple_m_s2(
    slides: &[Slide],
    geometry: &Parameters,
    arm: &Arm<f64>,
    tick_hz: f64,
    limits: &Limits,
) -> f64 {
    let mean_ticks = MEAN_S * tick_hz;
    let (mut sum, mut count) = (0.0, 0_u32);
    for slide in slides {
        let touching = || slide.on_belt(limits);
        let Some(first) = touching().next() else {
            continue;
        };
        let since = |tick: u32, reading: &Reading| f64::from(reading.tick.wrapping_sub(tick));
        let (mut mean_n, mut beginning) = (0.0, 0.0);
        for reading in touching().take_while(|it| since(first.tick, it) < mean_ticks) {
            mean_n += reading.force_n[1];
            beginning += 1.0;
        }
        mean_n /= f64::max(beginning, 1.0);
        let mut before = first.tick;
        for reading in touching() {
            let [tangential_n, normal_n] = reading.force_n;
            let share = (since(before, reading) / mean_ticks).min(1.0);
            before = reading.tick;
            mean_n += share * (normal_n - mean_n);
            let q = arm.inverse_tip_inertia_per_kg(&pose(geometry, reading));
            let p = q.m22 + q.m12 * tangential_n / normal_n;
            let off_m_s2 = p * (normal_n - mean_n);
            sum += off_m_s2 * off_m_s2;
            count += 1;
        }
    }
    libm::sqrt(sum / f64::from(count.max(1)))
}

/// Returns the pose of a reading.
fn pose(geometry: &Parameters, reading: &Reading) -> Pose<f64> {
    let [first, elbow] =
        [0, 1].map(|joint| joint_rad(geometry, joint, reading.encoders_rad[joint]));
    Pose::new(&LinkMotion::new(first, first + elbow))
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::{ArmParameters, Posture};

    fn known() -> (Parameters, Arm<f64>) {
        let known = ArmParameters::default();
        let geometry = Parameters::of_arm(known.link_length_m, known.height_m);
        (geometry, Arm::new(known).unwrap())
    }

    #[test]
    fn a_force_that_stays_the_same_has_no_ripple_whatever_it_is() {
        let (geometry, arm) = known();
        let ripple_m_s2 = |ripple_n: f64, ticks: usize| {
            let readings = (0..3000_u32).step_by(ticks).map(|tick| Reading {
                tick,
                encoders_rad: [-0.5, 1.0],
                force_n: [0.0, 12.0 + ripple_n * libm::sin(0.2 * f64::from(tick))],
                torque_nm: [0.0; 2],
            });
            let slide = Slide {
                posture: Posture::ElbowUp,
                readings: readings.collect(),
                missing: 0,
                whole: 3000,
            };
            super::ripple_m_s2(&[slide], &geometry, &arm, 1000.0, &Limits::default())
        };
        assert!(ripple_m_s2(0.0, 1) < 1e-9);
        let rippling = ripple_m_s2(1.0, 1);
        assert!(rippling > 1.0, "{rippling}");
        // Whether every tick arrives does not matter.
        let sparse = ripple_m_s2(1.0, 4);
        assert!(
            (sparse / rippling - 1.0).abs() < 0.05,
            "{sparse} {rippling}"
        );
    }

    #[test]
    fn a_tip_that_its_belt_carries_shows_no_friction() {
        let (geometry, arm) = known();
        let reading = |tick: u32, tip_t_m: f64, along_n: f64| {
            let theta = arm.link_angles_on_belt_rad(tip_t_m, Posture::ElbowUp);
            Reading {
                tick,
                encoders_rad: theta.unwrap().to_joints().to_array(),
                force_n: [along_n, 4.0],
                torque_nm: [0.0; 2],
            }
        };
        let limits = Limits {
            carried_m_s: 0.1,
            ..Limits::default()
        };
        let friction = |belt: f64, is_slid: bool| {
            let slid = (0..1000).map(|tick| {
                let tip_t_m = -0.06 * belt * f64::from(tick) * 1e-3;
                reading(tick, tip_t_m, 2.4 * belt)
            });
            let carried = (1000..2000).map(|tick| {
                let tip_t_m = 0.15 * belt * f64::from(tick - 1000) * 1e-3;
                reading(tick, tip_t_m, 0.8 * belt)
            });
            let slide = Slide {
                posture: Posture::ElbowUp,
                readings: slid.filter(|_| is_slid).chain(carried).collect(),
                missing: 0,
                whole: 2000,
            };
            super::friction(&[slide], &geometry, &arm, 1000.0, &limits)
        };
        for belt in [1.0, -1.0] {
            let friction_of_slid = friction(belt, true);
            assert!((friction_of_slid - 0.6).abs() < 1e-9, "{friction_of_slid}");
            assert!(friction(belt, false).is_nan());
        }
    }
}
