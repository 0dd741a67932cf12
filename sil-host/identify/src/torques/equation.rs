//! Equations of the unknowns: what the model leaves over of the torques at one time of a slide.

use nalgebra::{SVector, Vector2};
use painleve_shared::{
    Arm, ArmParameters, GeneralisedTorque, JointMotion, JointTorque, OutOfRange, Pose,
};

use crate::geometry::joint_rad;
use crate::parameters::Parameters;
use crate::{Limits, Reading, Slide};

/// Number of unknowns: four of each joint, six of the force cells, the tilt.
pub(super) const COUNT: usize = 15;

pub(super) type Values = SVector<f64, COUNT>;

/// Index of an unknown of a joint.
pub(super) const FRICTION: usize = 0;
pub(super) const SPRING: usize = 1;
pub(super) const STAGE: usize = 2;
pub(super) const OFFSET: usize = 3;
pub(super) const OF_JOINT: usize = 4;

/// Index of the part of the readings of f_t and f_n that is none of the force, of f_n's in that of f_t, of f_t's in that of
/// f_n, of what the readings of f_t and f_n have in addition, N, and of the tilt.
pub(super) const CELLS: usize = 2 * OF_JOINT;
pub(super) const INTO_T: usize = CELLS + 2;
pub(super) const INTO_N: usize = CELLS + 3;
pub(super) const ZEROS: usize = CELLS + 4;
pub(super) const BELT: usize = COUNT - 1;

/// Time over which readings are averaged, s.
const MEAN_S: f64 = 0.1;

/// Least turn of a joint from one mean to the next, and on to the one after it in the same direction, rad. In a joint that
/// turns slowly, waves and vibration of the belt reverse the friction.
const LEAST_TURN_RAD: f64 = 9e-3;

/// Largest distance of the readings' mean instant from the middle of the time over which they are averaged, as a part of it.
const OFF_CENTRE: f64 = 0.02;

/// Least share of a time's readings: the serial line carries one tick of four at the highest rate.
const LEAST_SHARE: f64 = 0.1;

/// Time over which a joint turns back if it vibrates, s: half a period of a belt that hangs softly.
const BACK_S: f64 = 8e-3;

/// Change of the tilt for its derivative, rad.
const TILTED_RAD: f64 = 1e-4;

/// Means of readings over a short time.
#[derive(Clone, Copy)]
struct Mean {
    /// Number of the time in the slide.
    number: u32,
    joints_rad: Vector2<f64>,
    force_n: Vector2<f64>,
    torque_nm: Vector2<f64>,
    /// Whether each joint turned back at some time.
    turns_back: [bool; 2],
}

/// One joint's torque that the model leaves over, and its derivatives.
pub(super) struct Equation {
    pub joint: usize,
    pub by: Values,
    pub left_over_nm: f64,
}

/// Returns the equations of slides at `tick_hz` of an arm with this geometry and these known dynamics, and the torques' root
/// mean square, N·m.
///
/// # Errors
/// [`OutOfRange`] for an arm that cannot be built.
pub(super) fn equations(
    slides: &[Slide],
    geometry: &Parameters,
    known: &ArmParameters<f64>,
    tick_hz: f64,
    limits: &Limits,
) -> Result<(Vec<Equation>, f64), OutOfRange> {
    let ticks = libm::round(MEAN_S * tick_hz).max(1.0);
    let model = Model::new(known, ticks / tick_hz)?;
    let mut equations = Vec::new();
    let (mut square, mut count) = (0.0, 0.0);
    for slide in slides {
        let means: Vec<Mean> = stretches(&slide.readings, ticks as u32)
            .filter_map(|(number, readings)| Mean::of(number, readings, geometry, limits))
            .collect();
        let mut force_n = Vector2::zeros();
        for mean in &means {
            square += mean.torque_nm.norm_squared();
            count += 2.0;
            force_n += mean.force_n / means.len() as f64;
        }
        for window in means.windows(3) {
            if let [before, now, after] = window
                && after.number == before.number.wrapping_add(2)
            {
                equations.extend(model.equations(before, now, after, force_n));
            }
        }
    }
    Ok((equations, libm::sqrt(square / f64::max(count, 1.0))))
}

/// Splits readings into times of so many ticks, and numbers these. Leaves out times over which the readings are not spread
/// evenly, because some are missing: their mean is that of another instant.
fn stretches(readings: &[Reading], ticks: u32) -> impl Iterator<Item = (u32, &[Reading])> {
    let first = readings.first().map_or(0, |reading| reading.tick);
    let since = move |reading: &Reading| reading.tick.wrapping_sub(first);
    readings
        .chunk_by(move |one, other| since(one) / ticks == since(other) / ticks)
        .filter_map(move |of_time| {
            let number = since(of_time.first()?) / ticks;
            let place = |reading: &Reading| f64::from(since(reading) % ticks);
            let mean = of_time.iter().map(place).sum::<f64>() / of_time.len() as f64;
            let off = (mean - 0.5 * f64::from(ticks - 1)).abs() / f64::from(ticks);
            let share = of_time.len() as f64 / f64::from(ticks);
            (off <= OFF_CENTRE && share >= LEAST_SHARE).then_some((number, of_time))
        })
}

impl Equation {
    /// Returns what is left over with these unknowns, N·m.
    pub fn off_nm(&self, unknowns: &Values) -> f64 {
        self.left_over_nm - self.by.dot(unknowns)
    }
}

impl Mean {
    /// Returns the means of the readings of a time, if the tip is on the belt in all of them.
    fn of(
        number: u32,
        readings: &[Reading],
        geometry: &Parameters,
        limits: &Limits,
    ) -> Option<Self> {
        let back = (BACK_S / MEAN_S * readings.len() as f64).round().max(1.0) as usize;
        let [mut encoders_rad, mut force_n, mut torque_nm] = [Vector2::zeros(); 3];
        for reading in readings {
            if reading.force_n[1] < limits.contact_n {
                return None;
            }
            encoders_rad += Vector2::from(reading.encoders_rad);
            force_n += Vector2::from(reading.force_n);
            torque_nm += Vector2::from(reading.torque_nm);
        }
        let share = 1.0 / readings.len() as f64;
        encoders_rad *= share;
        Some(Self {
            number,
            joints_rad: Vector2::from([0, 1].map(|it| joint_rad(geometry, it, encoders_rad[it]))),
            force_n: force_n * share,
            torque_nm: torque_nm * share,
            turns_back: [0, 1].map(|joint| turns_back(readings, joint, back)),
        })
    }
}

/// Returns whether a joint turns within `back` readings against the direction in which it turns as a whole.
fn turns_back(readings: &[Reading], joint: usize, back: usize) -> bool {
    let turn_rad = |readings: &[Reading]| match readings {
        [from, .., to] => to.encoders_rad[joint] - from.encoders_rad[joint],
        _ => 0.0,
    };
    let direction = turn_rad(readings).signum();
    readings
        .windows(back + 1)
        .any(|stretch| turn_rad(stretch) * direction < 0.0)
}

/// The arm's model by what is known.
struct Model {
    arm: Arm<f64>,
    tilted: Arm<f64>,
    rest_rad: [f64; 2],
    /// Time between two means, s.
    step_s: f64,
}

impl Model {
    fn new(known: &ArmParameters<f64>, step_s: f64) -> Result<Self, OutOfRange> {
        let tilted = ArmParameters {
            belt_tilt_rad: known.belt_tilt_rad + TILTED_RAD,
            ..*known
        };
        Ok(Self {
            arm: Arm::new(*known)?,
            tilted: Arm::new(tilted)?,
            rest_rad: known.spring_rest_rad,
            step_s,
        })
    }

    /// Returns the equations of the joints that turn, in a slide with this mean force.
    fn equations(
        &self,
        before: &Mean,
        now: &Mean,
        after: &Mean,
        slide_n: Vector2<f64>,
    ) -> impl Iterator<Item = Equation> {
        let links = |joints: Vector2<f64>| JointMotion::from_vector(joints).to_links();
        let turned_rad = after.joints_rad - before.joints_rad;
        let theta = links(now.joints_rad);
        let rate = links(turned_rad / (2.0 * self.step_s));
        let change = after.joints_rad - 2.0 * now.joints_rad + before.joints_rad;
        let acceleration = links(change / (self.step_s * self.step_s));
        let pose = Pose::new(&theta);
        let arm = &self.arm;
        let moving_nm = arm.passive_torque_nm(&theta, &rate, &pose)
            + arm.centrifugal_torque_nm(&rate, &pose)
            + GeneralisedTorque::from_vector(arm.mass_matrix(&pose) * acceleration.vector());
        let tilted_nm = self.tilted.passive_torque_nm(&theta, &rate, &pose)
            - arm.passive_torque_nm(&theta, &rate, &pose);
        let jacobian = arm.jacobian(&pose);
        let held_nm = |along_n: f64, off_n: f64| -> JointTorque<f64> {
            let force_n = Vector2::new(along_n, off_n);
            GeneralisedTorque::from_vector(jacobian.transpose() * force_n).to_joints()
        };
        let moving_nm = moving_nm.to_joints();
        let model_nm = moving_nm.vector() - held_nm(now.force_n.x, now.force_n.y).vector();
        let [along_n, off_n] = slide_n.into();
        let model_evenly_nm = moving_nm.vector() - held_nm(along_n, off_n).vector();
        let common = [
            held_nm(along_n, 0.0),
            held_nm(0.0, off_n),
            held_nm(off_n, 0.0),
            held_nm(0.0, along_n),
            held_nm(1.0, 0.0),
            held_nm(0.0, 1.0),
            tilted_nm.map(|nm| nm / TILTED_RAD).to_joints(),
        ];
        let halves_rad = [
            now.joints_rad - before.joints_rad,
            after.joints_rad - now.joints_rad,
        ];
        let (now, rest_rad) = (*now, self.rest_rad);
        (0..2)
            .filter(move |joint| {
                let [one_rad, two_rad] = halves_rad.map(|it| it[*joint]);
                one_rad.abs().min(two_rad.abs()) >= LEAST_TURN_RAD
                    && one_rad * two_rad > 0.0
                    && !now.turns_back[*joint]
            })
            .map(move |joint| {
                let mut by = Values::zeros();
                let own = OF_JOINT * joint;
                by[own + FRICTION] = turned_rad[joint].signum();
                by[own + SPRING] = now.joints_rad[joint] - rest_rad[joint];
                by[own + STAGE] = model_evenly_nm[joint];
                by[own + OFFSET] = 1.0;
                for (at, torque_nm) in common.iter().enumerate() {
                    by[CELLS + at] = torque_nm.vector()[joint];
                }
                Equation {
                    joint,
                    by,
                    left_over_nm: now.torque_nm[joint] - model_nm[joint],
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_ticks_whatever_is_lost() {
        let start = u32::MAX - 50;
        let kept = |keep: fn(u32) -> bool| -> Vec<(u32, usize)> {
            let ticks = (0..500).filter(|tick| keep(*tick));
            let readings: Vec<Reading> = ticks
                .map(|tick| Reading {
                    tick: start.wrapping_add(tick),
                    encoders_rad: [0.0; 2],
                    force_n: [0.0; 2],
                    torque_nm: [0.0; 2],
                })
                .collect();
            let times = stretches(&readings, 100).map(|(number, of_time)| (number, of_time.len()));
            times.collect()
        };
        let all = |count| (0..5).map(|number| (number, count)).collect::<Vec<_>>();
        assert_eq!(kept(|_| true), all(100));
        assert_eq!(kept(|tick| tick % 4 == 0), all(25));
        // Half of a time, a few readings, and none.
        let lost = kept(|tick| !(130..180).contains(&tick) && (tick % 25 == 0 || tick < 300));
        assert_eq!(lost, [(0, 100), (2, 100)]);
        assert_eq!(
            kept(|tick| tick / 100 != 1),
            [0, 2, 3, 4].map(|it| (it, 100))
        );
    }
}
