//! Python's values as TOML, for the overrides of a scenario and the options of a study.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::Value;

/// Upper limit of lists and dictionaries within each other; a list may contain itself.
const MOST_LEVELS: usize = 16;

/// Returns overrides as texts `key=value`.
///
/// # Errors
/// `TypeError` or `ValueError` naming the key.
pub fn overrides(values: &Bound<'_, PyDict>) -> PyResult<Vec<String>> {
    let entries = values.iter().map(|(key, value)| {
        let key: String = key
            .extract()
            .map_err(|_| PyTypeError::new_err(format!("override {key}: a key is a text")))?;
        Ok(format!(
            "{key}={}",
            toml_text(&toml_value(&key, &value, 0)?)
        ))
    });
    entries.collect()
}

/// Returns the options of a study as arguments of its command.
///
/// # Errors
/// `TypeError` or `ValueError` naming the option.
pub fn arguments(options: &Bound<'_, PyDict>) -> PyResult<Vec<String>> {
    let mut arguments = Vec::new();
    for (name, value) in options {
        let name: String = name.extract()?;
        if name == "help" {
            return Err(PyValueError::new_err("help is no option of a study"));
        }
        let option = format!("--{}", name.replace('_', "-"));
        match toml_value(&name, &value, 0)? {
            Value::Boolean(true) => arguments.push(option),
            Value::Boolean(false) => {}
            Value::Array(items) if name == "set" => {
                let repeated = |item| format!("{option}={}", text(item));
                arguments.extend(items.iter().map(repeated));
            }
            Value::Array(items) => {
                let items: Vec<String> = items.iter().map(text).collect();
                arguments.push(format!("{option}={}", items.join(",")));
            }
            Value::Table(keys) => {
                let key = |(key, value): (&String, &Value)| {
                    format!("{option}={key}={}", toml_text(value))
                };
                arguments.extend(keys.iter().map(key));
            }
            value => arguments.push(format!("{option}={}", text(&value))),
        }
    }
    Ok(arguments)
}

/// Returns a message about options of a command with their names in Python: `--v-belt` is `v_belt`.
pub fn in_python_names(message: &str) -> String {
    let mut parts = message.split("--");
    let mut renamed: String = parts.next().unwrap_or_default().into();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_alphanumeric() && c != '-');
        let (option, rest) = part.split_at(end.unwrap_or(part.len()));
        renamed += &option.replace('-', "_");
        renamed += rest;
    }
    renamed
}

/// Returns a value as an option of a command takes it: a text without quotes.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        other => toml_text(other),
    }
}

/// Returns a value as TOML on one line, where a text remains a text whatever it contains.
fn toml_text(value: &Value) -> String {
    match value {
        Value::String(text) => quoted(text),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(toml_text).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Table(keys) => {
            let key =
                |(key, value): (&String, &Value)| format!("{} = {}", quoted(key), toml_text(value));
            let keys: Vec<String> = keys.iter().map(key).collect();
            format!("{{ {} }}", keys.join(", "))
        }
        other => other.to_string(),
    }
}

/// Returns a text as a TOML string on one line.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            _ if character.is_control() => {
                quoted += &format!("\\u{:04x}", u32::from(character));
            }
            _ => quoted.push(character),
        }
    }
    quoted + "\""
}

fn toml_value(key: &str, value: &Bound<'_, PyAny>, level: usize) -> PyResult<Value> {
    if level > MOST_LEVELS {
        let message = format!("{key}: more than {MOST_LEVELS} lists within each other");
        return Err(PyValueError::new_err(message));
    }
    let inner = |item: Bound<'_, PyAny>| toml_value(key, &item, level + 1);
    // A truth value is an integer as well.
    if let Ok(truth) = value.cast::<PyBool>() {
        Ok(Value::Boolean(truth.is_true()))
    } else if let Ok(number) = value.cast::<PyInt>() {
        let out_of_range = |_| {
            PyValueError::new_err(format!(
                "{key} = {number} is out of range: whole numbers are -2^63 to 2^63 - 1"
            ))
        };
        number.extract().map(Value::Integer).map_err(out_of_range)
    } else if let Ok(number) = value.cast::<PyFloat>() {
        Ok(Value::Float(number.value()))
    } else if let Ok(text) = value.cast::<PyString>() {
        Ok(Value::String(text.extract()?))
    } else if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let items = value.try_iter()?.map(|item| inner(item?));
        items.collect::<PyResult<_>>().map(Value::Array)
    } else if let Ok(table) = value.cast::<PyDict>() {
        let entries = table
            .iter()
            .map(|(name, item)| Ok((name.extract()?, inner(item)?)));
        entries.collect::<PyResult<_>>().map(Value::Table)
    } else if value.hasattr("tolist")? {
        // Arrays and numbers of numpy and its relatives.
        inner(value.call_method0("tolist")?)
    } else if value.hasattr("__fspath__")? {
        inner(value.call_method0("__fspath__")?)
    } else {
        Err(PyTypeError::new_err(format!(
            "{key}: a value of type {} has no meaning here; give a number, a text, True, False, a list or a dictionary",
            value.get_type().name()?
        )))
    }
}
