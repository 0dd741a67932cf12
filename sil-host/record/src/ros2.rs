//! A record as a ROS 2 bag: MCAP with messages in CDR, and their definitions in the file.
//!
//! - `/joint_states`: `sensor_msgs/JointState`, the joints as their encoders measure them, of the simulated arm or as
//!   estimated from a real one
//! - `/contact`: `geometry_msgs/WrenchStamped`, the force of the belt on the tip, x along the belt and z away from it
//! - `/plant`, `/sensor`, `/actuator`, `/estimates`: `painleve_msgs/Plant` and so on, every field of a record
//!
//! A bag's times are those of the clock. ROS 2 needs no package of ours to read it: the definitions are in the file.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use mcap::McapError;
use mcap::records::MessageHeader;
use serde_json::{Map, Value};

use crate::export::ExportError;
use crate::fields::{ESTIMATES, PLANT, Read as Kind, TOPICS, Topic};
use crate::mcap_log::reason;
use crate::record_file::{BAG, Damage, Extent, RecordedMessage, messages};

/// Definition of the header of every message, and of the time in it.
const HEADER: &str = "builtin_interfaces/Time stamp\nstring frame_id\n";
const TIME: &str = "int32 sec\nuint32 nanosec\n";
const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
const WRENCH_STAMPED: &str = "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n";
const WRENCH: &str = "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n";
const VECTOR: &str = "float64 x\nfloat64 y\nfloat64 z\n";
/// What separates definitions.
const SEPARATOR: &str =
    "================================================================================\n";

/// Latest time by the clock in a bag, ns since 1970: its seconds have 32 bits.
const LATEST_NS: u64 = i32::MAX as u64 * 1_000_000_000 + 999_999_999;
/// Names of the joints.
const JOINTS: [&str; 2] = ["shoulder", "elbow"];
/// Frame of the force.
const FRAME: &str = "belt";

/// Writes the messages of a record as a bag and returns it with the number of ticks. `start_ns` is the time by the clock at
/// the start, ns since 1970.
///
/// # Errors
/// [`ExportError`] if the record is damaged or empty, has times that a bag cannot hold, or the bag cannot be written.
pub fn to_bag<W: Write + Seek>(
    record: impl Read,
    start_ns: u64,
    output: W,
) -> Result<(W, u64), ExportError> {
    let mut bag = Bag::new(start_ns, output)?;
    messages(record, &mut Extent::default(), |message| {
        bag.take_in(message)
    })?;
    if bag.ticks == 0 {
        return Err(ExportError::NoTicks);
    }
    bag.write_state()?;
    bag.writer.finish()?;
    Ok((bag.writer.into_inner(), bag.ticks))
}

struct Bag<W: Write + Seek> {
    writer: mcap::Writer<W>,
    start_ns: u64,
    /// Channels of the topics, then of the joints and of the contact.
    topics: [u16; TOPICS.len()],
    joints: u16,
    contact: u16,
    /// Time by the clock of the state to be written, and its fields.
    state_ns: u64,
    state: Map<String, Value>,
    /// Time by the clock of the last tick.
    tick_ns: Option<u64>,
    /// Number of ticks.
    ticks: u64,
}

impl<W: Write + Seek> Bag<W> {
    fn new(start_ns: u64, output: W) -> Result<Self, ExportError> {
        let mut writer = mcap::WriteOptions::new()
            .profile(BAG)
            .library(concat!("painleve ", env!("CARGO_PKG_VERSION")))
            .create(output)?;
        let mut channel = |topic: &str, schema: &str, definition: String| {
            let id = writer.add_schema(schema, "ros2msg", definition.as_bytes())?;
            writer.add_channel(id, topic, "cdr", &BTreeMap::new())
        };
        let with = |main: &str, parts: &[(&str, &str)]| {
            let mut text = main.to_owned();
            for (name, part) in [
                ("std_msgs/Header", HEADER),
                ("builtin_interfaces/Time", TIME),
            ]
            .iter()
            .chain(parts)
            {
                text += &format!("{SEPARATOR}MSG: {name}\n{part}");
            }
            text
        };
        let mut topics = [0; TOPICS.len()];
        for (id, topic) in topics.iter_mut().zip(TOPICS) {
            let name = topic.schema.trim_start_matches("painleve.");
            let schema = format!("painleve_msgs/msg/{name}");
            *id = channel(
                &format!("/{}", topic.name),
                &schema,
                with(&definition(topic), &[]),
            )?;
        }
        let wrench = [
            ("geometry_msgs/Wrench", WRENCH),
            ("geometry_msgs/Vector3", VECTOR),
        ];
        let joints = channel(
            "/joint_states",
            "sensor_msgs/msg/JointState",
            with(JOINT_STATE, &[]),
        )?;
        let contact = channel(
            "/contact",
            "geometry_msgs/msg/WrenchStamped",
            with(WRENCH_STAMPED, &wrench),
        )?;
        Ok(Self {
            writer,
            start_ns,
            topics,
            joints,
            contact,
            state_ns: 0,
            state: Map::new(),
            tick_ns: None,
            ticks: 0,
        })
    }

    fn take_in(&mut self, message: RecordedMessage<'_>) -> Result<(), ExportError> {
        let Some(topic) = TOPICS.get(message.topic) else {
            // An event.
            return Ok(());
        };
        let mut fields: Map<String, Value> =
            serde_json::from_slice(message.json).map_err(|source| Damage::Message {
                topic: topic.name,
                source,
            })?;
        let stamp_ns = self
            .start_ns
            .checked_add(message.time_ns)
            .filter(|stamp_ns| *stamp_ns <= LATEST_NS)
            .ok_or(ExportError::Late)?;
        let mut cdr = Cdr::stamped(stamp_ns, "");
        for field in topic.fields {
            let value = fields.get(field.name);
            match field.read {
                Kind::Number(_) | Kind::Single(_) => {
                    cdr.float(value.and_then(Value::as_f64).unwrap_or(f64::NAN))
                }
                Kind::Whole(_) => cdr.integer(value.and_then(Value::as_i64).unwrap_or_default()),
                Kind::Text(_) => cdr.text(value.and_then(Value::as_str).unwrap_or_default()),
                Kind::Truth(_) => cdr.0.push(u8::from(value == Some(&Value::Bool(true)))),
            }
        }
        self.write(self.topics[message.topic], stamp_ns, &cdr.0)?;
        self.ticks += u64::from(self.tick_ns.replace(stamp_ns) != Some(stamp_ns));
        if [PLANT.name, ESTIMATES.name].contains(&topic.name) {
            if stamp_ns != self.state_ns {
                self.write_state()?;
                self.state_ns = stamp_ns;
            }
            // What no sensor of a real arm measures is known as an estimate.
            for field in topic.fields {
                let value = fields.remove(field.name).filter(|value| !value.is_null());
                if let Some(value) = value {
                    self.state.entry(field.name).or_insert(value);
                }
            }
        }
        Ok(())
    }

    /// Writes the joints and the contact, if they are known.
    fn write_state(&mut self) -> Result<(), ExportError> {
        let (stamp_ns, fields) = (self.state_ns, std::mem::take(&mut self.state));
        if !fields.contains_key("theta1_rad") {
            return Ok(());
        }
        let value = |name: &str| fields.get(name).and_then(Value::as_f64).unwrap_or(f64::NAN);
        // The elbow's encoder measures θ2 − θ1.
        let joints = |first: &str, second: &str| [value(first), value(second) - value(first)];
        let mut cdr = Cdr::stamped(stamp_ns, "");
        cdr.count(JOINTS.len());
        JOINTS.into_iter().for_each(|name| cdr.text(name));
        for pair in [
            joints("theta1_rad", "theta2_rad"),
            joints("theta1_dot_rad_s", "theta2_dot_rad_s"),
            [value("u1_nm"), value("u2_nm")],
        ] {
            cdr.count(pair.len());
            pair.into_iter().for_each(|number| cdr.float(number));
        }
        self.write(self.joints, stamp_ns, &cdr.0)?;
        let mut cdr = Cdr::stamped(stamp_ns, FRAME);
        let force_n = [value("tangential_force_n"), 0.0, value("normal_force_n")];
        for number in force_n.into_iter().chain([0.0; 3]) {
            cdr.float(number);
        }
        self.write(self.contact, stamp_ns, &cdr.0)
    }

    fn write(&mut self, channel_id: u16, stamp_ns: u64, cdr: &[u8]) -> Result<(), ExportError> {
        let header = MessageHeader {
            channel_id,
            sequence: 0,
            log_time: stamp_ns,
            publish_time: stamp_ns,
        };
        self.writer.write_to_known_channel(&header, cdr)?;
        Ok(())
    }
}

/// Returns the definition of a topic's messages.
fn definition(topic: &Topic) -> String {
    let mut text = format!("# {}\nstd_msgs/Header header\n", topic.description);
    for field in topic.fields {
        let kind = match field.read {
            Kind::Number(_) | Kind::Single(_) => "float64",
            Kind::Whole(_) => "int64",
            Kind::Text(_) => "string",
            Kind::Truth(_) => "bool",
        };
        text += &format!("# {}\n{kind} {}\n", field.description, field.name);
    }
    text
}

/// A message in CDR, little-endian; alignment counts from behind the first four bytes.
struct Cdr(Vec<u8>);

impl Cdr {
    /// Starts a message with its header.
    fn stamped(stamp_ns: u64, frame: &str) -> Self {
        let mut cdr = Self(vec![0, 1, 0, 0]);
        let (seconds, rest) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
        cdr.0.extend((seconds as i32).to_le_bytes());
        cdr.0.extend((rest as u32).to_le_bytes());
        cdr.text(frame);
        cdr
    }

    fn align(&mut self, to: usize) {
        let length = 4 + (self.0.len() - 4).next_multiple_of(to);
        self.0.resize(length, 0);
    }

    fn count(&mut self, count: usize) {
        self.align(4);
        self.0.extend((count as u32).to_le_bytes());
    }

    fn float(&mut self, value: f64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    fn integer(&mut self, value: i64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    /// Adds a text with its length and a zero at its end.
    fn text(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }
}

impl From<McapError> for ExportError {
    fn from(error: McapError) -> Self {
        Self::Write(reason(error).into())
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;
    use crate::export::ticks_to_csv;
    use crate::mcap_log::tests::of_messages;

    #[test]
    fn the_cause_of_a_failed_write_is_told() {
        let full = io::Cursor::new([0_u8; 16]);
        let error = to_bag(io::empty(), 0, full).map(|_| ()).unwrap_err();
        assert_eq!(error.to_string(), "failed to write whole buffer");
    }

    #[test]
    fn a_bag_is_not_taken_for_a_damaged_record() {
        let record = of_messages("/plant", &[(1, "{}")]);
        let bag = to_bag(&record[..], 0, io::Cursor::new(Vec::new()));
        let bag = bag.unwrap().0.into_inner();
        let expected = "this is a ROS 2 bag: export the record from which it was made";
        let table = ticks_to_csv(&bag[..], io::sink()).unwrap_err();
        assert_eq!(table.to_string(), expected);
        let again = to_bag(&bag[..], 0, io::Cursor::new(Vec::new()));
        assert_eq!(again.map(|_| ()).unwrap_err().to_string(), expected);
    }

    #[test]
    fn ticks_have_distinct_times_up_to_the_last_that_a_bag_can_hold() {
        // Without a topic of every tick.
        let record = of_messages("/plant", &[(1, "{}"), (1, "{}"), (2, "{}")]);
        let to_bag = |start_ns| {
            let bag = to_bag(&record[..], start_ns, io::Cursor::new(Vec::new()));
            bag.map(|(_, ticks)| ticks)
                .map_err(|error| error.to_string())
        };
        assert_eq!(to_bag(LATEST_NS - 2), Ok(2));
        for start_ns in [LATEST_NS - 1, u64::MAX] {
            let error = to_bag(start_ns).unwrap_err();
            assert!(error.contains("later than January 2038"), "{error}");
        }
    }

    #[test]
    fn what_a_real_arms_sensors_do_not_show_is_taken_from_the_estimates() {
        let mut bag = Bag::new(0, io::Cursor::new(Vec::new())).unwrap();
        for (name, json) in [
            (
                PLANT.name,
                r#"{"theta1_rad": 0.1, "theta1_dot_rad_s": null, "unknown": 1}"#,
            ),
            (
                ESTIMATES.name,
                r#"{"theta1_rad": 0.2, "theta1_dot_rad_s": 2.0}"#,
            ),
        ] {
            let topic = TOPICS.iter().position(|topic| topic.name == name).unwrap();
            let message = RecordedMessage {
                topic,
                time_ns: 5,
                json: json.as_bytes(),
            };
            bag.take_in(message).unwrap();
        }
        assert_eq!(bag.state["theta1_rad"], 0.1);
        assert_eq!(bag.state["theta1_dot_rad_s"], 2.0);
        // Others would be held until the time changes, which it need not.
        assert_eq!(bag.state.len(), 2);
    }

    #[test]
    fn a_message_is_aligned_as_cdr_wants_it() {
        let mut cdr = Cdr::stamped(1_500_000_007, "ab");
        cdr.float(1.0);
        cdr.0.push(1);
        cdr.count(3);
        let expected = [
            &[0, 1, 0, 0][..],
            &1_i32.to_le_bytes(),
            &500_000_007_u32.to_le_bytes(),
            &[3, 0, 0, 0, b'a', b'b', 0],
            // From 15 to 16.
            &[0],
            &1.0_f64.to_le_bytes(),
            // From 25 to 28.
            &[1, 0, 0, 0],
            &[3, 0, 0, 0],
        ];
        assert_eq!(cdr.0, expected.concat());
    }

    #[test]
    fn a_definition_has_every_field_with_its_type() {
        let text = definition(&PLANT);
        for line in [
            "std_msgs/Header header",
            "float64 tip_t_m",
            "string mode",
            "int64 mode_number",
        ] {
            assert!(text.lines().any(|one| one == line), "{line}");
        }
    }
}
