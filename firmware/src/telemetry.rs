//! What went on inside the controller at its last tick, in SI units.

use painleve_shared::Slip;
use painleve_shared::status::{Fault, SupervisorState};

use crate::drive::torque::LastCommand;
use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::refer::Target;
use crate::supervise::supervisor::Supervision;

/// A snapshot for logs and displays. The controller writes it and has no means to read it: it
/// has a [`TelemetrySink`] only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Tick of the last sensor frame.
    pub tick: u32,
    /// Supervisor state.
    pub state: SupervisorState,
    /// Latched fault.
    pub fault: Option<Fault>,
    /// Estimated joint angles θ1, θ2, rad.
    pub theta_rad: [f32; 2],
    /// Estimated joint rates, rad/s.
    pub theta_dot_rad_s: [f32; 2],
    /// Estimated tip position z_t, m.
    pub tip_t_m: f32,
    /// Reference z_t*, m.
    pub reference_m: f32,
    /// Measured normal force, N.
    pub normal_force_n: f32,
    /// Measured tangential force, N.
    pub tangential_force_n: f32,
    /// Joint torques u1, u2 as given, rounded to counts, N·m.
    pub torque_nm: [f32; 2],
    /// Whether the tip is taken to touch.
    pub contact: bool,
    /// How sure that is, 0 … 1.
    pub contact_confidence: f32,
    /// Estimated friction coefficient.
    pub friction: f32,
    /// Its standard deviation.
    pub friction_deviation: f32,
    /// Direction of slip.
    pub slip: Slip,
    /// Whether the tip seems to move with the belt.
    pub sticks: bool,
    /// Edges of the admissible stretch of the belt, m.
    pub edges_m: [f32; 2],
    /// Whether an edge holds the reference back.
    pub at_edge: bool,
    /// Whether the tip is being brought back onto the belt.
    pub recovering: bool,
    /// Whether the contact guard changed the torque.
    pub guarded: bool,
    /// Whether the torque was limited.
    pub saturated: bool,
    /// Ticks on which the contact guard acted since the start.
    pub guarded_ticks: u32,
    /// Ticks with limited torque since the start.
    pub saturated_ticks: u32,
}

/// What the stages of one tick have found and decided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick<'a> {
    pub(crate) model: &'a Model,
    pub(crate) contact: &'a ContactEstimate,
    pub(crate) target: &'a Target,
    pub(crate) command: &'a LastCommand,
    pub(crate) recovering: bool,
}

/// Where the controller writes its telemetry, if anybody wants it.
pub(crate) struct TelemetrySink<'a>(Option<&'a mut Telemetry>);

impl<'a> TelemetrySink<'a> {
    /// Nobody wants it.
    pub(crate) fn nowhere() -> Self {
        Self(None)
    }

    /// For whoever has this.
    pub(crate) fn to(telemetry: &'a mut Telemetry) -> Self {
        Self(Some(telemetry))
    }

    /// Writes down a tick.
    #[inline]
    pub(crate) fn record(self, of: &Tick<'_>, tick: u32, supervision: &Supervision) {
        let Some(telemetry) = self.0 else {
            return;
        };
        let Tick {
            model,
            contact,
            target,
            command,
            recovering,
        } = of;
        let count = |total: u32, happened: bool| total.wrapping_add(u32::from(happened));
        *telemetry = Telemetry {
            tick,
            state: supervision.state(),
            fault: supervision.fault(),
            theta_rad: model.theta_rad.into(),
            theta_dot_rad_s: model.theta_dot_rad_s.into(),
            tip_t_m: model.tip_m.x,
            reference_m: target.reference.position_m,
            normal_force_n: contact.force_n.y,
            tangential_force_n: contact.force_n.x,
            torque_nm: command.torque_nm.into(),
            contact: contact.touches,
            contact_confidence: contact.confidence,
            friction: contact.friction.coefficient,
            friction_deviation: contact.friction.deviation,
            slip: contact.friction.slip,
            sticks: contact.friction.sticks,
            edges_m: target.edges_m.into(),
            at_edge: target.at_edge,
            recovering: *recovering,
            guarded: command.guarded,
            saturated: command.saturated,
            guarded_ticks: count(telemetry.guarded_ticks, command.guarded),
            saturated_ticks: count(telemetry.saturated_ticks, command.saturated),
        };
    }

    /// Writes down that the torque has been taken off without a tick.
    pub(crate) fn stop(self, supervision: &Supervision) {
        if let Some(telemetry) = self.0 {
            *telemetry = Telemetry {
                state: supervision.state(),
                fault: supervision.fault(),
                torque_nm: [0.0; 2],
                at_edge: false,
                recovering: false,
                guarded: false,
                saturated: false,
                ..*telemetry
            };
        }
    }
}
