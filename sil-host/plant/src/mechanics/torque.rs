//! Torque on the joints between two commands.

use painleve_shared::JointTorque;

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
    pub fn followed_by(&self, t_s: f64, target_nm: JointTorque<f64>, lag_s: f64) -> Self {
        Self {
            start_s: t_s,
            start_nm: self.at(t_s),
            target_nm,
            lag_s,
        }
    }

    /// Returns whether the torque is constant until the next command.
    pub fn is_constant(&self) -> bool {
        self.lag_s == 0.0 || self.start_nm == self.target_nm
    }

    /// Returns the joint torques at time `t_s`, N·m.
    #[inline]
    pub fn at(&self, t_s: f64) -> JointTorque<f64> {
        if self.is_constant() {
            return self.target_nm;
        }
        let remaining = libm::exp(-(t_s - self.start_s) / self.lag_s);
        self.target_nm + (self.start_nm - self.target_nm) * remaining
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
    fn without_lag_the_command_takes_effect_at_once() {
        let segment = TorqueSegment::constant(JointTorque::zeros()).followed_by(
            1.0,
            JointTorque::new(2.0, 1.0),
            0.0,
        );
        assert_eq!(segment.at(1.0), JointTorque::new(2.0, 1.0));
    }
}
