//! The quantities of a tick, by topic: names, descriptions and where each comes from.
//!
//! One table gives the messages of the MCAP file, their JSON Schemas and the columns of CSV files.

use painleve_plant::sample::Sample;
use painleve_shared::Slip;
use serde_json::{Value, json};

use crate::recorder::RecordedTick;

/// A group of quantities: one topic of the MCAP file.
#[derive(Debug)]
pub struct Topic {
    /// The topic's name without its slash.
    pub name: &'static str,
    /// Name of the schema.
    pub schema: &'static str,
    /// Description of the topic.
    pub description: &'static str,
    /// Its quantities.
    pub fields: &'static [RecordField],
    /// Whether the topic needs [`RecordedTick::estimates`].
    pub needs_estimates: bool,
}

/// One quantity.
#[derive(Debug)]
pub struct RecordField {
    /// The name, with its unit.
    pub name: &'static str,
    /// Description, with the unit.
    pub description: &'static str,
    /// Reads it from a tick.
    pub read: Read,
}

/// How a quantity is read, by its type.
#[derive(Clone, Copy, Debug)]
pub enum Read {
    /// A number; left out where it is not finite.
    Number(fn(&RecordedTick<'_>) -> f64),
    /// A number of the controller; left out where it is not finite.
    Single(fn(&RecordedTick<'_>) -> f32),
    /// A whole number.
    Whole(fn(&RecordedTick<'_>) -> i64),
    /// A name.
    Text(fn(&RecordedTick<'_>) -> &'static str),
    /// True or false.
    Truth(fn(&RecordedTick<'_>) -> bool),
}

const fn number(
    name: &'static str,
    description: &'static str,
    read: fn(&RecordedTick<'_>) -> f64,
) -> RecordField {
    let read = Read::Number(read);
    RecordField {
        name,
        description,
        read,
    }
}

const fn whole(
    name: &'static str,
    description: &'static str,
    read: fn(&RecordedTick<'_>) -> i64,
) -> RecordField {
    let read = Read::Whole(read);
    RecordField {
        name,
        description,
        read,
    }
}

const fn text(
    name: &'static str,
    description: &'static str,
    read: fn(&RecordedTick<'_>) -> &'static str,
) -> RecordField {
    let read = Read::Text(read);
    RecordField {
        name,
        description,
        read,
    }
}

/// A field of the controller's telemetry; not finite without telemetry.
macro_rules! estimate {
    ($name:literal, $description:literal, Single, $read:expr) => {
        RecordField {
            name: $name,
            description: $description,
            read: Read::Single(|tick| tick.estimates.map_or(f32::NAN, $read)),
        }
    };
    ($name:literal, $description:literal, $kind:ident, $read:expr) => {
        RecordField {
            name: $name,
            description: $description,
            read: Read::$kind(|tick| tick.estimates.map_or_else(Default::default, $read)),
        }
    };
}

/// The topics with one message per control tick.
pub const TOPICS: [&Topic; 4] = [&PLANT, &SENSOR, &ACTUATOR, &ESTIMATES];

/// State, contact and torques of the simulated arm.
pub const PLANT: Topic = Topic {
    name: "plant",
    schema: "painleve.Plant",
    description: "State, contact and torques of the simulated arm.",
    needs_estimates: false,
    fields: &[
        number(
            "theta1_rad",
            "Angle of the first link from the belt's inward normal, rad.",
            |tick| tick.sample.plant.theta_rad[0],
        ),
        number(
            "theta2_rad",
            "Angle of the second link from the belt's inward normal, rad.",
            |tick| tick.sample.plant.theta_rad[1],
        ),
        number(
            "theta1_dot_rad_s",
            "Rate of the first angle, rad/s.",
            |tick| tick.sample.plant.theta_dot_rad_s[0],
        ),
        number(
            "theta2_dot_rad_s",
            "Rate of the second angle, rad/s.",
            |tick| tick.sample.plant.theta_dot_rad_s[1],
        ),
        number(
            "tip_t_m",
            "Position of the tip along the belt z_t, m.",
            |tick| tick.sample.plant.tip_t_m,
        ),
        number(
            "reference_tip_t_m",
            "Reference z_t* that the controller follows, m; absent while it follows none.",
            |tick| tick.sample.reference_tip_t_m,
        ),
        number("gap_m", "Height of the tip over the belt, m.", |tick| {
            tick.sample.plant.gap_m
        }),
        number(
            "slip_velocity_m_s",
            "Velocity of the tip relative to the belt, m/s.",
            |tick| tick.sample.plant.slip_velocity_m_s,
        ),
        number("belt_speed_m_s", "Velocity of the belt, m/s.", |tick| {
            tick.sample.plant.belt_speed_m_s
        }),
        number("normal_force_n", "Normal force f_n, N.", |tick| {
            tick.sample.plant.normal_force_n
        }),
        number("tangential_force_n", "Tangential force f_t, N.", |tick| {
            tick.sample.plant.tangential_force_n
        }),
        number("b_m_s2", "Free normal acceleration b, m/s².", |tick| {
            tick.sample.plant.b_m_s2
        }),
        number(
            "p_per_kg",
            "Contact coefficient p for the present direction of slip, 1/kg.",
            |tick| tick.sample.plant.p_per_kg,
        ),
        number("u1_nm", "Torque on the first joint, N·m.", |tick| {
            tick.sample.plant.torque_nm[0]
        }),
        number("u2_nm", "Torque on the second joint, N·m.", |tick| {
            tick.sample.plant.torque_nm[1]
        }),
        text(
            "mode",
            "Contact mode of the tip: flight, slide-positive, slide-negative or stick.",
            |tick| tick.sample.plant.mode.name(),
        ),
        whole(
            "mode_number",
            "Contact mode as a number: 0 flight, 1 slide-positive, 2 slide-negative, 3 stick.",
            |tick| tick.sample.plant.mode as i64,
        ),
    ],
};

/// The frame that the controller received.
pub const SENSOR: Topic = Topic {
    name: "sensor",
    schema: "painleve.Sensor",
    description: "The sensor frame, raw counts.",
    needs_estimates: false,
    fields: &[
        whole("tick", "Control tick of the sample; wraps.", |tick| {
            tick.sample.sensor.tick.into()
        }),
        whole("sequence", "Sequence number of the frame; wraps.", |tick| {
            tick.sample.sensor.sequence.into()
        }),
        whole(
            "joint1_counts",
            "Encoder of the first joint, θ1, counts.",
            |tick| tick.sample.sensor.joints[0].0.into(),
        ),
        whole(
            "joint2_counts",
            "Encoder in the elbow, θ2 − θ1, counts.",
            |tick| tick.sample.sensor.joints[1].0.into(),
        ),
        whole("normal_force_counts", "Normal force, counts.", |tick| {
            tick.sample.sensor.normal_force.0.into()
        }),
        whole(
            "tangential_force_counts",
            "Tangential force, counts.",
            |tick| tick.sample.sensor.tangential_force.0.into(),
        ),
        whole(
            "inputs",
            "Digital inputs, one bit each: 1 enable, 2 reset.",
            |tick| tick.sample.sensor.inputs.0.into(),
        ),
        RecordField {
            name: "delivered",
            description: "Whether the controller received the frame.",
            read: Read::Truth(|tick| tick.sample.delivered),
        },
    ],
};

/// The controller's answer.
pub const ACTUATOR: Topic = Topic {
    name: "actuator",
    schema: "painleve.Actuator",
    description: "The actuator frame, raw counts, with state and fault by name.",
    needs_estimates: false,
    fields: &[
        whole(
            "tick",
            "Tick of the sensor frame that this frame answers.",
            |tick| tick.sample.actuator.tick.into(),
        ),
        whole("sequence", "Sequence number of the frame; wraps.", |tick| {
            tick.sample.actuator.sequence.into()
        }),
        whole("u1_counts", "Torque on the first joint, counts.", |tick| {
            tick.sample.actuator.torques[0].0.into()
        }),
        whole("u2_counts", "Torque on the second joint, counts.", |tick| {
            tick.sample.actuator.torques[1].0.into()
        }),
        whole(
            "reference_tip_um",
            "Reference z_t* of this tick, µm.",
            |tick| tick.sample.actuator.reference_tip.0.into(),
        ),
        whole(
            "estimated_tip_um",
            "Tip position as the controller estimates it, µm.",
            |tick| tick.sample.actuator.estimated_tip.0.into(),
        ),
        text("state", "The supervisor's state.", |tick| {
            state_name(tick.sample)
        }),
        whole(
            "state_number",
            "Number of the supervisor's state.",
            |tick| tick.sample.actuator.state.into(),
        ),
        text("fault", "The latched fault, or \"none\".", |tick| {
            fault_name(tick.sample)
        }),
        whole(
            "fault_number",
            "Number of the latched fault, 0 for none.",
            |tick| tick.sample.actuator.fault.into(),
        ),
        whole(
            "flags",
            "Flags, one bit each: 1 contact, 2 torque saturated, 4 reference done, 8 guarded, \
             16 at edge, 32 recovering, 64 slip negative, 128 sticks.",
            |tick| tick.sample.actuator.flags.0.into(),
        ),
        RecordField {
            name: "answered",
            description: "Whether this frame answers this tick; otherwise it is the last answer.",
            read: Read::Truth(|tick| tick.sample.answered),
        },
    ],
};

/// The controller's internal state.
pub const ESTIMATES: Topic = Topic {
    name: "estimates",
    schema: "painleve.Estimates",
    description: "The controller's estimates and decisions, recomputed from the frames.",
    needs_estimates: true,
    fields: &[
        estimate!("theta1_rad", "Estimated angle θ1, rad.", Single, |now| now
            .theta_rad[0]),
        estimate!("theta2_rad", "Estimated angle θ2, rad.", Single, |now| now
            .theta_rad[1]),
        estimate!(
            "theta1_dot_rad_s",
            "Estimated rate of θ1, rad/s.",
            Single,
            |now| now.theta_dot_rad_s[0]
        ),
        estimate!(
            "theta2_dot_rad_s",
            "Estimated rate of θ2, rad/s.",
            Single,
            |now| now.theta_dot_rad_s[1]
        ),
        estimate!(
            "tip_t_m",
            "Estimated position of the tip along the belt, m.",
            Single,
            |now| now.tip_t_m
        ),
        estimate!(
            "reference_m",
            "Reference after the edge governor, m.",
            Single,
            |now| now.reference_m
        ),
        estimate!(
            "normal_force_n",
            "Measured normal force, N.",
            Single,
            |now| now.normal_force_n
        ),
        estimate!(
            "tangential_force_n",
            "Measured tangential force, N.",
            Single,
            |now| now.tangential_force_n
        ),
        estimate!(
            "u1_nm",
            "Torque on the first joint as output, N·m.",
            Single,
            |now| now.torque_nm[0]
        ),
        estimate!(
            "u2_nm",
            "Torque on the second joint as output, N·m.",
            Single,
            |now| now.torque_nm[1]
        ),
        estimate!(
            "contact",
            "The contact decision: the tip touches the belt.",
            Truth,
            |now| now.contact
        ),
        estimate!(
            "contact_confidence",
            "Certainty of the contact decision, 0 to 1.",
            Single,
            |now| now.contact_confidence
        ),
        estimate!(
            "friction",
            "Estimated friction coefficient μ.",
            Single,
            |now| now.friction
        ),
        estimate!(
            "friction_deviation",
            "Standard deviation of the estimate of μ.",
            Single,
            |now| now.friction_deviation
        ),
        estimate!(
            "slip_sign",
            "Estimated direction of slip: 1 positive, -1 negative.",
            Whole,
            |now| match now.slip {
                Slip::Positive => 1,
                Slip::Negative => -1,
            }
        ),
        estimate!(
            "sticks",
            "Whether the tip is estimated to stick to the belt.",
            Truth,
            |now| now.sticks
        ),
        estimate!(
            "lower_edge_m",
            "Lower edge of the admissible stretch of the belt, m; absent if there is none.",
            Single,
            |now| now.edges_m[0]
        ),
        estimate!(
            "upper_edge_m",
            "Upper edge of the admissible stretch of the belt, m; absent if there is none.",
            Single,
            |now| now.edges_m[1]
        ),
        estimate!(
            "at_edge",
            "Whether an edge holds the reference back.",
            Truth,
            |now| now.at_edge
        ),
        estimate!(
            "recovering",
            "Whether the tip is being returned to the belt.",
            Truth,
            |now| now.recovering
        ),
        estimate!(
            "guarded",
            "Whether the contact guard changed the torque.",
            Truth,
            |now| now.guarded
        ),
        estimate!(
            "saturated",
            "Whether the torque was limited.",
            Truth,
            |now| now.saturated
        ),
        estimate!(
            "guarded_ticks",
            "Number of ticks since the start in which the contact guard acted; wraps.",
            Whole,
            |now| now.guarded_ticks.into()
        ),
        estimate!(
            "saturated_ticks",
            "Number of ticks since the start with limited torque; wraps.",
            Whole,
            |now| now.saturated_ticks.into()
        ),
    ],
};

const UNKNOWN: &str = "unknown";

fn state_name(sample: &Sample) -> &'static str {
    let state = sample.actuator.supervisor_state();
    state.map_or(UNKNOWN, |state| state.name())
}

fn fault_name(sample: &Sample) -> &'static str {
    match (sample.actuator.fault, sample.actuator.latched_fault()) {
        (0, _) => "none",
        (_, Some(fault)) => fault.description(),
        (_, None) => UNKNOWN,
    }
}

impl Topic {
    /// Returns the JSON Schema (draft 7) of the topic's messages. Types are plain, because
    /// Foxglove's reader does not support unions: a number that is not finite is left out of the
    /// message, and therefore not required.
    pub fn json_schema(&self) -> Value {
        let properties: serde_json::Map<String, Value> = self
            .fields
            .iter()
            .map(|field| {
                let kind = match field.read {
                    Read::Number(_) | Read::Single(_) => "number",
                    Read::Whole(_) => "integer",
                    Read::Text(_) => "string",
                    Read::Truth(_) => "boolean",
                };
                let property = json!({ "type": kind, "description": field.description });
                (field.name.to_owned(), property)
            })
            .collect();
        let required: Vec<&str> = self
            .fields
            .iter()
            .filter(|field| !matches!(field.read, Read::Number(_) | Read::Single(_)))
            .map(|field| field.name)
            .collect();
        json!({
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": self.schema,
            "description": self.description,
            "type": "object",
            "properties": properties,
            "required": required,
        })
    }
}
