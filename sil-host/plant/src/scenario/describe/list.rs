//! All settings of a scenario, those of every variant included, as a list.

use painleve_shared::settings::{Field, Settings, Shape};
use serde::Serialize;
use toml::Value;

use super::{allowed, default_at, group, resolved};
use crate::scenario::Scenario;

/// A key that a scenario may have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// The key, as in `belt.friction`; `N` stands for the place in a list, from 0.
    pub key: String,
    /// The kinds to which it belongs: `belt.profile.at_s` (step) needs `belt.profile.kind = "step"`. Empty for all kinds.
    pub kinds: Vec<String>,
    /// Its value in TOML if a scenario does not have it; `absent` if it then has none, empty if its kind requires it.
    pub default: String,
    /// Range and unit, or names.
    pub allowed: String,
    /// What it means.
    pub meaning: String,
}

/// Returns every setting, in the order of a scenario's sections.
pub fn settings() -> Vec<Setting> {
    let mut list = List {
        rows: Vec::new(),
        path: Vec::new(),
        kinds: Vec::new(),
    };
    Scenario::FIELDS.iter().for_each(|field| list.add(field));
    list.rows
}

/// The rows so far, and the place of the next one.
struct List {
    rows: Vec<Setting>,
    /// Key of the settings that are being added, in parts.
    path: Vec<&'static str>,
    /// Names of the variants to which the settings belong whose names are not in their keys.
    kinds: Vec<&'static str>,
}

impl List {
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
        self.row(&default, &allowed(field), field.meaning);
        self.add_variants(&field.shape);
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
        self.path.join(".")
    }

    fn row(&mut self, default: &str, allowed: &str, meaning: &str) {
        let row = Setting {
            key: self.key(),
            kinds: Vec::new(),
            default: default.into(),
            allowed: allowed.into(),
            meaning: meaning.into(),
        };
        let kinds: Vec<_> = self.kinds.iter().map(ToString::to_string).collect();
        let is_same = |other: &&mut Setting| {
            (&other.key, &other.default, &other.allowed, &other.meaning)
                == (&row.key, &row.default, &row.allowed, &row.meaning)
        };
        match self.rows.iter_mut().find(is_same) {
            Some(other) => other.kinds.extend(kinds),
            None => self.rows.push(Setting { kinds, ..row }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_of_every_variant_are_listed_once() {
        let list = settings();
        let of = |key: &str| {
            let rows: Vec<_> = list.iter().filter(|row| row.key == key).collect();
            assert!(rows.len() == 1, "{key}: {rows:?}");
            rows[0]
        };
        let ratio = of("controller.governor.p_ratio");
        assert_eq!((&*ratio.default, &*ratio.allowed), ("0.08", "0 to 0.9"));
        assert_eq!(of("arm_model").default, "absent");
        assert_eq!(of("belt.profile.at_s").kinds, ["step"]);
        assert_eq!(of("contact.normal.restitution.mass_kg").default, "");
        let until = of("converters.faults.torque_2.until_s");
        assert_eq!(until.kinds.len(), 6, "{until:?}");
        of("controller.reference.N.ramp.target_m");
    }
}
