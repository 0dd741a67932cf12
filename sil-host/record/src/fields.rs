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

/// Lists the quantities of a topic as `name: kind = value;`, each under its description. The values
/// are read from the tick's sample or from its estimates; without estimates a number is NaN.
macro_rules! fields {
    (@unknown Single) => { f32::NAN };
    (@unknown $kind:ident) => { Default::default() };
    (@list $($name:ident [$($description:literal)+] $read:expr)*) => {
        &[$(RecordField {
            name: stringify!($name),
            description: concat!($($description),+).trim_ascii(),
            read: $read,
        }),*]
    };
    (|$sample:ident|
        $($(#[doc = $description:literal])+ $name:ident: $kind:ident = $value:expr;)*
    ) => {
        fields!(@list $($name [$($description)+] Read::$kind(|tick| {
            let $sample = tick.sample;
            $value
        }))*)
    };
    (estimates |$now:ident|
        $($(#[doc = $description:literal])+ $name:ident: $kind:ident = $value:expr;)*
    ) => {
        fields!(@list $($name [$($description)+] Read::$kind(|tick| {
            tick.estimates.map_or(fields!(@unknown $kind), |$now| $value)
        }))*)
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
    fields: fields! { |sample|
        /// Angle of the first link from the belt's inward normal, rad.
        theta1_rad: Number = sample.plant.theta_rad.first();
        /// Angle of the second link from the belt's inward normal, rad.
        theta2_rad: Number = sample.plant.theta_rad.second();
        /// Rate of the first angle, rad/s.
        theta1_dot_rad_s: Number = sample.plant.theta_dot_rad_s.first();
        /// Rate of the second angle, rad/s.
        theta2_dot_rad_s: Number = sample.plant.theta_dot_rad_s.second();
        /// Position of the tip along the belt z_t, m.
        tip_t_m: Number = sample.plant.tip_t_m;
        /// Reference z_t* that the controller follows, m; absent while it follows none.
        reference_tip_t_m: Number = sample.reference_tip_t_m;
        /// Height of the tip over the belt, m.
        gap_m: Number = sample.plant.gap_m;
        /// Velocity of the tip relative to the belt, m/s.
        slip_velocity_m_s: Number = sample.plant.slip_velocity_m_s;
        /// Velocity of the belt, m/s.
        belt_speed_m_s: Number = sample.plant.belt_speed_m_s;
        /// Normal force f_n, N.
        normal_force_n: Number = sample.plant.normal_force_n;
        /// Tangential force f_t, N.
        tangential_force_n: Number = sample.plant.tangential_force_n;
        /// Free normal acceleration b, m/s².
        b_m_s2: Number = sample.plant.b_m_s2;
        /// Contact coefficient p for the present direction of slip, 1/kg.
        p_per_kg: Number = sample.plant.p_per_kg;
        /// Torque on the first joint, N·m.
        u1_nm: Number = sample.plant.torque_nm.first();
        /// Torque on the second joint, N·m.
        u2_nm: Number = sample.plant.torque_nm.second();
        /// Contact mode of the tip: flight, slide-positive, slide-negative or stick.
        mode: Text = sample.plant.mode.name();
        /// Contact mode as a number: 0 flight, 1 slide-positive, 2 slide-negative, 3 stick.
        mode_number: Whole = sample.plant.mode as i64;
    },
};

/// The frame that the controller received.
pub const SENSOR: Topic = Topic {
    name: "sensor",
    schema: "painleve.Sensor",
    description: "The sensor frame, raw counts.",
    needs_estimates: false,
    fields: fields! { |sample|
        /// Control tick of the sample; wraps.
        tick: Whole = sample.sensor.tick.into();
        /// Sequence number of the frame; wraps.
        sequence: Whole = sample.sensor.sequence.into();
        /// Encoder of the first joint, θ1, counts.
        joint1_counts: Whole = sample.sensor.joints[0].0.into();
        /// Encoder in the elbow, θ2 − θ1, counts.
        joint2_counts: Whole = sample.sensor.joints[1].0.into();
        /// Normal force, counts.
        normal_force_counts: Whole = sample.sensor.normal_force.0.into();
        /// Tangential force, counts.
        tangential_force_counts: Whole = sample.sensor.tangential_force.0.into();
        /// Digital inputs, one bit each: 1 enable, 2 reset, 4 arming refused, 8 stage not ready,
        /// 16 gap against force, 32 winding hot, 2147483648 overload.
        inputs: Whole = sample.sensor.inputs.0.into();
        /// Whether the controller received the frame.
        delivered: Truth = sample.delivered;
    },
};

/// The controller's answer.
pub const ACTUATOR: Topic = Topic {
    name: "actuator",
    schema: "painleve.Actuator",
    description: "The actuator frame, raw counts, with state and fault by name.",
    needs_estimates: false,
    fields: fields! { |sample|
        /// Tick of the sensor frame that this frame answers.
        tick: Whole = sample.actuator.tick.into();
        /// Sequence number of the frame; wraps.
        sequence: Whole = sample.actuator.sequence.into();
        /// Torque on the first joint, counts.
        u1_counts: Whole = sample.actuator.torques[0].0.into();
        /// Torque on the second joint, counts.
        u2_counts: Whole = sample.actuator.torques[1].0.into();
        /// Reference z_t* of this tick, µm.
        reference_tip_um: Whole = sample.actuator.reference_tip.0.into();
        /// Tip position as the controller estimates it, µm.
        estimated_tip_um: Whole = sample.actuator.estimated_tip.0.into();
        /// The supervisor's state.
        state: Text = state_name(sample);
        /// Number of the supervisor's state.
        state_number: Whole = sample.actuator.state.into();
        /// The latched fault, or "none".
        fault: Text = fault_name(sample);
        /// Number of the latched fault, 0 for none.
        fault_number: Whole = sample.actuator.fault.into();
        /// Flags, one bit each: 1 contact, 2 torque saturated, 4 reference done, 16 at edge,
        /// 32 recovering, 64 slip negative, 128 sticks.
        flags: Whole = sample.actuator.flags.0.into();
        /// Whether this frame answers this tick; otherwise it is the last answer.
        answered: Truth = sample.answered;
    },
};

/// The controller's internal state.
pub const ESTIMATES: Topic = Topic {
    name: "estimates",
    schema: "painleve.Estimates",
    description: "The controller's estimates and decisions, recomputed from the frames.",
    needs_estimates: true,
    fields: fields! { estimates |now|
        /// Estimated angle θ1, rad.
        theta1_rad: Single = now.theta_rad.first();
        /// Estimated angle θ2, rad.
        theta2_rad: Single = now.theta_rad.second();
        /// Estimated rate of θ1, rad/s.
        theta1_dot_rad_s: Single = now.theta_dot_rad_s.first();
        /// Estimated rate of θ2, rad/s.
        theta2_dot_rad_s: Single = now.theta_dot_rad_s.second();
        /// Estimated position of the tip along the belt, m.
        tip_t_m: Single = now.tip_t_m;
        /// Reference after the edge governor, m.
        reference_m: Single = now.reference_m;
        /// Reference that the program requests, before the edge governor, m.
        requested_m: Single = now.requested_m;
        /// Measured normal force, N.
        normal_force_n: Single = now.normal_force_n;
        /// Measured tangential force, N.
        tangential_force_n: Single = now.tangential_force_n;
        /// Torque on the first joint as output, N·m.
        u1_nm: Single = now.torque_nm.first();
        /// Torque on the second joint as output, N·m.
        u2_nm: Single = now.torque_nm.second();
        /// The contact decision: the tip touches the belt.
        contact: Truth = now.contact;
        /// Certainty of the contact decision, 0 to 1.
        contact_confidence: Single = now.contact_confidence;
        /// Estimated friction coefficient μ.
        friction: Single = now.friction;
        /// Standard deviation of the estimate of μ.
        friction_deviation: Single = now.friction_deviation;
        /// Estimated direction of slip: 1 positive, -1 negative.
        slip_sign: Whole = match now.slip {
            Slip::Positive => 1,
            Slip::Negative => -1,
        };
        /// Whether the tip is estimated to stick to the belt.
        sticks: Truth = now.sticks;
        /// Lower edge of the admissible stretch of the belt, m; absent if there is none.
        lower_edge_m: Single = now.edges_m[0];
        /// Upper edge of the admissible stretch of the belt, m; absent if there is none.
        upper_edge_m: Single = now.edges_m[1];
        /// Whether an edge holds the reference back.
        at_edge: Truth = now.at_edge;
        /// Whether the tip is being returned to the belt.
        recovering: Truth = now.recovering;
        /// Whether the torque was limited.
        saturated: Truth = now.saturated;
        /// Number of ticks since the start with limited torque; wraps.
        saturated_ticks: Whole = now.saturated_ticks.into();
    },
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
