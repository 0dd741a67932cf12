//! A scenario as a TOML file in which every key is explained.

use painleve_shared::settings::{Field, Settings, Shape, Variant};
use toml::{Table, Value};

use super::{allowed, group, resolved, table};
use crate::scenario::Scenario;

/// Longest line of a comment, in characters.
const WIDTH: usize = 100;

impl Scenario {
    /// Returns the scenario as TOML with the meaning, allowed range and unit of every key in
    /// comments. Reading the text gives the same scenario.
    pub fn to_commented_toml(&self) -> String {
        let mut text = String::new();
        write_group(&mut text, "", &table(self), Self::FIELDS);
        text
    }
}

fn write_group(text: &mut String, path: &str, values: &Table, fields: &[Field]) {
    let fields: Vec<Field> = fields.iter().map(resolved).collect();
    // Keys of a table precede the tables inside it.
    let is_table = |field: &&Field| matches!(values.get(field.key), Some(Value::Table(_)));
    for field in fields.iter().filter(|field| !is_table(field)) {
        let value = values.get(field.key);
        if value.is_none() && group(&field.shape).is_some() {
            comment(
                text,
                &format!("[{path}{}] is absent: {}", field.key, field.meaning),
            );
            continue;
        }
        comment(text, &with_range(field));
        match value {
            Some(value) => line(text, &format!("{} = {value}", field.key)),
            None => line(text, &format!("# {} =", field.key)),
        }
    }
    for field in fields.iter().filter(is_table) {
        if let Some(Value::Table(values)) = values.get(field.key) {
            line(text, "");
            let path = format!("{path}{}", field.key);
            write_table(text, &path, values, field);
        }
    }
}

fn write_table(text: &mut String, path: &str, values: &Table, field: &Field) {
    if let Some(fields) = group(&field.shape) {
        comment(text, field.meaning);
        line(text, &format!("[{path}]"));
        write_group(text, &format!("{path}."), values, fields);
        return;
    }
    let Shape::Choice { tag, variants } = field.shape else {
        return;
    };
    comment(text, &with_range(field));
    let named = |name: &str| variants.iter().find(|variant| variant.key == name);
    if let Some(tag) = tag {
        line(text, &format!("[{path}]"));
        if let Some(name) = values.get(tag).and_then(Value::as_str)
            && let Some(variant) = named(name)
        {
            comment(text, variant.meaning);
            line(text, &format!("{tag} = \"{name}\""));
            write_group(text, &format!("{path}."), values, settings_of(variant));
        }
    } else if let Some((name, Value::Table(values))) = values.iter().next()
        && let Some(variant) = named(name)
    {
        comment(text, variant.meaning);
        line(text, &format!("[{path}.{name}]"));
        write_group(
            text,
            &format!("{path}.{name}."),
            values,
            settings_of(variant),
        );
    }
}

fn settings_of(variant: &Variant) -> &'static [Field] {
    variant.content.as_ref().and_then(group).unwrap_or_default()
}

fn with_range(field: &Field) -> String {
    let allowed = allowed(field);
    if allowed.is_empty() {
        field.meaning.into()
    } else {
        format!("{} ({allowed})", field.meaning)
    }
}

fn comment(text: &mut String, words: &str) {
    let mut comment = String::new();
    for word in words.split_whitespace() {
        if !comment.is_empty() && comment.chars().count() + 3 + word.chars().count() > WIDTH {
            line(text, &format!("#{comment}"));
            comment.clear();
        }
        comment.push(' ');
        comment.push_str(word);
    }
    line(text, &format!("#{comment}"));
}

fn line(text: &mut String, content: &str) {
    text.push_str(content);
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::built_in;

    fn read(text: &str) -> Scenario {
        toml::from_str(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    #[test]
    fn every_built_in_scenario_survives_being_printed_with_comments() {
        for name in built_in::names() {
            let scenario = Scenario::load(name, &[]).unwrap();
            assert_eq!(read(&scenario.to_commented_toml()), scenario, "{name}");
        }
    }

    #[test]
    fn optional_empty_and_awkward_values_survive_too() {
        let overrides = [
            "arm_model.height_m=0.36",
            "arm.link_inertia_kg_m2=[0.001, 0.0005]",
            "controller.belt.given_m_s=-0.1",
            "controller.reference=[]",
            "controller.law=off",
            "belt.profile={ kind = \"sine\", mean_m_s = -0.4, amplitude_m_s = 0.1, frequency_hz = 2.0 }",
        ]
        .map(String::from);
        let mut scenario = Scenario::load("edge", &overrides).unwrap();
        scenario.description = "[two]\n# \"lines\" = 'and quotes'\n".into();
        scenario.initial.theta1_deg = Some(0.1 + 0.2);
        assert_eq!(read(&scenario.to_commented_toml()), scenario);
    }

    #[test]
    fn keys_are_explained() {
        let text = Scenario::default().to_commented_toml();
        for part in [
            "# Friction coefficient μ between tip and belt. (0 to 10)\nfriction = 0.6\n",
            "# Control rate. (10 to 100000 Hz)\ntick_hz = 1000\n",
            "# given_m_s =\n",
            "# [arm_model] is absent: The arm in the controller's model; the plant's if absent.\n",
            "[controller.law.hybrid]\n",
            "(off, pid or hybrid)\n",
            "(up to 16 of hold, step, ramp or minimum-jerk)\n",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
        let comments = text.lines().filter(|line| line.starts_with('#'));
        let longest = comments.map(|line| line.chars().count()).max();
        assert!(longest <= Some(WIDTH), "{longest:?}");
    }
}
