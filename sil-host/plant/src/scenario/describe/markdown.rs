//! Tables of settings for the documentation.

use std::fmt::Write;

use painleve_shared::settings::{Field, Settings, Shape};
use toml::Value;

use super::{allowed, default_at, group, resolved};
use crate::scenario::Scenario;

/// Returns a Markdown table of all settings in the groups `sections` of a scenario. Keys are full,
/// or relative to the section if there is only one.
pub fn settings_table(sections: &[&str]) -> String {
    let mut table = SettingsTable {
        rows: Vec::new(),
        lists: Vec::new(),
        path: Vec::new(),
        hidden: usize::from(sections.len() == 1),
        kinds: Vec::new(),
    };
    let listed = Scenario::FIELDS
        .iter()
        .filter(|field| sections.contains(&field.key));
    for field in listed {
        table.add(field);
    }
    let mut text = "| key | default | allowed | meaning |\n|---|---|---|---|\n".to_string();
    for row in table.rows {
        row.write(&mut text);
    }
    text
}

/// A setting.
#[derive(Clone, PartialEq)]
struct Row {
    key: String,
    /// Names of the variants to which the setting belongs; all of them describe it alike.
    kinds: Vec<String>,
    /// Default and allowed values.
    cells: String,
    meaning: String,
}

impl Row {
    fn write(&self, text: &mut String) {
        let kinds = match self.kinds.as_slice() {
            [] => String::new(),
            kinds => format!(" ({})", kinds.join(", ")),
        };
        let (key, cells, meaning) = (&self.key, &self.cells, &self.meaning);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| `{key}`{kinds} | {cells} | {meaning} |");
    }
}

/// The rows so far, and the place of the next one.
struct SettingsTable {
    rows: Vec<Row>,
    /// The keys whose variants have been listed, and these rows with keys relative to them.
    lists: Vec<(String, Vec<Row>)>,
    /// Key of the settings that are being added, in parts.
    path: Vec<&'static str>,
    /// Parts of the key that are left out.
    hidden: usize,
    /// Names of the variants to which the settings belong whose names are not in their keys.
    kinds: Vec<&'static str>,
}

impl SettingsTable {
    /// Adds the rows of a setting, and of those inside it.
    fn add(&mut self, field: &Field) {
        self.path.push(field.key);
        self.add_here(&resolved(field));
        self.path.pop();
    }

    fn add_here(&mut self, field: &Field) {
        if let Some(fields) = group(&field.shape) {
            if matches!(field.shape, Shape::Optional(_)) {
                self.row("absent", "a group", field.meaning);
            } else {
                fields.iter().for_each(|field| self.add(field));
            }
            return;
        }
        let default = match default_at(&self.path) {
            Some(Value::Table(table)) => match &field.shape {
                Shape::Choice { tag: None, .. } => table.keys().next().cloned().unwrap_or_default(),
                _ => Value::Table(table).to_string(),
            },
            Some(value) => value.to_string(),
            None if matches!(field.shape, Shape::Optional(_)) => "absent".into(),
            None => String::new(),
        };
        let default = match default.as_str() {
            "" | "absent" => default,
            _ => format!("`{default}`"),
        };
        self.row(&default, &allowed(field), field.meaning);
        let above = self.rows.len();
        self.add_variants(&field.shape);
        self.refer_to_an_equal_list(above);
    }

    /// Replaces the rows from `above` on by a reference if another key has listed the same variants.
    fn refer_to_an_equal_list(&mut self, above: usize) {
        let (key, mut list) = (self.key(), self.rows[above..].to_vec());
        if list.is_empty() {
            return;
        }
        for row in &mut list {
            row.key = row.key.trim_start_matches(&key).to_string();
        }
        match self.lists.iter().find(|(_, other)| *other == list) {
            Some((first, _)) => {
                self.rows.truncate(above);
                let meaning = &mut self.rows[above - 1].meaning;
                *meaning = format!("{meaning} Its keys are those of `{first}`.");
            }
            None => self.lists.push((key, list)),
        }
    }

    /// Adds the settings of the variants of a choice, or of the choices in a list.
    fn add_variants(&mut self, shape: &Shape) {
        match shape {
            Shape::Choice { variants, tag } => {
                for variant in *variants {
                    let Some(Shape::Group(fields)) = variant.content else {
                        continue;
                    };
                    self.names(tag).push(variant.key);
                    fields.iter().for_each(|field| self.add(field));
                    self.names(tag).pop();
                }
            }
            Shape::List { item, .. } => {
                self.path.push("N");
                self.add_variants(item);
                self.path.pop();
            }
            _ => {}
        }
    }

    /// Returns the names to which that of a variant belongs. Settings of a tagged variant are at the same
    /// level as its name.
    fn names(&mut self, tag: &Option<&'static str>) -> &mut Vec<&'static str> {
        match tag {
            None => &mut self.path,
            Some(_) => &mut self.kinds,
        }
    }

    fn key(&self) -> String {
        self.path[self.hidden..].join(".")
    }

    fn row(&mut self, default: &str, allowed: &str, meaning: &str) {
        let row = Row {
            key: self.key(),
            kinds: self.kinds.iter().map(ToString::to_string).collect(),
            cells: format!("{default} | {allowed}"),
            meaning: meaning.to_string(),
        };
        let is_same = |other: &&mut Row| {
            (&other.key, &other.cells, &other.meaning) == (&row.key, &row.cells, &row.meaning)
        };
        match self.rows.iter_mut().find(is_same) {
            Some(other) => other.kinds.extend(row.kinds),
            None => self.rows.push(row),
        }
    }
}
