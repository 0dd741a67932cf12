//! Step 3: a small torque of either sign on each joint of the resting arm. The change of the contact force
//! gives polarity and scale of the stages, and the sign of f_t.
//!
//! The tip stays where it is, so that f changes by −J⁻ᵀ B Δu, where B converts joint torques to those on the
//! links: the first joint's torque acts along link 2, the elbow's along the line from joint 1 to the tip.
//!
//! Of an arm whose weight nearly fills the range of the force cell, only the torque that relieves the tip is measured, against
//! the arm at rest: at its limit, the cell reads less than the force.

use nalgebra::{Matrix2, Vector2};
use painleve_plant::decimal::as_written;
use painleve_shared::kinematics::Pose;
use painleve_shared::{JointTorque, LinkMotion};

use crate::readings::Session;
use crate::rest::{RestFound, force_at_rest_n, is_at_limit};
use crate::{CommissionError, Deviation, Mistake, OperatorTask, Rig};

/// Change of the contact force, as a part of f_n at rest.
const CHANGE: f64 = 0.2;

/// Time in which a torque rises, s.
const RISE_S: f64 = 0.1;

/// Effect below which a stage is dead, as a part of the expected effect.
const DEAD: f64 = 0.15;

/// Allowed ratio of a stage's torque to its command: friction in the joint and the model's errors.
const RATIO: core::ops::Range<f64> = 0.65..1.5;

/// Largest part of an effect that the model does not explain.
const UNEXPLAINED: f64 = 0.25;

/// Least change of the force that is told from its noise, counts.
const LEAST_COUNTS: f64 = 10.0;

/// Largest motion of the tip during the test, m.
const STILL_M: f64 = 0.005;

/// Polarities as measured.
#[derive(Clone, Debug)]
pub struct StagesFound {
    /// Whether the stages turn their joints backwards.
    pub reversed: [bool; 2],
    /// Whether the force cell reads f_t and f_n with the opposite sign.
    pub force_reversed: [bool; 2],
    /// Deviations from the scenario.
    pub deviations: Vec<Deviation>,
}

/// Measures polarity and scale.
pub(crate) fn measure<R: Rig>(
    session: &mut Session<'_, R>,
    rest: &RestFound,
) -> Result<StagesFound, CommissionError<R::Error>> {
    session.instruct(OperatorTask::Enable)?;
    let model = effects(session, &rest.theta_rad)?;
    let mut measured = Matrix2::zeros();
    for joint in 0..2 {
        let largest = CHANGE * rest.normal_force_n / model.column(joint).norm();
        let torque_nm = largest.min(session.expected.torque_limit_nm);
        let change_n = torque_nm * model.column(joint).norm();
        if change_n < LEAST_COUNTS * f64::from(session.expected.converters.force.per_count()) {
            return Err(Mistake::TorqueTooSmall { joint, change_n }.into());
        }
        let changed_n = force_change_n(session, rest, joint, torque_nm)?;
        measured.set_column(joint, &(changed_n / torque_nm));
    }
    let explained = explain(&model, &measured)?;
    let mounting = &session.expected.converters.mounting;
    let mut deviations = Vec::new();
    for joint in 0..2 {
        let ratio = explained.ratio[joint].abs();
        if !RATIO.contains(&ratio) {
            let configured = session.expected.converters.stages.gear_ratio[joint];
            return Err(Mistake::StageScale {
                joint,
                ratio,
                gear_ratio: f64::from(configured) * ratio,
            }
            .into());
        }
        if (explained.ratio[joint] < 0.0) != mounting.stage_reversed[joint] {
            deviations.push(Deviation::StageDirection { joint });
        }
    }
    if explained.tangential_reversed != mounting.force_reversed[0] {
        deviations.push(Deviation::ForceDirection { axis: 0 });
    }
    Ok(StagesFound {
        reversed: explained.ratio.map(|ratio| ratio < 0.0),
        force_reversed: [explained.tangential_reversed, rest.normal_reversed],
        deviations,
    })
}

/// Returns the change of (f_t, f_n) per torque of each joint by the model, 1/m; a column per joint.
fn effects<R: Rig>(
    session: &Session<'_, R>,
    theta: &LinkMotion<f64>,
) -> Result<Matrix2<f64>, Mistake> {
    let force_n = |torque_nm| force_at_rest_n(&session.expected.arm, theta, torque_nm);
    match (
        force_n(JointTorque::zeros()),
        force_n(JointTorque::new(1.0, 0.0)),
        force_n(JointTorque::new(0.0, 1.0)),
    ) {
        (Some(rest), Some(first), Some(elbow)) => {
            Ok(Matrix2::from_columns(&[first - rest, elbow - rest]))
        }
        _ => Err(Mistake::TooLight { expected_n: 0.0 }),
    }
}

/// Returns the change of the force (f_t, f_n), N, by a torque on one joint: half of that between both signs, or that from rest
/// under the sign that leaves the force within the cell's range.
fn force_change_n<R: Rig>(
    session: &mut Session<'_, R>,
    rest: &RestFound,
    joint: usize,
    torque_nm: f64,
) -> Result<Vector2<f64>, CommissionError<R::Error>> {
    let mut under = |torque_nm: f64| {
        let mut torques = [0.0; 2];
        torques[joint] = torque_nm;
        force_under(session, rest, JointTorque::from_array(torques))
    };
    let (plus, minus) = (under(torque_nm)?, under(-torque_nm)?);
    if let (Some(plus), Some(minus)) = (plus, minus) {
        return Ok((plus - minus) / 2.0);
    }
    match (plus, under(0.0)?, minus) {
        (Some(plus), Some(resting), _) => Ok(plus - resting),
        (_, Some(resting), Some(minus)) => Ok(resting - minus),
        _ => Err(Mistake::StageAtForceLimit {
            joint,
            range_n: as_written(session.expected.converters.force.range),
        }
        .into()),
    }
}

/// Returns the force (f_t, f_n), N, under torques that rise gradually and fall again; f_t in the cell's direction,
/// f_n positive away from the belt. `None` if it takes the cell to its limit.
fn force_under<R: Rig>(
    session: &mut Session<'_, R>,
    rest: &RestFound,
    torque_nm: JointTorque<f64>,
) -> Result<Option<Vector2<f64>>, CommissionError<R::Error>> {
    let ticks = session.ticks(RISE_S);
    let part = |tick: u32| f64::from(tick) / f64::from(ticks);
    let (mut risen, mut is_beyond) = (0, false);
    while risen < ticks && !is_beyond {
        let forces = session.exchange(torque_nm * part(risen))?.forces;
        let scale = &session.expected.converters.force;
        let is_read = forces.iter().all(|it| scale.contains(it.0));
        is_beyond = is_read && is_at_limit(session.expected, forces.map(|it| it.0.into()));
        risen += 1;
    }
    let readings = if is_beyond {
        None
    } else {
        Some(session.mean(torque_nm)?)
    };
    for tick in (0..risen).rev() {
        session.exchange(torque_nm * part(tick))?;
    }
    let Some(readings) = readings else {
        return Ok(None);
    };
    let moved_m = session.theta_rad(readings.joints).map_or(0.0, |theta| {
        let arm = &session.expected.arm;
        let tip = |theta| arm.tip_m(&Pose::new(theta));
        (tip(&theta) - tip(&rest.theta_rad)).norm()
    });
    if moved_m > STILL_M {
        return Err(Mistake::Moved {
            moved_mm: 1e3 * moved_m,
        }
        .into());
    }
    if is_at_limit(session.expected, readings.forces) {
        return Ok(None);
    }
    let mut net_n = session.net_force_n(readings.forces, rest.tare);
    if rest.normal_reversed {
        net_n.y = -net_n.y;
    }
    Ok(Some(net_n))
}

/// How the measured effects follow from those of the model.
struct Explained {
    /// Torque of each stage divided by its command; negative for a reversed stage.
    ratio: [f64; 2],
    tangential_reversed: bool,
}

/// Finds the exchange of stages and the sign of f_t that explain the measured effects best.
fn explain(model: &Matrix2<f64>, measured: &Matrix2<f64>) -> Result<Explained, Mistake> {
    for joint in 0..2 {
        if measured.column(joint).norm() < DEAD * model.column(joint).norm() {
            return Err(Mistake::StageDead { joint });
        }
    }
    let fit = |swapped: bool, tangential_reversed: bool| {
        let mut ratio = [0.0; 2];
        let mut unexplained = [0.0; 2];
        for joint in 0..2 {
            let mut effect = measured.column(joint).into_owned();
            if tangential_reversed {
                effect.x = -effect.x;
            }
            let from = model.column(if swapped { 1 - joint } else { joint });
            ratio[joint] = effect.dot(&from) / from.norm_squared();
            unexplained[joint] = (effect - from * ratio[joint]).norm() / effect.norm();
        }
        (swapped, tangential_reversed, ratio, unexplained)
    };
    let fits = [
        fit(false, false),
        fit(false, true),
        fit(true, false),
        fit(true, true),
    ];
    let misfit = |unexplained: &[f64; 2]| unexplained.iter().map(|it| it * it).sum::<f64>();
    let mut best = fits[0];
    for candidate in fits {
        if misfit(&candidate.3) < misfit(&best.3) {
            best = candidate;
        }
    }
    let (swapped, tangential_reversed, ratio, unexplained) = best;
    if let Some(joint) = unexplained.iter().position(|it| *it > UNEXPLAINED) {
        return Err(Mistake::Unexplained { joint });
    }
    if swapped {
        return Err(Mistake::StagesSwapped);
    }
    Ok(Explained {
        ratio,
        tangential_reversed,
    })
}
