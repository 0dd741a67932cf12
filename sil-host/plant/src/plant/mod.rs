//! The interface of a plant: a machine with two joints and a tip that responds to torque over time.
//!
//! Converters, closed loop, records and closed-loop studies use only [`Plant`]. The arm on its belt
//! ([`crate::mechanics`]) is built in; `examples/own-plant` adds another plant.

mod contact_mode;
mod probe;

use nalgebra::{Vector2, Vector4};
use painleve_shared::{JointTorque, LinkMotion};

pub use contact_mode::ContactMode;
pub use probe::{Event, Probe, Step};

/// Both joints as one vector: θ1, θ2 (rad, from the belt's inward normal), θ̇1, θ̇2 (rad/s).
pub type State = Vector4<f64>;

/// A machine with two joints whose tip may touch a moving surface.
///
/// ```
/// use painleve_plant::{Plant, PlantError, Probe, Snapshot};
/// use painleve_shared::{JointTorque, LinkMotion};
///
/// /// Two flywheels.
/// struct Flywheels(Snapshot);
///
/// impl Plant for Flywheels {
///     fn snapshot(&self) -> Snapshot {
///         self.0
///     }
///
///     fn command_torque(&mut self, target_nm: JointTorque<f64>, _lag_s: f64) {
///         self.0.torque_nm = target_nm;
///     }
///
///     fn advance(&mut self, until_s: f64, _: &mut dyn Probe) -> Result<(), PlantError> {
///         const INERTIA_KG_M2: f64 = 0.01;
///         let step_s = until_s - self.0.time_s;
///         let torque_nm = self.0.torque_nm.to_links();
///         let acceleration = LinkMotion::from_vector(torque_nm.vector() / INERTIA_KG_M2);
///         self.0.theta_dot_rad_s += acceleration * step_s;
///         self.0.theta_rad += self.0.theta_dot_rad_s * step_s;
///         self.0.time_s = until_s;
///         Ok(())
///     }
/// }
///
/// let mut plant = Flywheels(Snapshot::default());
/// plant.command_torque(JointTorque::new(1.0, 0.0), 0.0);
/// plant.advance(0.001, &mut ()).unwrap();
/// assert!(plant.link_angles_rad().first() > 0.0);
/// ```
///
/// Time starts at 0 s and changes only in [`advance`](Self::advance). Equal calls must give equal
/// bits; otherwise runs are not repeatable.
pub trait Plant {
    /// Returns the present state of the plant, after the last torque command.
    fn snapshot(&self) -> Snapshot;

    /// Commands joint torques in N·m from now on. The torques follow with a first-order lag of time
    /// constant `lag_s`; if it is zero, at once. A plant without such a lag may ignore it if its
    /// scenarios leave `converters.torque.lag_s` at zero.
    fn command_torque(&mut self, target_nm: JointTorque<f64>, lag_s: f64);

    /// Advances to time `until_s`, and shows every step and every discontinuity to `probe`.
    /// Advancing to the present time decides the contact mode after the last command.
    ///
    /// # Errors
    /// [`PlantError`] if the motion cannot be continued.
    fn advance(&mut self, until_s: f64, probe: &mut dyn Probe) -> Result<(), PlantError>;

    /// Returns the present time, s.
    fn time_s(&self) -> f64 {
        self.snapshot().time_s
    }

    /// Returns the angles of the links, rad, from which the encoders derive those of the joints.
    fn link_angles_rad(&self) -> LinkMotion<f64> {
        self.snapshot().theta_rad
    }

    /// Returns the force of the surface on the tip (f_t, f_n), N, without impulses.
    fn contact_force_n(&self) -> Vector2<f64> {
        let now = self.snapshot();
        Vector2::new(now.tangential_force_n, now.normal_force_n)
    }
}

/// Failure of a plant, with the plant's own error as the reason.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct PlantError(Box<dyn std::error::Error + Send + Sync>);

impl PlantError {
    /// Wraps the error of a particular plant.
    pub fn new(reason: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self(Box::new(reason))
    }
}

/// A plant at one instant. Quantities that a plant does not have may stay at their default, zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Simulated time, s.
    pub time_s: f64,
    /// Angles θ1, θ2 from the belt's inward normal, rad.
    pub theta_rad: LinkMotion<f64>,
    /// Their rates, rad/s.
    pub theta_dot_rad_s: LinkMotion<f64>,
    /// Their accelerations, rad/s².
    pub theta_ddot_rad_s2: LinkMotion<f64>,
    /// Position of the tip along the belt z_t, m.
    pub tip_t_m: f64,
    /// Height of the tip above the belt, m.
    pub gap_m: f64,
    /// Rate of that height, m/s.
    pub gap_rate_m_s: f64,
    /// Velocity of the tip relative to the belt ż_r, m/s.
    pub slip_velocity_m_s: f64,
    /// Velocity of the belt v_belt, m/s.
    pub belt_speed_m_s: f64,
    /// Normal force f_n, N.
    pub normal_force_n: f64,
    /// Tangential force f_t, N.
    pub tangential_force_n: f64,
    /// Free normal acceleration b, m/s².
    pub b_m_s2: f64,
    /// p for the present direction of slip, 1/kg; of a sticking tip, for the slip that friction prevents.
    pub p_per_kg: f64,
    /// Torques u1, u2 that act on the joints, N·m.
    pub torque_nm: JointTorque<f64>,
    /// Contact mode.
    pub mode: ContactMode,
}
