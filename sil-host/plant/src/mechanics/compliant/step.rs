//! Instants and steps of the compliant plant in the interface of every plant.

use nalgebra::SVector;
use painleve_shared::{LinkMotion, Pose, Slip};

use super::equations::{CompliantMotion, FULL};
use crate::mechanics::motion::Motion;
use crate::mechanics::rosenbrock::Equations;
use crate::plant::{ContactMode, Snapshot, State, Step};

/// One accepted step.
pub(super) struct CompliantStep<'a> {
    pub motion: CompliantMotion<'a>,
    pub mode: ContactMode,
    /// Time (s) and state at the start, and at the end.
    pub start: (f64, &'a SVector<f64, FULL>),
    pub end: (f64, &'a SVector<f64, FULL>),
}

impl Step for CompliantStep<'_> {
    fn start_s(&self) -> f64 {
        self.start.0
    }

    fn end_s(&self) -> f64 {
        self.end.0
    }

    fn mode(&self) -> ContactMode {
        self.mode
    }

    fn start(&self) -> Snapshot {
        self.motion.snapshot(self.mode, self.start.0, self.start.1)
    }

    fn end(&self) -> Snapshot {
        self.motion.snapshot(self.mode, self.end.0, self.end.1)
    }
}

impl<'a> CompliantMotion<'a> {
    /// Returns the same arm on a rigid belt, with the friction at a time and a tip position along
    /// the belt (m).
    pub(super) fn rigid(&self, t_s: f64, tip_t_m: f64) -> Motion<'a> {
        Motion {
            arm: self.arm,
            belt: self.belt.profile(),
            friction: self.friction_at(t_s, tip_t_m),
            torque: self.torque,
        }
    }

    /// Returns the snapshot of an instant. Its b and p are those of the rigid contact, without
    /// gears and joint friction.
    pub(super) fn snapshot(&self, mode: ContactMode, t_s: f64, x: &SVector<f64, FULL>) -> Snapshot {
        let state = State::new(x[0], x[1], x[2], x[3]);
        let pose = Pose::new(&LinkMotion::new(x[0], x[1]));
        let motion = self.rigid(t_s, self.arm.tip_m(&pose).x);
        let touch = self.touch_at(t_s, x);
        let slips = match mode {
            ContactMode::Stick => -touch.force_n.x,
            _ => motion.relative_velocity_m_s(t_s, &state).x,
        };
        let slides = ContactMode::slide(Slip::of(slips));
        let here = motion.evaluate(slides, t_s, &state);
        let slope: SVector<f64, FULL> = self.derivative(t_s, x);
        Snapshot {
            theta_ddot_rad_s2: LinkMotion::new(slope[2], slope[3]),
            gap_m: here.gap[0] - touch.surface_m,
            gap_rate_m_s: -touch.closing_m_s,
            normal_force_n: touch.force_n.y,
            tangential_force_n: touch.force_n.x,
            mode,
            ..motion.snapshot_of(mode, t_s, &state, &here)
        }
    }
}
