//! Tables of settings for the documentation.

use std::fmt::Write;

use painleve_shared::settings::{Field, Settings, Shape};
use toml::Value;

use super::{allowed, default_at, group, resolved};
use crate::scenario::Scenario;

/// Returns a Markdown table of all settings in the groups `sections` of a scenario. Keys are full,
/// or relative to the section if there is only one.
pub fn settings_table(sections: &[&str]) -> String {
    let mut text = "| key | default | allowed | meaning |\n|---|---|---|---|\n".to_string();
    for field in Scenario::FIELDS {
        if !sections.contains(&field.key) {
            continue;
        }
        let hidden = usize::from(sections.len() == 1);
        rows(&mut text, &mut vec![field.key], hidden, field);
    }
    text
}

fn rows(text: &mut String, path: &mut Vec<&'static str>, hidden: usize, field: &Field) {
    let field = &resolved(field);
    if let Some(fields) = group(&field.shape) {
        if matches!(field.shape, Shape::Optional(_)) {
            row(text, &path[hidden..], "absent", "a group", field.meaning);
        } else {
            inner_rows(text, path, hidden, fields);
        }
        return;
    }
    let default = match default_at(path) {
        Some(Value::Table(table)) => match &field.shape {
            Shape::Choice { tag: None, .. } => table.keys().next().cloned().unwrap_or_default(),
            _ => Value::Table(table).to_string(),
        },
        Some(value) => value.to_string(),
        None if matches!(field.shape, Shape::Optional(_)) => "absent".into(),
        None => String::new(),
    };
    let code = |text: &str| match text {
        "" | "absent" => text.to_string(),
        _ => format!("`{text}`"),
    };
    row(
        text,
        &path[hidden..],
        &code(&default),
        &allowed(field),
        field.meaning,
    );
    variant_rows(text, path, hidden, &field.shape);
}

/// Appends the settings of the variants of a choice, or of the choices in a list.
fn variant_rows(text: &mut String, path: &mut Vec<&'static str>, hidden: usize, shape: &Shape) {
    match shape {
        Shape::Choice { variants, tag } => {
            for variant in *variants {
                let Some(Shape::Group(fields)) = variant.content else {
                    continue;
                };
                // Settings of a tagged variant are at the same level as its name.
                let name = tag.is_none().then_some(variant.key);
                path.extend(name);
                inner_rows(text, path, hidden, fields);
                path.truncate(path.len() - name.iter().len());
            }
        }
        Shape::List { item, .. } => {
            path.push("N");
            variant_rows(text, path, hidden, item);
            path.pop();
        }
        _ => {}
    }
}

fn inner_rows(text: &mut String, path: &mut Vec<&'static str>, hidden: usize, fields: &[Field]) {
    for field in fields {
        path.push(field.key);
        rows(text, path, hidden, field);
        path.pop();
    }
}

fn row(text: &mut String, path: &[&str], default: &str, allowed: &str, meaning: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "| `{}` | {default} | {allowed} | {meaning} |",
        path.join(".")
    );
}
