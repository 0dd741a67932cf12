//! Random numbers, frames and valid settings.

use painleve_plant::Controller;
use painleve_plant::scenario::Scenario;
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::{DigitalInputs, SensorFrame};
use painleve_shared::settings::{Field, Range, Settings, Shape, Variant};
use toml::{Table, Value};

/// SplitMix64 (Steele, Lea, Flood 2014), a simple random number generator.
pub struct Random(pub u64);

impl Random {
    /// Returns 64 random bits.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a whole number, 0 … `limit` − 1.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    /// Returns a number, 0 … 1.
    fn fraction(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns a frame with one to three disturbed fields.
pub fn mutated(frame: &SensorFrame, random: &mut Random) -> SensorFrame {
    let mut frame = *frame;
    for _ in 0..1 + random.below(3) {
        let value = random.next();
        let small = value as i32 % 64;
        match random.below(9) {
            0 => {
                frame.joints[0] =
                    EncoderCounts(frame.joints[0].0.wrapping_add_signed(small) & 0x3fff)
            }
            1 => {
                frame.joints[1] =
                    EncoderCounts(frame.joints[1].0.wrapping_add_signed(small) & 0x3fff)
            }
            2 => frame.joints[(value & 1) as usize] = EncoderCounts(random.next() as u32 & 0x3fff),
            3 => frame.normal_force = ForceCounts(frame.normal_force.0 + small),
            4 => frame.tangential_force = ForceCounts(frame.tangential_force.0 + small),
            5 => frame.normal_force = ForceCounts(random.next() as i32 % 4096),
            6 => frame.tangential_force = ForceCounts(random.next() as i32 % 4096),
            7 => frame.inputs = DigitalInputs(value as u32 & 3),
            _ => frame.sequence = frame.sequence.wrapping_add(random.below(4) as u32),
        }
    }
    frame
}

/// Returns a scenario with random settings of the controller and their overrides; all are valid.
pub fn with_random_settings(mut scenario: Scenario, random: &mut Random) -> (Scenario, String) {
    let controller = Scenario::FIELDS
        .iter()
        .find(|field| field.key == "controller")
        .unwrap_or_else(|| unreachable!("a scenario has a controller"));
    let mut kept = String::new();
    for (key, value) in changes("controller", &controller.shape, controller.range, random) {
        let change = format!("{key}={value}");
        // Some values are valid only together with others; those that do not fit are left out.
        let changed = scenario
            .clone()
            .with_overrides("random settings", std::slice::from_ref(&change));
        if let Ok(changed) = changed
            && Controller::new(&changed.controller_configuration()).is_ok()
        {
            scenario = changed;
            kept += &format!(" --set '{change}'");
        }
    }
    (scenario, kept)
}

/// Returns random changes of about a third of the settings in a group.
fn changes(
    key: &str,
    shape: &Shape,
    range: Option<Range>,
    random: &mut Random,
) -> Vec<(String, Value)> {
    if let Shape::Group(fields) = shape.resolved() {
        let nested = fields.iter().flat_map(|field| {
            let key = format!("{key}.{}", field.key);
            changes(&key, &field.shape, field.range, random)
        });
        return nested.collect();
    }
    if random.below(3) > 0 {
        return Vec::new();
    }
    let value = value(shape, range, random);
    value.map(|value| (key.into(), value)).into_iter().collect()
}

/// Returns a random value of a shape; `None` for an absent one.
fn value(shape: &Shape, range: Option<Range>, random: &mut Random) -> Option<Value> {
    Some(match shape.resolved() {
        Shape::Switch => Value::Boolean(random.below(2) == 0),
        Shape::Text | Shape::AtRunTime(_) => return None,
        Shape::Integer(_) => Value::Integer(number(range?, random) as i64),
        Shape::Number(_) => Value::Float(number(range?, random)),
        Shape::Group(fields) => Value::Table(table(fields, random)),
        Shape::Choice { tag, variants } => choice(tag, variants, random)?,
        Shape::Optional(inner) => value(inner, range, random)?,
        Shape::Array { item, length } => Value::Array(
            (0..length)
                .filter_map(|_| value(item, range, random))
                .collect(),
        ),
        Shape::List {
            item,
            maximum_length,
        } => {
            let length = 1 + random.below(maximum_length as u64);
            Value::Array(
                (0..length)
                    .filter_map(|_| value(item, range, random))
                    .collect(),
            )
        }
    })
}

fn table(fields: &[Field], random: &mut Random) -> Table {
    fields
        .iter()
        .filter_map(|field| {
            // A reference is within reach more often than not.
            let range = match field.key {
                "target_m" => Some(Range {
                    minimum: -0.19,
                    maximum: 0.19,
                }),
                "duration_s" => Some(Range {
                    minimum: 0.0,
                    maximum: 0.3,
                }),
                _ => field.range,
            };
            Some((field.key.into(), value(&field.shape, range, random)?))
        })
        .collect()
}

fn choice(tag: Option<&str>, variants: &[Variant], random: &mut Random) -> Option<Value> {
    let variant = &variants[random.below(variants.len() as u64) as usize];
    let name = Value::String(variant.key.into());
    let content = match &variant.content {
        Some(content) => value(content, None, random),
        None => None,
    };
    Some(match (tag, content) {
        (Some(tag), Some(Value::Table(mut content))) => {
            content.insert(tag.into(), name);
            Value::Table(content)
        }
        (Some(tag), _) => Value::Table(Table::from_iter([(tag.into(), name)])),
        (None, Some(content)) => {
            Value::Table(Table::from_iter([(variant.key.to_owned(), content)]))
        }
        (None, None) => name,
    })
}

/// Returns one of the ends of a range, or a number in between; every decade is as likely.
fn number(range: Range, random: &mut Random) -> f64 {
    match random.below(8) {
        0 => range.minimum,
        1 => range.maximum,
        _ => {
            let smallest = range.minimum.max(1e-6 * range.maximum.max(1e-6));
            let ratio: f64 = range.maximum / smallest;
            let positive = smallest * ratio.powf(random.fraction());
            if range.minimum < 0.0 && random.below(2) == 0 {
                (-positive).max(range.minimum)
            } else {
                positive
            }
        }
    }
}
