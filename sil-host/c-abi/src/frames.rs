//! The frames between plant and controller as C structs. Counts are those of the converters.

use painleve_plant::Snapshot;
use painleve_shared::counts::{EncoderCounts, ForceCounts, Micrometres, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame, StatusFlags};

/// Sensor frame of one tick. docs/interface.md, *Layouts*, has the scale and the sign of each count.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PainleveSensorFrame {
    /// Tick; wraps at 2^32.
    pub tick: u32,
    /// Number of the frame; wraps at 2^32.
    pub sequence: u32,
    /// Encoders of the first joint and of the elbow, counts.
    pub joints: [u32; 2],
    /// Normal force, counts.
    pub normal_force: i32,
    /// Tangential force, counts.
    pub tangential_force: i32,
    /// Digital inputs. Bit 0, ENABLE: a rising edge, or a high level in the first frame, arms the drive; low takes the torque
    /// off. Bit 1, RESET: a rising edge clears a fault. Bits 2 to 5 are a board's: arming refused, stage not ready, gap
    /// against force, winding hot. Leave the others 0.
    pub inputs: u32,
}

/// The controller's answer.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PainleveActuatorFrame {
    /// Tick of the answered sensor frame.
    pub tick: u32,
    /// Number of the answer; wraps at 2^32.
    pub sequence: u32,
    /// Torques of both joints, counts.
    pub torques: [i32; 2],
    /// Reference of the tip along the belt, micrometres.
    pub reference_tip_um: i32,
    /// Estimated position of the tip along the belt, micrometres.
    pub estimated_tip_um: i32,
    /// State: 0 idle, 1 armed, 2 tracking, 3 lift-off, 4 fault. The torque stages are off in idle and fault.
    pub state: u8,
    /// Number of the latched fault; 0 for none.
    pub fault: u8,
    /// Flags. Bits: 0 contact, 1 torque saturated, 2 reference done, 4 reference held at the edge, 5 tip being returned to
    /// the belt, 6 slip is negative, 7 tip sticks.
    pub flags: u16,
}

/// The plant at one instant.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PainleveSnapshot {
    /// Simulated time, s.
    pub time_s: f64,
    /// Angles of the links from the belt's inward normal, rad.
    pub theta_rad: [f64; 2],
    /// Their rates, rad/s.
    pub theta_dot_rad_s: [f64; 2],
    /// Position of the tip along the belt, m.
    pub tip_t_m: f64,
    /// Height of the tip above the belt, m.
    pub gap_m: f64,
    /// Velocity of the tip relative to the belt, m/s.
    pub slip_velocity_m_s: f64,
    /// Velocity of the belt, m/s.
    pub belt_speed_m_s: f64,
    /// Normal force on the tip, N.
    pub normal_force_n: f64,
    /// Tangential force on the tip, N.
    pub tangential_force_n: f64,
    /// Torques that act on the joints, N m.
    pub torque_nm: [f64; 2],
    /// Contact mode: 0 flight, 1 and 2 sliding forwards and backwards, 3 sticking.
    pub contact_mode: u8,
}

impl From<SensorFrame> for PainleveSensorFrame {
    fn from(frame: SensorFrame) -> Self {
        Self {
            tick: frame.tick,
            sequence: frame.sequence,
            joints: frame.joints.map(|counts| counts.0),
            normal_force: frame.normal_force.0,
            tangential_force: frame.tangential_force.0,
            inputs: frame.inputs.0,
        }
    }
}

impl From<PainleveSensorFrame> for SensorFrame {
    fn from(frame: PainleveSensorFrame) -> Self {
        Self {
            tick: frame.tick,
            sequence: frame.sequence,
            joints: frame.joints.map(EncoderCounts),
            normal_force: ForceCounts(frame.normal_force),
            tangential_force: ForceCounts(frame.tangential_force),
            inputs: DigitalInputs(frame.inputs),
        }
    }
}

impl From<ActuatorFrame> for PainleveActuatorFrame {
    fn from(frame: ActuatorFrame) -> Self {
        Self {
            tick: frame.tick,
            sequence: frame.sequence,
            torques: frame.torques.map(|counts| counts.0),
            reference_tip_um: frame.reference_tip.0,
            estimated_tip_um: frame.estimated_tip.0,
            state: frame.state,
            fault: frame.fault,
            flags: frame.flags.0,
        }
    }
}

impl From<PainleveActuatorFrame> for ActuatorFrame {
    fn from(frame: PainleveActuatorFrame) -> Self {
        Self {
            tick: frame.tick,
            sequence: frame.sequence,
            torques: frame.torques.map(TorqueCounts),
            reference_tip: Micrometres(frame.reference_tip_um),
            estimated_tip: Micrometres(frame.estimated_tip_um),
            state: frame.state,
            fault: frame.fault,
            flags: StatusFlags(frame.flags),
        }
    }
}

impl From<Snapshot> for PainleveSnapshot {
    fn from(plant: Snapshot) -> Self {
        Self {
            time_s: plant.time_s,
            theta_rad: plant.theta_rad.to_array(),
            theta_dot_rad_s: plant.theta_dot_rad_s.to_array(),
            tip_t_m: plant.tip_t_m,
            gap_m: plant.gap_m,
            slip_velocity_m_s: plant.slip_velocity_m_s,
            belt_speed_m_s: plant.belt_speed_m_s,
            normal_force_n: plant.normal_force_n,
            tangential_force_n: plant.tangential_force_n,
            torque_nm: plant.torque_nm.to_array(),
            contact_mode: plant.mode as u8,
        }
    }
}
