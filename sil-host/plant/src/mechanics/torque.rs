//! Torque on the joints between two commands.

use nalgebra::Vector2;
use painleve_shared::JointTorque;

use super::cash_karp::NODES;
use crate::plant::State;

/// Joint torques (u1, u2) of a first-order stage after one command: u(t) = target + (start −
/// target) exp(−(t − t0)/lag). Without lag the command takes effect at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueSegment {
    start_s: f64,
    start_nm: JointTorque<f64>,
    target_nm: JointTorque<f64>,
    lag_s: f64,
}

impl TorqueSegment {
    /// Returns a constant torque.
    pub fn constant(torque_nm: JointTorque<f64>) -> Self {
        Self {
            start_s: 0.0,
            start_nm: torque_nm,
            target_nm: torque_nm,
            lag_s: 0.0,
        }
    }

    /// Returns the segment that follows when `target_nm` is commanded at `t_s` to a stage with time
    /// constant `lag_s`.
    #[inline]
    pub fn followed_by(&self, t_s: f64, target_nm: JointTorque<f64>, lag_s: f64) -> Self {
        Self {
            start_s: t_s,
            start_nm: self.at(t_s),
            target_nm,
            lag_s,
        }
    }

    /// Returns whether the torque is constant until the next command.
    #[inline]
    pub fn is_constant(&self) -> bool {
        self.lag_s == 0.0 || self.start_nm == self.target_nm
    }

    /// Returns the time constant of the stage, s.
    #[inline]
    pub fn lag_s(&self) -> f64 {
        self.lag_s
    }

    /// Returns the joint torques at time `t_s`, N·m.
    #[inline]
    pub fn at(&self, t_s: f64) -> JointTorque<f64> {
        self.with_remaining(self.remaining(t_s))
    }

    /// Returns the joint torques, N·m, when this fraction of the change to the target remains.
    #[inline]
    pub fn with_remaining(&self, fraction: f64) -> JointTorque<f64> {
        self.target_nm + (self.start_nm - self.target_nm) * fraction
    }

    /// Returns the fraction of the change to the target that remains at time `t_s`.
    #[inline]
    pub fn remaining(&self, t_s: f64) -> f64 {
        if self.is_constant() {
            0.0
        } else {
            libm::exp(-(t_s - self.start_s) / self.lag_s)
        }
    }

    /// Returns the fractions that remain at the stages of a short step of `size_s` seconds and at its
    /// end, if `remaining` is that at its start. All are powers of one exponential, because the
    /// nodes are multiples of 1/40.
    #[inline]
    pub fn remaining_in_step(&self, remaining: f64, size_s: f64) -> Remaining {
        let power_1 = libm::exp(-size_s / (40.0 * self.lag_s));
        let power_2 = power_1 * power_1;
        let power_3 = power_2 * power_1;
        let power_4 = power_2 * power_2;
        let power_8 = power_4 * power_4;
        let power_12 = power_8 * power_4;
        let power_24 = power_12 * power_12;
        let power_32 = power_24 * power_8;
        let (power_35, power_40) = (power_32 * power_3, power_32 * power_8);
        let at_nodes = [power_8, power_12, power_24, power_40, power_35];
        Remaining {
            at_nodes: at_nodes.map(|power| remaining * power),
            at_end: remaining * power_40,
        }
    }
}

/// Fractions of the change to the target that remain in a short step.
#[derive(Clone, Copy, Debug)]
pub struct Remaining {
    /// At its stages.
    pub at_nodes: [f64; NODES.len()],
    /// At its end.
    pub at_end: f64,
}

/// Response of the arm, frozen in one state, to the part of a torque that decays with the lag.
///
/// With a lag much shorter than a step, the decaying torque is the only fast part of the motion.
/// Frozen in one state, the arm responds with θ̈ = a r, where r = exp(−(t − t0)/lag) remains of the
/// change, hence θ̇ = −lag a r and θ = lag² a r. A step integrates the state without this response,
/// which is smooth.
#[derive(Clone, Copy, Debug)]
pub struct LagResponse {
    lag_s: f64,
    /// Acceleration of the links by the whole change, a, rad/s².
    acceleration_rad_s2: Vector2<f64>,
}

impl LagResponse {
    /// Creates the response from the time derivative of the state due to the whole change.
    pub fn new(torque: &TorqueSegment, slope: &State) -> Self {
        Self {
            lag_s: torque.lag_s,
            acceleration_rad_s2: Vector2::new(slope[2], slope[3]),
        }
    }

    /// Returns the part of the state, when this fraction of the change remains.
    #[inline]
    pub fn state(&self, remaining: f64) -> State {
        let rates = self.acceleration_rad_s2 * (-self.lag_s * remaining);
        let angles = rates * -self.lag_s;
        State::new(angles.x, angles.y, rates.x, rates.y)
    }

    /// Returns the time derivative of [`LagResponse::state`].
    #[inline]
    pub fn slope(&self, remaining: f64) -> State {
        self.state(remaining) * (-1.0 / self.lag_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lag_is_first_order_and_continuous() {
        let before = TorqueSegment::constant(JointTorque::new(1.0, -1.0));
        let after = before.followed_by(2.0, JointTorque::new(3.0, 0.0), 0.01);
        assert_eq!(after.at(2.0), JointTorque::new(1.0, -1.0));
        let one_constant = after.at(2.01);
        assert!((one_constant.first() - (3.0 - 2.0 * (-1.0_f64).exp())).abs() < 1e-12);
        let next = after.followed_by(2.01, JointTorque::zeros(), 0.01);
        assert_eq!(next.at(2.01), one_constant);
    }

    #[test]
    fn the_fractions_in_a_step_are_those_at_its_nodes() {
        let segment = TorqueSegment::constant(JointTorque::zeros()).followed_by(
            0.0,
            JointTorque::new(1.0, 0.0),
            3e-4,
        );
        let (start_s, size_s) = (2e-4, 1e-3);
        let Remaining { at_nodes, at_end } =
            segment.remaining_in_step(segment.remaining(start_s), size_s);
        let nodes = NODES.into_iter().chain([1.0]);
        for (node, fraction) in nodes.zip(at_nodes.into_iter().chain([at_end])) {
            let exact = segment.remaining(start_s + node * size_s);
            assert!((fraction / exact - 1.0).abs() < 1e-13, "{node}: {fraction}");
        }
    }

    #[test]
    fn without_lag_the_command_takes_effect_at_once() {
        let segment = TorqueSegment::constant(JointTorque::zeros()).followed_by(
            1.0,
            JointTorque::new(2.0, 1.0),
            0.0,
        );
        assert_eq!(segment.at(1.0), JointTorque::new(2.0, 1.0));
    }
}
