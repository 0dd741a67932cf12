//! What the torques of slides show of the joints: their friction and springs, and the gains of their stages.
//!
//! In a slow slide the commanded torque u of a joint carries gravity, spring, contact force and friction. What the arm's
//! model u_m leaves over is linear in what the model does not know (Khalil and Dombre, "Modeling, Identification and Control
//! of Robots", 2002, chapter 12):
//!
//! u − u_m = c sgn q̇ + δk (q − q₀) + b u_m + o,
//!
//! plus the effects of both force cells' gains, cross-talk and zeros and of the belt's tilt, which are the same for both joints.
//! Least squares determine all of these, with what is known beforehand. A stage gives 1/(1 + b) times the commanded torque;
//! that differs little from the gains of the force cells, and its deviation says so. Friction and stiffness are in commanded
//! torque, as the controller needs them, so that this does not matter to them. u itself is no regressor: with its noise, the
//! sum of squares would be least for torques that are too small. Nor is the force of a single time, whose noise would pass for a
//! part of the reading: the factors of b and of the cells take the slide's mean force.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use painleve_shared::{
    Arm, ArmParameters, GeneralisedTorque, JointMotion, JointTorque, OutOfRange, Pose,
};

use crate::fit::sharing;
use crate::geometry::joint_rad;
use crate::parameters::Parameters;
use crate::verdict::BELIEVED;
use crate::{Limits, Reading, Refusal, Slide};

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

/// Standard deviations known beforehand: gain of a stage, stiffness relative to the scenario's, gain and cross-talk of the force
/// cells, their readings without a force, N, which drift after they were measured, and tilt of the belt, rad.
const GAIN: f64 = 0.1;
const STIFFNESS: f64 = 0.15;
const CELL: f64 = 0.05;
const ZERO_N: f64 = 0.2;
const TILT_RAD: f64 = 0.04;

/// Part of a result that is always assumed to be wrong: at the low speed of a slide, friction is a little more than Coulomb's.
const ALWAYS: f64 = 0.02;

/// Part of the torques by which an offset is always assumed to be wrong: slides hardly tell it from the belt's tilt.
const ALWAYS_OFFSET: f64 = 0.005;

/// Error of a force cell's gain and cross-talk that is always assumed: they share a scale with the gains of the stages, and
/// slides hardly tell them from the belt's tilt. The errors of sixty simulated arms have a root mean square of 0.003 to 0.019.
const ALWAYS_CELL: f64 = 0.012;

/// Error of the belt's tilt that is always assumed, rad: slides hardly tell it from the force cells' gains and cross-talk. The
/// errors of sixteen simulated arms of two kinds have a root mean square of 0.031 and 0.039, where least squares say 0.021 and
/// 0.030.
const ALWAYS_TILT_RAD: f64 = 0.025;

/// Largest part of the torques that the model may leave over. Arms as bad as life, on rigs with all effects, leave 5 %; those
/// with a dead force cell or stage, or with a spring that nobody told of, 20 % at least.
const UNEXPLAINED: f64 = 0.1;

/// Change of the tilt for its derivative, rad.
const TILTED_RAD: f64 = 1e-4;

/// Rounds in which the noise is estimated.
const ROUNDS: usize = 4;

/// Number of unknowns: four of each joint, six of the force cells, the tilt.
const COUNT: usize = 15;

type Values = SVector<f64, COUNT>;

/// Index of an unknown of a joint.
const FRICTION: usize = 0;
const SPRING: usize = 1;
const STAGE: usize = 2;
const OFFSET: usize = 3;
const OF_JOINT: usize = 4;

/// Index of the part of the readings of f_t and f_n that is none of the force, of f_n's in that of f_t, of f_t's in that of
/// f_n, of what the readings of f_t and f_n have in addition, N, and of the tilt.
const CELLS: usize = 2 * OF_JOINT;
const INTO_T: usize = CELLS + 2;
const INTO_N: usize = CELLS + 3;
const ZEROS: usize = CELLS + 4;
const BELT: usize = COUNT - 1;

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// What the slides show of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joint {
    /// Coulomb friction, in commanded torque, N·m.
    pub friction_nm: Estimate,
    /// Stiffness of the spring, in commanded torque, N·m/rad.
    pub stiffness_nm_rad: Estimate,
    /// Torque of the stage relative to the commanded one.
    pub gain: Estimate,
    /// Constant torque that the model does not have, in commanded torque, N·m: of a spring that rests at another angle, or of
    /// a stage that gives a torque when none is commanded.
    pub offset_nm: Estimate,
}

impl Joint {
    /// Returns whether its friction would drive it.
    pub fn drives_itself(&self) -> bool {
        self.friction_nm.value < -BELIEVED * self.friction_nm.deviation
    }

    /// Returns whether it takes a constant torque that the model does not have.
    pub fn has_offset(&self) -> bool {
        self.offset_nm.value.abs() > BELIEVED * self.offset_nm.deviation
    }

    /// Returns by how much its spring would rest at a larger angle if that explains the offset, rad; `None` without a spring.
    pub fn rest_error_rad(&self) -> Option<f64> {
        let stiffness = self.stiffness_nm_rad;
        (stiffness.value > BELIEVED * stiffness.deviation)
            .then(|| -self.offset_nm.value / stiffness.value)
    }

    /// Returns whether its stage gives another torque than any healthy one.
    pub fn has_another_gain(&self) -> bool {
        (self.gain.value - 1.0).abs() > BELIEVED * GAIN
    }
}

/// What the slides show of a force cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Reading relative to the force.
    pub gain: Estimate,
    /// Share of the other force that the reading contains.
    pub cross_talk: Estimate,
    /// Reading without a force, N.
    pub zero_n: Estimate,
}

/// What the slides show of both joints and of the force cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joints {
    /// Joints 1 and 2.
    pub joints: [Joint; 2],
    /// The cells of f_t and f_n.
    pub cells: [Cell; 2],
    /// Tilt of the belt beyond that of the model, rad.
    pub tilt_rad: Estimate,
    /// Torque that the model leaves over, root mean square, N·m: with all but the geometry as known before, and with this
    /// result. `None` if no joint has turned enough.
    pub left_over_nm: Option<[f64; 2]>,
    /// Torque of the slides, root mean square, N·m.
    pub torque_nm: f64,
}

impl Joints {
    /// Checks that the model explains the torques.
    ///
    /// # Errors
    /// [`Refusal::OtherTorques`] if it does not: no value that it gives is to be believed then.
    pub fn check(&self) -> Result<(), Refusal> {
        match self.left_over_nm {
            Some([_, left_nm]) if left_nm > UNEXPLAINED * self.torque_nm => {
                Err(Refusal::OtherTorques {
                    left_mnm: 1e3 * left_nm,
                    torque_mnm: 1e3 * self.torque_nm,
                })
            }
            _ => Ok(()),
        }
    }
}

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
struct Equation {
    joint: usize,
    by: Values,
    left_over_nm: f64,
}

impl Joints {
    /// Takes the joints' parameters from slides at `tick_hz` of an arm with this geometry, and what is known of its dynamics.
    ///
    /// # Errors
    /// [`OutOfRange`] for an arm that cannot be built.
    pub fn of(
        slides: &[Slide],
        geometry: &Parameters,
        known: &ArmParameters<f64>,
        tick_hz: f64,
        limits: &Limits,
    ) -> Result<Self, OutOfRange> {
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
        // Friction and offset are hardly known, but less than the torques themselves.
        let torque_nm = libm::sqrt(square / f64::max(count, 1.0));
        let mut deviations = Values::repeat(CELL);
        for joint in 0..2 {
            let own = OF_JOINT * joint;
            deviations[own + FRICTION] = torque_nm;
            deviations[own + SPRING] = STIFFNESS * known.stiffness_nm_rad[joint];
            deviations[own + STAGE] = GAIN;
            deviations[own + OFFSET] = torque_nm;
        }
        deviations[ZEROS] = ZERO_N;
        deviations[ZEROS + 1] = ZERO_N;
        deviations[BELT] = TILT_RAD;
        Ok(Self::fitted(&equations, &deviations, known))
    }

    /// Takes the parameters from the unknowns that solve the equations.
    fn fitted(equations: &[Equation], deviations: &Values, known: &ArmParameters<f64>) -> Self {
        let solution = Solution::of(equations, deviations);
        let assured = |value: f64, deviation: f64| Estimate {
            value,
            deviation: libm::hypot(deviation, ALWAYS * value),
        };
        let joint = |joint: usize| {
            let unit = |index: usize| solution.unit(OF_JOINT * joint + index);
            let friction = solution.sum(&unit(FRICTION));
            let nominal = known.stiffness_nm_rad[joint];
            let stiffness = solution.sum(&(unit(SPRING) + unit(STAGE) * nominal));
            let commanded = solution.sum(&unit(STAGE));
            let gain = 1.0 / (1.0 + commanded.value);
            let offset = solution.sum(&unit(OFFSET));
            Joint {
                friction_nm: assured(friction.value, friction.deviation),
                stiffness_nm_rad: assured(nominal + stiffness.value, stiffness.deviation),
                gain: assured(gain, commanded.deviation * gain * gain),
                offset_nm: Estimate {
                    deviation: libm::hypot(
                        assured(offset.value, offset.deviation).deviation,
                        // What is known of an offset beforehand is the size of the torques.
                        ALWAYS_OFFSET * deviations[OF_JOINT * joint + OFFSET],
                    ),
                    ..offset
                },
            }
        };
        let tilt = solution.sum(&solution.unit(BELT));
        let mut before = Values::zeros();
        for (joint, friction_nm) in known.coulomb_friction_nm.into_iter().enumerate() {
            before[OF_JOINT * joint + FRICTION] = friction_nm;
        }
        let rms = |unknowns: &Values| {
            let squares = equations.iter().map(|it| it.off_nm(unknowns).powi(2));
            libm::sqrt(squares.sum::<f64>() / equations.len() as f64)
        };
        Self {
            joints: [joint(0), joint(1)],
            cells: solution.cells(),
            tilt_rad: Estimate {
                deviation: libm::hypot(tilt.deviation, ALWAYS_TILT_RAD),
                ..tilt
            },
            left_over_nm: (!equations.is_empty()).then(|| [rms(&before), rms(&solution.unknowns)]),
            // What is known of an offset beforehand is the size of the torques.
            torque_nm: deviations[OFFSET],
        }
    }
}

/// The most probable unknowns.
struct Solution {
    unknowns: Values,
    covariance: SMatrix<f64, COUNT, COUNT>,
}

impl Solution {
    /// Solves equations, with the unknowns' standard deviations known beforehand.
    fn of(equations: &[Equation], deviations: &Values) -> Self {
        let mut solution = Self {
            unknowns: Values::zeros(),
            covariance: SMatrix::from_diagonal(&deviations.component_mul(deviations)),
        };
        for _ in 0..ROUNDS {
            let noise_nm = [0, 1].map(|joint| noise_nm(equations, joint, &solution.unknowns));
            // In deviations of what is known beforehand, so that one of zero is no special case.
            let mut information = SMatrix::<f64, COUNT, COUNT>::identity();
            let mut gradient = Values::zeros();
            for equation in equations {
                let noise_nm = noise_nm[equation.joint];
                let by = equation.by.component_mul(deviations) / noise_nm;
                information += by * by.transpose();
                gradient += by * (equation.left_over_nm / noise_nm);
            }
            let Some(decomposed) = information.cholesky() else {
                break;
            };
            let scale = SMatrix::from_diagonal(deviations);
            solution = Self {
                unknowns: scale * decomposed.solve(&gradient),
                covariance: scale * decomposed.inverse() * scale,
            };
        }
        solution
    }

    /// Returns the force cells: with readings r = (1 + E) f + r₀, the part A of the readings that is none of the force is
    /// 1 − (1 + E)⁻¹, and (1 + E)⁻¹ r₀ comes in addition.
    fn cells(&self) -> [Cell; 2] {
        let part = |index: usize| self.unknowns[index];
        let force = Matrix2::new(
            1.0 - part(CELLS),
            -part(INTO_T),
            -part(INTO_N),
            1.0 - part(CELLS + 1),
        );
        let reading = force.try_inverse().unwrap_or_default();
        let zeros_n = reading * Vector2::new(part(ZEROS), part(ZEROS + 1));
        let deviation = |index: usize| self.sum(&self.unit(index)).deviation;
        let of = |value: f64, index: usize| Estimate {
            value,
            deviation: libm::hypot(deviation(index), ALWAYS_CELL),
        };
        [(0, INTO_T), (1, INTO_N)].map(|(cell, into)| Cell {
            gain: of(reading[(cell, cell)], CELLS + cell),
            cross_talk: of(reading[(cell, 1 - cell)], into),
            zero_n: Estimate {
                value: zeros_n[cell],
                deviation: deviation(ZEROS + cell),
            },
        })
    }

    /// Returns the factors of one unknown.
    fn unit(&self, index: usize) -> Values {
        let mut factors = Values::zeros();
        factors[index] = 1.0;
        factors
    }

    /// Returns a sum of unknowns.
    fn sum(&self, factors: &Values) -> Estimate {
        Estimate {
            value: factors.dot(&self.unknowns),
            deviation: libm::sqrt(factors.dot(&(self.covariance * factors))),
        }
    }
}

impl Equation {
    /// Returns what is left over with these unknowns, N·m.
    fn off_nm(&self, unknowns: &Values) -> f64 {
        self.left_over_nm - self.by.dot(unknowns)
    }
}

/// Returns the noise of an equation of a joint, N·m, times the root of the number of neighbours that share an error.
fn noise_nm(equations: &[Equation], joint: usize, unknowns: &Values) -> f64 {
    let of_joint = equations.iter().filter(|it| it.joint == joint);
    let off: Vec<f64> = of_joint.map(|it| it.off_nm(unknowns)).collect();
    let sum = off.iter().map(|it| it * it).sum::<f64>();
    // Both joints determine the unknowns that they share.
    let freedom = off.len().saturating_sub(COUNT / 2).max(1);
    libm::sqrt(sum * sharing(&off) / freedom as f64).max(f64::MIN_POSITIVE)
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

    #[test]
    fn torques_are_left_over_beyond_the_friction_known_before() {
        let known = ArmParameters::<f64> {
            coulomb_friction_nm: [0.05, 0.0],
            ..ArmParameters::default()
        };
        let deviations = Values::repeat(1.0);
        let left_over_nm =
            |equations: &[Equation]| Joints::fitted(equations, &deviations, &known).left_over_nm;
        assert_eq!(left_over_nm(&[]), None);
        let mut by = Values::zeros();
        by[FRICTION] = -1.0;
        let [before_nm, _] = left_over_nm(&[Equation {
            joint: 0,
            by,
            left_over_nm: -0.06,
        }])
        .unwrap();
        assert!((before_nm - 0.01).abs() < 1e-9, "{before_nm}");
    }

    #[test]
    fn only_what_no_healthy_joint_has_is_impossible() {
        let of = |value: f64, deviation: f64| Estimate { value, deviation };
        let joint = |friction_nm, gain| Joint {
            friction_nm,
            gain,
            ..Joint::default()
        };
        let healthy = joint(of(-0.005, 0.002), of(1.35, 0.05));
        assert!(!healthy.drives_itself() && !healthy.has_another_gain());
        let impossible = joint(of(-0.009, 0.002), of(0.55, 0.05));
        assert!(impossible.drives_itself() && impossible.has_another_gain());
    }

    #[test]
    fn a_joint_that_vibrates_does_not_blur_the_other() {
        let equations: Vec<Equation> = (0..400)
            .map(|index| {
                let joint = index % 2;
                let mut by = Values::zeros();
                by[OF_JOINT * joint + FRICTION] = 1.0;
                // No regular pattern.
                let noise = libm::sin(f64::from(index as u32).powi(2));
                Equation {
                    joint,
                    by,
                    left_over_nm: 0.05 + [1e-4, 1e-2][joint] * noise,
                }
            })
            .collect();
        let solution = Solution::of(&equations, &Values::repeat(1.0));
        let deviation = |joint: usize| {
            let friction = solution.unit(OF_JOINT * joint + FRICTION);
            solution.sum(&friction).deviation
        };
        assert!(
            deviation(0) < 0.02 * deviation(1),
            "{} {}",
            deviation(0),
            deviation(1)
        );
    }
}
