//! Step 2: the tip rests on the belt, stages off. Its height gives the belt's; the weight of the arm, by the
//! model, gives the force that the cell should read.
//!
//! At rest, 0 = −w + Jᵀ f + u (paper, eq. 1 without motion), whether the tip sticks or is about to slide.

use nalgebra::Vector2;
use painleve_plant::decimal::as_written;
use painleve_shared::counts::ForceCounts;
use painleve_shared::kinematics::Pose;
use painleve_shared::{Arm, JointTorque, LinkMotion};

use crate::encoders::EncodersFound;
use crate::readings::Session;
use crate::{CommissionError, Deviation, Expected, Mistake, OperatorTask, Rig};

/// Largest error of the belt's height that counts as the scenario's own, m: 0.5° of each encoder's zero.
const HEIGHT_TOLERANCE_M: f64 = 0.005;

/// The same of an arm that has been identified, m: five times the 0.2 mm by which the seam of a belt raises its tip. The elbow's
/// encoder of 12 bits rounds to less.
const IDENTIFIED_TOLERANCE_M: f64 = 0.001;

/// Farthest tip from the point below joint 1, as a part of the arm's height.
const FARTHEST: f64 = 0.25;

/// Largest error of the belt's height, as a part of the height.
const LARGEST_HEIGHT_ERROR: f64 = 0.15;

/// Smallest measurable weight, N and as a part of the force cell's range.
const LEAST_N: f64 = 0.2;
const LEAST_SHARE: f64 = 0.01;

/// Allowed ratio of the reading to the expected force: the model's masses and springs are inexact.
const RATIO: core::ops::Range<f64> = 0.5..2.0;

/// Reading below which the cell has not noticed the weight, as a part of the expected force.
const DEAD: f64 = 0.2;

/// Reading that counts as the force cell's limit, as a part of the last that a working cell gives: its noise, and the rise of
/// a torque in some ticks, beyond which there would be no reading.
const LIMIT: f64 = 0.99;

/// Code of a force cell's live zero, which is half of its converter's codes: see the codes in `converters.mounting`.
const LIVE_ZERO: u16 = 2048;

/// The arm at rest.
#[derive(Clone, Debug)]
pub struct RestFound {
    /// Link angles, rad.
    pub theta_rad: LinkMotion<f64>,
    /// Distance of the first joint from the belt, m.
    pub height_m: f64,
    /// Normal force by the force cell, N; positive.
    pub normal_force_n: f64,
    /// Whether the cell reads f_n with the opposite sign.
    pub normal_reversed: bool,
    /// Readings without a load.
    pub tare: [ForceCounts; 2],
    /// Deviations from the scenario.
    pub deviations: Vec<Deviation>,
}

/// Returns the force on the tip (f_t, f_n), N, at rest under joint torques; `None` for a straight arm.
pub(crate) fn force_at_rest_n(
    arm: &Arm<f64>,
    theta: &LinkMotion<f64>,
    torque_nm: JointTorque<f64>,
) -> Option<Vector2<f64>> {
    let pose = Pose::new(theta);
    let load_nm = arm.passive_torque_nm(theta, &LinkMotion::zeros(), &pose);
    let inverse = arm.jacobian(&pose).transpose().try_inverse()?;
    Some(inverse * (load_nm - torque_nm.to_links()).vector())
}

/// Checks that the force cell can measure the arm's weight as the scenario tells it, before anybody holds the arm.
///
/// # Errors
/// [`Mistake::TooLight`] or [`Mistake::TooHeavy`].
pub(crate) fn check(expected: &Expected) -> Result<(), Mistake> {
    let theta_rad = expected.arm.link_angles_on_belt_rad(0.0, expected.posture);
    weight_n(expected, theta_rad).map(|_| ())
}

/// Returns the force (N) with which the arm's weight should press on the belt at these angles (rad), if the force cell can
/// measure it.
fn weight_n(expected: &Expected, theta_rad: Option<LinkMotion<f64>>) -> Result<f64, Mistake> {
    let range_n = as_written(expected.converters.force.range);
    let force_n =
        theta_rad.and_then(|it| force_at_rest_n(&expected.arm, &it, JointTorque::zeros()));
    let expected_n = force_n.map_or(0.0, |it| it.y);
    if expected_n < LEAST_N.max(LEAST_SHARE * range_n) {
        return Err(Mistake::TooLight { expected_n });
    }
    let most_n = limit_share(expected) * range_n;
    if expected_n > most_n {
        return Err(Mistake::TooHeavy {
            expected_n,
            range_n,
            most_n,
        });
    }
    Ok(expected_n)
}

/// Returns the reading that counts as the force cell's limit, as a part of its range: a board takes codes beyond those of a
/// working cell for none.
fn limit_share(expected: &Expected) -> f64 {
    let mounting = &expected.converters.mounting;
    let above = mounting.force_highest_code.saturating_sub(LIVE_ZERO);
    let below = LIVE_ZERO.saturating_sub(mounting.force_lowest_code);
    LIMIT * f64::from(above.min(below)) / f64::from(LIVE_ZERO)
}

/// Returns whether the force cell reads its limit on either axis, so that the force may be larger.
pub(crate) fn is_at_limit(expected: &Expected, force_counts: [f64; 2]) -> bool {
    let most = f64::from(expected.converters.force.maximum_counts());
    let limit_counts = limit_share(expected) * most;
    force_counts.iter().any(|it| it.abs() > limit_counts)
}

/// Measures height and weight.
pub(crate) fn measure<R: Rig>(
    session: &mut Session<'_, R>,
    encoders: &EncodersFound,
) -> Result<RestFound, CommissionError<R::Error>> {
    let posture = session.expected.posture;
    session.instruct(OperatorTask::SetDown { posture })?;
    let readings = session.mean(JointTorque::zeros())?;
    let expected = session.expected;
    let theta_rad = session
        .theta_rad(readings.joints)
        .ok_or(Mistake::EncoderSilent { joint: 0 })?;
    let tip_m = expected.arm.tip_m(&Pose::new(&theta_rad));
    let height_m = -tip_m.y;
    let error_m = height_m - expected.arm.height_m();
    if tip_m.x.abs() > FARTHEST * height_m
        || error_m.abs() > LARGEST_HEIGHT_ERROR * expected.arm.height_m()
    {
        return Err(Mistake::NotSetDown {
            tip_mm: 1e3 * tip_m.x,
            gap_mm: -1e3 * error_m,
        }
        .into());
    }
    let mut deviations = Vec::new();
    let tolerance_m = if expected.is_identified && encoders.are_as_described() {
        IDENTIFIED_TOLERANCE_M
    } else {
        HEIGHT_TOLERANCE_M
    };
    let is_other_height = error_m.abs() > tolerance_m;
    if is_other_height {
        deviations.push(Deviation::BeltHeight { error_m });
    }
    let net_n = session.net_force_n(readings.forces, encoders.tare);
    let expected_n = weight_n(expected, Some(theta_rad))?;
    if is_at_limit(expected, readings.forces) {
        return Err(Mistake::ForceLimit { expected_n }.into());
    }
    let ratio = net_n.y.abs() / expected_n;
    if ratio < DEAD {
        let is_on_other_axis = RATIO.contains(&(net_n.x.abs() / expected_n));
        return Err(if is_on_other_axis {
            Mistake::ForceAxesSwapped
        } else {
            Mistake::ForceDead { expected_n }
        }
        .into());
    }
    if !RATIO.contains(&ratio) {
        return Err(Mistake::ForceScale { ratio }.into());
    }
    let normal_reversed = net_n.y < 0.0;
    if normal_reversed != expected.converters.mounting.force_reversed[1] {
        deviations.push(Deviation::ForceDirection { axis: 1 });
    }
    Ok(RestFound {
        theta_rad,
        height_m: if is_other_height {
            height_m
        } else {
            expected.arm.height_m()
        },
        normal_force_n: net_n.y.abs(),
        normal_reversed,
        tare: encoders.tare,
        deviations,
    })
}
