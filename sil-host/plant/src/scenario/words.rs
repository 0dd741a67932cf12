//! What the parsers of TOML and serde say, in the words of all other messages: what is expected, and what is given
//! instead, without names of Rust's types.

use painleve_shared::settings::{Field, Shape};

use super::describe::interval;

/// What is wrong with a TOML text, and in which line.
#[derive(Debug, thiserror::Error)]
#[error("{}{}", .line.map_or(String::new(), |line| format!("line {line}: ")), in_words(source.message(), None))]
pub struct TomlError {
    line: Option<usize>,
    source: toml::de::Error,
}

impl TomlError {
    /// Returns the error of a parser in a text.
    pub fn new(source: toml::de::Error, text: &str) -> Self {
        let line = source
            .span()
            .map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        Self { line, source }
    }
}

/// Smallest similarity of a name that may have been meant, from 0 to 1.
const SIMILAR: f64 = 0.75;

/// Returns the known names, after a question about the one that is most similar to an unknown name, if any is:
/// `did you mean 'friction'? known: friction, profile`.
pub fn known_names<N: AsRef<str>>(unknown: &str, known: &[N]) -> String {
    let similarity = |name: &&str| strsim::normalized_damerau_levenshtein(unknown, name);
    let names: Vec<&str> = known.iter().map(AsRef::as_ref).collect();
    let meant = names
        .iter()
        .copied()
        .filter(|name| similarity(name) >= SIMILAR)
        .max_by(|one, other| similarity(one).total_cmp(&similarity(other)))
        .map_or(String::new(), |name| format!("did you mean '{name}'? "));
    format!("{meant}known: {}", names.join(", "))
}

/// Returns a message of serde or of the TOML parser in our words, on one line, with what is allowed for the setting.
pub(super) fn in_words(message: &str, setting: Option<&Field>) -> String {
    // The parser repeats the keys in last lines.
    let lines = message.trim().lines().map(str::trim);
    let lines: Vec<&str> = lines
        .filter(|line| !line.is_empty() && !line.starts_with("in `"))
        .collect();
    let message = lines.join(" ").replace('`', "'");
    let after = |start| message.strip_prefix(start);
    for (start, what) in [
        ("unknown variant ", "unknown name"),
        ("unknown field ", "unknown key"),
    ] {
        let mut quoted = after(start).unwrap_or_default().split('\'').skip(1);
        if let Some(unknown) = quoted.next() {
            let known: Vec<&str> = quoted.skip(1).step_by(2).collect();
            return format!("{what} '{unknown}'; {}", known_names(unknown, &known));
        }
    }
    if let Some(key) = after("missing field ") {
        // Only keys of variants have no defaults.
        return format!("missing key {key}; give the variant with all its keys in one {{ }}");
    }
    if message.starts_with("data did not match any variant") {
        return "matches none of its kinds".into();
    }
    if message == "duplicate key" {
        return "this key is there already: give it once, or merge the two tables".into();
    }
    if let Some(Shape::Choice { variants, .. }) = setting.map(|setting| setting.shape)
        && message.starts_with("wanted exactly 1 element")
    {
        let kinds: Vec<&str> = variants.iter().map(|variant| variant.key).collect();
        let example = variants.iter().find(|variant| variant.content.is_some());
        let example = example.map_or("", |variant| variant.key);
        return format!(
            "give one kind, a table as in {{ {example} = {{ … }} }}; known: {}",
            kinds.join(", ")
        );
    }
    let mismatch = ["invalid type: ", "invalid value: ", "invalid length "];
    let mismatch = mismatch
        .into_iter()
        .find_map(|start| after(start)?.rsplit_once(", expected "));
    match mismatch {
        Some((given, expected)) => {
            format!(
                "expected {}, not {}",
                of_type(expected, setting),
                value(given)
            )
        }
        None => message,
    }
}

/// Returns the expected type in words.
fn of_type(expected: &str, setting: Option<&Field>) -> String {
    // A type's name follows these.
    for (kind, meaning) in [
        ("struct ", "a table of keys"),
        ("internally tagged enum ", "a table with the key 'kind'"),
        ("enum ", "one of its kinds"),
        ("map", "a table of keys"),
    ] {
        if expected.starts_with(kind) {
            return meaning.into();
        }
    }
    match setting.map(|setting| setting.shape) {
        Some(Shape::Array { length, .. }) => return format!("a list of {length} items"),
        Some(Shape::List { maximum_length, .. }) => {
            return format!("a list of up to {maximum_length} items");
        }
        _ => {}
    }
    let range = setting.and_then(|setting| setting.range);
    let within = range.map_or(String::new(), |range| format!(" from {}", interval(&range)));
    match expected {
        "f32" | "f64" => format!("a number{within}"),
        "i32" | "i64" => format!("a whole number{within}"),
        "u8" | "u16" | "u32" | "u64" if range.is_some() => format!("a whole number{within}"),
        "u8" => up_to(u8::MAX.into()),
        "u16" => up_to(u16::MAX.into()),
        "u32" => up_to(u32::MAX.into()),
        // TOML has no larger numbers.
        "u64" | "usize" => up_to(i64::MAX.unsigned_abs()),
        "a boolean" => "true or false".into(),
        "a string" | "string only" => "a text".into(),
        "a sequence" => "a list".into(),
        other => other.into(),
    }
}

fn up_to(largest: u64) -> String {
    format!("a whole number from 0 to {largest}")
}

/// Returns the given value in words.
fn value(given: &str) -> String {
    match given {
        "sequence" => "a list".into(),
        "map" => "a table".into(),
        // What a value other than a name is to a choice of names.
        "unit variant" | "newtype variant" => "this".into(),
        other => ["string ", "integer ", "floating point ", "boolean "]
            .into_iter()
            .find_map(|kind| other.strip_prefix(kind))
            .unwrap_or(other)
            .trim_matches('\'')
            .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    #[test]
    fn messages_of_parsers_are_told_in_our_words() {
        for (theirs, ours) in [
            (
                "unknown variant `foo`, expected one of `model`, `food`, `off`\nin `friction`\n",
                "unknown name 'foo'; did you mean 'food'? known: model, food, off",
            ),
            (
                "invalid type: string \"x\", expected u32\nin `b`\n\nin `a`\n\n",
                "expected a whole number from 0 to 4294967295, not \"x\"",
            ),
            (
                "unknown field `x`, expected `one` or `two`",
                "unknown key 'x'; known: one, two",
            ),
            (
                "missing field `change`",
                "missing key 'change'; give the variant with all its keys in one { }",
            ),
            (
                "invalid type: string \"abc, expected f64\", expected f64",
                "expected a number, not \"abc, expected f64\"",
            ),
            (
                "invalid value: integer `-1`, expected u32",
                "expected a whole number from 0 to 4294967295, not -1",
            ),
            (
                "invalid type: floating point `0.5`, expected a boolean",
                "expected true or false, not 0.5",
            ),
            (
                "unclosed table, expected `]`",
                "unclosed table, expected ']'",
            ),
        ] {
            assert_eq!(in_words(theirs, None), ours);
        }
    }

    /// The prefix is that of the library's message.
    #[test]
    fn several_kinds_at_once_are_told_which_there_are() {
        let both = "contact.normal={ kind = 'hunt-crossley', dissipation_s_m = 2 }";
        let refused = Scenario::default().with_overrides("test", &[both.into()]);
        let message = refused.unwrap_err().to_string();
        assert!(
            message.contains("give one kind, a table as in { kelvin-voigt = { … } }"),
            "{message}"
        );
        assert!(
            message.contains("known: kelvin-voigt, restitution, hunt-crossley"),
            "{message}"
        );
    }
}
