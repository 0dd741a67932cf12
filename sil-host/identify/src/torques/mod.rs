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

mod equation;
mod solution;

use nalgebra::{Matrix2, Vector2};
use painleve_shared::{ArmParameters, OutOfRange};

use crate::parameters::Parameters;
use crate::verdict::BELIEVED;
use crate::{Limits, Refusal, Slide};
use equation::{
    BELT, CELLS, Equation, FRICTION, INTO_N, INTO_T, OF_JOINT, OFFSET, SPRING, STAGE, Values,
    ZEROS, equations,
};
use solution::Solution;

/// Standard deviations known beforehand: gain of a stage, stiffness relative to the scenario's, gain and cross-talk of the force
/// cells, their readings without a force, N, which drift after they were measured, and tilt of the belt, rad.
const GAIN: f64 = 0.1;
const STIFFNESS: f64 = 0.15;
const CELL: f64 = 0.05;
const ZERO_N: f64 = 0.2;
const TILT_RAD: f64 = 0.04;

/// Part of a result that is always assumed to be wrong: at the low speed of a slide, friction is a little more than Coulomb's.
const ALWAYS: f64 = 0.02;

/// Part of the torques by which a friction is always assumed to be wrong: they act some ticks after the readings that they
/// answer, and change meanwhile if a joint turns, with the direction of its turn, as friction does.
const ALWAYS_FRICTION: f64 = 0.0003;

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

impl Cell {
    /// Returns the force cells: with readings r = (1 + E) f + r₀, the part A of the readings that is none of the force is
    /// 1 − (1 + E)⁻¹, and (1 + E)⁻¹ r₀ comes in addition.
    fn both(solution: &Solution) -> [Cell; 2] {
        let part = |index: usize| solution.unknowns[index];
        let force = Matrix2::new(
            1.0 - part(CELLS),
            -part(INTO_T),
            -part(INTO_N),
            1.0 - part(CELLS + 1),
        );
        let reading = force.try_inverse().unwrap_or_default();
        let zeros_n = reading * Vector2::new(part(ZEROS), part(ZEROS + 1));
        let deviation = |index: usize| solution.sum(&solution.unit(index)).deviation;
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
        let (equations, torque_nm) = equations(slides, geometry, known, tick_hz, limits)?;
        // Friction and offset are hardly known, but less than the torques themselves.
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
        // What is known of friction and offset beforehand is the size of the torques.
        let torque_nm = deviations[OFFSET];
        let always = |estimate: Estimate, part: f64| Estimate {
            deviation: libm::hypot(estimate.deviation, part * torque_nm),
            ..estimate
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
                friction_nm: always(assured(friction.value, friction.deviation), ALWAYS_FRICTION),
                stiffness_nm_rad: assured(nominal + stiffness.value, stiffness.deviation),
                gain: assured(gain, commanded.deviation * gain * gain),
                offset_nm: always(assured(offset.value, offset.deviation), ALWAYS_OFFSET),
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
            cells: Cell::both(&solution),
            tilt_rad: Estimate {
                deviation: libm::hypot(tilt.deviation, ALWAYS_TILT_RAD),
                ..tilt
            },
            left_over_nm: (!equations.is_empty()).then(|| [rms(&before), rms(&solution.unknowns)]),
            torque_nm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
