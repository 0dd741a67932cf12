//! Step 4: the tip is pushed along the standing belt, more and more, until it slides by a millimetre; once in
//! each direction. While it slides, |f_t|/f_n is the friction coefficient.

use std::collections::VecDeque;

use nalgebra::Vector2;
use painleve_shared::counts::ForceCounts;
use painleve_shared::kinematics::Pose;
use painleve_shared::{GeneralisedTorque, JointTorque, LinkMotion};

use crate::readings::Session;
use crate::rest::RestFound;
use crate::{CommissionError, Rig};

/// Normal forces to choose from, as parts of that at rest: a light tip slides under a small torque, but an arm
/// that presses by itself has to be relieved by torque first.
const NORMAL_SHARES: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];

/// Rate at which the commanded |f_t|/f_n rises, 1/s.
const RISE_PER_S: f64 = 0.5;

/// Time in which the normal force falls to its share, s.
const RELIEF_S: f64 = 0.1;

/// Largest commanded |f_t|/f_n. Pushed harder, a tip that holds turns about its contact, and shows too small a friction.
const LARGEST_RATIO: f64 = 1.1;

/// Normal force of a sliding tip, as a part of the commanded one.
const PRESSED: f64 = 0.5;

/// Distance of the tip that ends a slide, m.
const SLIDE_M: f64 = 0.001;

/// Duration over which the ratio is averaged, s.
const MEAN_S: f64 = 0.01;

/// Pause after a slide, s.
const PAUSE_S: f64 = 0.1;

/// Why the friction has not been measured.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoSlide {
    /// More torque would be needed.
    #[error(
        "the tip did not slide within a torque of {limit_nm} N·m; raise --torque-limit-nm, or set belt.friction"
    )]
    TorqueLimit {
        /// The torque limit, N·m.
        limit_nm: f64,
    },
    /// The tip holds however much it is pushed.
    #[error(
        "the tip did not slide under a tangential force of {LARGEST_RATIO} times the normal force"
    )]
    Holds,
    /// The tip has left the belt.
    #[error("the tip left the belt instead of sliding")]
    LeftBelt,
}

/// Measures the friction coefficient: the mean of both directions, or that of the one in which the tip slides.
pub(crate) fn measure<R: Rig>(
    session: &mut Session<'_, R>,
    rest: &RestFound,
    force_reversed: [bool; 2],
) -> Result<Result<f64, NoSlide>, CommissionError<R::Error>> {
    let limit_nm = session.expected.torque_limit_nm;
    let mut ratios = [Err(NoSlide::TorqueLimit { limit_nm }); 2];
    for (ratio, direction) in ratios.iter_mut().zip([1.0, -1.0]) {
        *ratio = slide(session, rest, force_reversed, direction)?;
        for _ in 0..session.ticks(PAUSE_S) {
            session.exchange(JointTorque::zeros())?;
        }
    }
    Ok(match ratios {
        [Ok(one), Ok(other)] => Ok((one + other) / 2.0),
        [one, other] => one.or(other),
    })
}

/// Pushes the tip along ±t until it slides; the ratio of the forces then.
fn slide<R: Rig>(
    session: &mut Session<'_, R>,
    rest: &RestFound,
    force_reversed: [bool; 2],
    direction: f64,
) -> Result<Result<f64, NoSlide>, CommissionError<R::Error>> {
    let limit_nm = session.expected.torque_limit_nm;
    let force_n = |share: f64, ratio: f64| {
        let normal_n = share * rest.normal_force_n;
        Vector2::new(-direction * ratio * normal_n, normal_n)
    };
    let reach = |share: f64| {
        let is_allowed = |ratio| {
            let torque_nm = torque_for(session, &rest.theta_rad, &force_n(share, ratio));
            torque_nm.amax() < limit_nm
        };
        let steps = (0..30).map(|step| f64::from(step) * LARGEST_RATIO / 30.0);
        steps.take_while(|ratio| is_allowed(*ratio)).count()
    };
    let Some(share) = NORMAL_SHARES
        .into_iter()
        .rev()
        .max_by_key(|share| reach(*share))
    else {
        return Ok(Err(NoSlide::TorqueLimit { limit_nm }));
    };
    let mut theta = rest.theta_rad;
    let mut start_m = None;
    let kept = session.ticks(MEAN_S) as usize;
    let mut recent = VecDeque::with_capacity(kept);
    let step = RISE_PER_S / session.expected.tick_hz;
    for tick in 0..(LARGEST_RATIO / step) as u32 {
        let ratio = f64::from(tick) * step;
        let torque_nm = torque_for(session, &theta, &force_n(share, ratio));
        if torque_nm.amax() > limit_nm {
            return Ok(Err(NoSlide::TorqueLimit { limit_nm }));
        }
        let part = (f64::from(tick) / f64::from(session.ticks(RELIEF_S))).min(1.0);
        let raw = session.exchange(torque_nm * part)?;
        let Some(now) = session.theta_rad(raw.joints) else {
            continue;
        };
        theta = now;
        let tip_m = session.expected.arm.tip_m(&Pose::new(&theta)).x;
        let start_m = *start_m.get_or_insert(tip_m);
        let forces = raw.forces.map(|ForceCounts(counts)| f64::from(counts));
        let mut net_n = session.net_force_n(forces, rest.tare);
        for axis in 0..2 {
            if force_reversed[axis] {
                net_n[axis] = -net_n[axis];
            }
        }
        if recent.len() == kept {
            recent.pop_front();
        }
        recent.push_back(net_n);
        if (tip_m - start_m) * direction > SLIDE_M {
            let mean = recent.iter().sum::<Vector2<f64>>() / recent.len() as f64;
            // A tip that has left the belt shows no friction.
            let is_pressed = mean.y > PRESSED * force_n(share, ratio).y;
            return Ok(if is_pressed {
                Ok((mean.x / mean.y).abs())
            } else {
                Err(NoSlide::LeftBelt)
            });
        }
    }
    Ok(Err(NoSlide::Holds))
}

/// Returns the joint torques that hold this force (f_t, f_n) on the tip at rest, N·m: u = w − Jᵀ f.
fn torque_for<R: Rig>(
    session: &Session<'_, R>,
    theta: &LinkMotion<f64>,
    force_n: &Vector2<f64>,
) -> JointTorque<f64> {
    let arm = &session.expected.arm;
    let pose = Pose::new(theta);
    let load_nm = arm.passive_torque_nm(theta, &LinkMotion::zeros(), &pose);
    let held_nm = GeneralisedTorque::from_vector(arm.jacobian(&pose).transpose() * force_n);
    (load_nm - held_nm).to_joints()
}
