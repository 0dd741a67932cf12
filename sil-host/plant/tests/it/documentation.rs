//! Checks that the generated parts of the documentation are up to date.
//!
//! A part begins with `<!-- generated: NAME -->` and ends with `<!-- end -->`.
//!
//! Measured figures come from `docs/measured/FILE.toml`, where `cargo xtask measure` writes them:
//! `<!-- measured: FILE.NAME.KEY -->0.148<!-- /measured -->` is one figure (`KEY:4` with four decimals),
//! `<!-- measured: FILE -->` to `<!-- /measured -->` the table of a file.

#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use painleve_files::atomic_file;
use painleve_firmware::SOURCES;
use painleve_plant::scenario::describe;
use painleve_shared::frame::StatusFlags;
use painleve_shared::lapse::Lapse;
use painleve_shared::status::Fault;
use toml::{Table, Value};

fn faults() -> String {
    let mut text = "| number | fault | meaning | limit |\n|---|---|---|---|\n".to_string();
    for fault in Fault::ALL {
        let limits: Vec<_> = Lapse::ALL
            .iter()
            .filter(|lapse| lapse.fault() == *fault)
            .map(|lapse| format!("`lapses.{}`", lapse.key()))
            .collect();
        let (number, meaning, limits) = (*fault as u8, fault.description(), limits.join(", "));
        writeln!(text, "| {number} | `{fault:?}` | {meaning} | {limits} |").unwrap();
    }
    text
}

/// Compares a part of a page with its expected text, or writes it if `UPDATE_DOCUMENTATION` is set.
fn check(page: &str, name: &str, expected: &str) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let begin = format!("<!-- generated: {name} -->\n");
    let (before, rest) = text.split_once(&begin).expect(&begin);
    let (present, after) = rest.split_once("<!-- end -->").expect("<!-- end -->");
    let expected = format!("\n{expected}\n");
    if present == expected {
        return;
    }
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        let text = format!("{before}{begin}{expected}<!-- end -->{after}");
        atomic_file::write(&path, text.as_bytes()).unwrap();
        return;
    }
    panic!(
        "docs/{page}: the part '{name}' is not up to date; update it with:\n\
         UPDATE_DOCUMENTATION=1 cargo test -p painleve-plant documentation"
    );
}

/// Compares a whole file of `docs/` with its expected text, or writes it if `UPDATE_DOCUMENTATION` is set.
pub fn check_file(name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name);
    if std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        atomic_file::write(&path, expected.as_bytes()).unwrap();
    }
    assert!(
        fs::read_to_string(path).is_ok_and(|present| present == expected),
        "docs/{name} is not up to date; update it with:\n\
         UPDATE_DOCUMENTATION=1 cargo test -p painleve-plant documentation"
    );
}

/// The list that `painleve scenarios --keys` prints, for readers without the program. It also shows, in a review, each default
/// and range that a change of the source moves.
#[test]
fn the_list_of_settings_is_up_to_date() {
    let mut list = csv::Writer::from_writer(Vec::new());
    list.write_record(["key", "kinds", "default", "allowed", "meaning"])
        .unwrap();
    for it in describe::settings() {
        let kinds = it.kinds.join(" ");
        list.write_record([it.key, kinds, it.default, it.allowed, it.meaning])
            .unwrap();
    }
    let expected = String::from_utf8(list.into_inner().unwrap()).unwrap();
    check_file("settings.csv", &expected);
}

/// One test for all parts, so that two parts of one page are not written at the same time.
#[test]
fn generated_parts_and_measured_figures_are_up_to_date() {
    check_measured_figures();
    check("controller.md", "faults", &faults());
}

#[test]
fn every_status_flag_is_documented() {
    use painleve_shared::frame::bitflags::Flags;
    let page = include_str!("../../../../docs/controller.md");
    for flag in StatusFlags::FLAGS {
        let bit = flag.value().bits().trailing_zeros();
        let row = format!("| {bit} | `{}` |", flag.name());
        assert!(page.contains(&row), "no row {row}");
    }
}

const END: &str = "<!-- /measured -->";

/// What a result holds beside the figures that are columns of their own.
const NO_COLUMN: [&str; 8] = [
    "runs",
    "successes",
    "lower_percent",
    "upper_percent",
    "source",
    "commit",
    "date",
    "machine",
];

/// A figure, or several of one command.
pub struct Entry {
    pub name: String,
    pub label: String,
    command: String,
    pub result: Table,
}

/// Returns the README and the pages of the documentation.
fn pages() -> Vec<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = fs::read_dir(workspace.join("docs")).unwrap();
    let mut pages: Vec<_> = folder.map(|entry| entry.unwrap().path()).collect();
    pages.push(workspace.join("README.md"));
    pages.retain(|page| page.extension().is_some_and(|it| it == "md"));
    pages
}

/// Returns the entries of a file of measured figures that have a result.
pub fn entries(file: &str) -> Vec<Entry> {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../docs/measured/{file}.toml"));
    let text =
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let table: Table = text.parse().unwrap();
    let entries = table["measured"].as_array().unwrap().iter();
    let entry = |entry: &Value| {
        let [name, label, command] =
            ["name", "label", "command"].map(|key| entry[key].as_str().unwrap().to_owned());
        let result = entry.get("result")?.as_table()?.clone();
        Some(Entry {
            name,
            label,
            command,
            result,
        })
    };
    entries.filter_map(entry).collect()
}

pub fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn thousands(whole: i64) -> String {
    let digits = whole.to_string();
    let grouped: Vec<_> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .map(|chunk| str::from_utf8(chunk).unwrap())
        .collect();
    grouped.join(",")
}

/// Returns a value as a page prints it, a fraction with four significant digits unless told otherwise.
fn printed(value: &Value, decimals: Option<usize>) -> String {
    match value {
        Value::Integer(whole) if decimals.is_none() => thousands(*whole),
        Value::String(text) => text.clone(),
        value => {
            let value = number(value).unwrap();
            let magnitude = if value == 0.0 {
                0.0
            } else {
                value.abs().log10().floor()
            };
            let decimals = decimals.unwrap_or((3.0 - magnitude).max(0.0) as usize);
            format!("{value:.decimals$}").replace('-', "−")
        }
    }
}

/// Returns the success of a campaign with its interval: `99.43 % (99.26–99.56 %)`.
fn success(result: &Table) -> Option<String> {
    let number = |key| number(result.get(key)?);
    let (runs, successes) = (number("runs")?, number("successes")?);
    let decimals = if runs < 10_000.0 { 1 } else { 2 };
    let percent = |value: f64| match value {
        100.0 => "100".to_string(),
        value => format!("{value:.decimals$}"),
    };
    let [lower, upper] = ["lower_percent", "upper_percent"]
        .map(number)
        .map(Option::unwrap)
        .map(percent);
    Some(format!(
        "{} % ({lower}–{upper} %)",
        percent(successes / runs * 100.0)
    ))
}

/// Returns the table of a file: a row for each entry, with its provenance.
fn measured_table(entries: &[Entry]) -> String {
    let first = entries.first().unwrap();
    let keys = first.result.keys().map(String::as_str);
    let is_campaign = success(&first.result).is_some();
    let is_figure = |key: &&str| !NO_COLUMN.contains(key) || *key == "runs" && !is_campaign;
    let figures: Vec<&str> = keys.filter(is_figure).collect();
    let mut columns: Vec<String> = figures.iter().map(|key| key.replace('_', " ")).collect();
    if is_campaign {
        columns.splice(0..0, ["success (95 % interval)", "runs"].map(String::from));
        columns.push("seed".into());
    }
    columns.push("measured at commit".into());
    let mut rows = Vec::new();
    for Entry {
        label,
        command,
        result,
        ..
    } in entries
    {
        let cell = |key: &&str| {
            result
                .get(*key)
                .map_or("–".into(), |value| printed(value, None))
        };
        let mut cells: Vec<String> = figures.iter().map(cell).collect();
        if is_campaign {
            cells.splice(0..0, [success(result).unwrap(), cell(&"runs")]);
            let seed = command.split_once("--seed ").unwrap().1;
            cells.push(seed.split(' ').next().unwrap().into());
        }
        cells.push(result["commit"].as_str().unwrap().into());
        rows.push((label.clone(), cells));
    }
    // What all rows share stands once, below.
    let mut shared = Vec::new();
    for name in ["runs", "seed", "measured at commit"] {
        let Some(column) = columns.iter().position(|column| column == name) else {
            continue;
        };
        let value = rows[0].1[column].clone();
        if rows.len() >= 3 && rows.iter().all(|(_, cells)| cells[column] == value) {
            columns.remove(column);
            for (_, cells) in &mut rows {
                cells.remove(column);
            }
            shared.push(format!("{name} {value}"));
        }
    }
    // A table with more figures than entries stands upright: a column for each entry.
    if figures.len() > entries.len() {
        let labels = rows.iter().map(|(label, _)| label.clone()).collect();
        let upright = core::mem::replace(&mut columns, labels).into_iter();
        let upright = upright.enumerate().map(|(column, name)| {
            let cells = rows.iter().map(|(_, cells)| cells[column].clone());
            (name, cells.collect())
        });
        rows = upright.collect();
    }
    let mut text = format!("| | {} |\n|---|", columns.join(" | "));
    writeln!(text, "{}", "---|".repeat(columns.len())).unwrap();
    for (label, cells) in rows {
        writeln!(text, "| {label} | {} |", cells.join(" | ")).unwrap();
    }
    if !shared.is_empty() {
        writeln!(text, "\nAll: {}.", shared.join(", ")).unwrap();
    }
    text
}

/// Returns what stands in the block with this head, and the results that it shows.
fn measured(head: &str) -> (String, Vec<Table>) {
    let Some((file, rest)) = head.split_once('.') else {
        let entries = entries(head);
        let text = format!("\n\n{}\n", measured_table(&entries));
        return (
            text,
            entries.into_iter().map(|entry| entry.result).collect(),
        );
    };
    let (name, key) = rest
        .rsplit_once('.')
        .unwrap_or_else(|| panic!("{head} names no key"));
    let (key, decimals) = match key.split_once(':') {
        Some((key, decimals)) => (key, Some(decimals.parse().unwrap())),
        None => (key, None),
    };
    let entry = entries(file).into_iter().find(|entry| entry.name == name);
    let result = entry
        .unwrap_or_else(|| panic!("{file}.toml has no result of '{name}'"))
        .result;
    let text = match key {
        "success" => success(&result).unwrap_or_else(|| panic!("{file}.{name} is no campaign")),
        key => printed(
            result
                .get(key)
                .unwrap_or_else(|| panic!("{file}.{name} has no {key}")),
            decimals,
        ),
    };
    (text, vec![result])
}

/// Returns a page with its measured blocks as their files have them.
fn with_measured_figures(page: &str) -> String {
    let (mut text, mut rest) = (String::new(), page);
    let mut shown = Vec::new();
    while let Some((before, after)) = rest.split_once("<!-- measured: ") {
        let (head, content) = after.split_once(" -->").unwrap();
        let (present, after) = content.split_at(content.find("<!-- ").unwrap());
        text += &format!("{before}<!-- measured: {head} -->");
        // Blocks with another end belong to the tests that measure them.
        if after.starts_with(END) {
            let (figures, results) = measured(head);
            text += &figures;
            shown.extend(results.into_iter().map(|result| (head, result)));
        } else {
            text += present;
        }
        rest = after;
    }
    text += rest;
    let states_commits = text.contains("easured at commit");
    for (head, result) in shown {
        let [source, commit] = ["source", "commit"].map(|key| result[key].as_str().unwrap());
        assert!(
            source == format!("{SOURCES:016x}") || states_commits && text.contains(commit),
            "{head} was measured with other sources, at commit {commit}: measure it again with `cargo xtask measure`, or \
             write 'measured at commit {commit}' on its page"
        );
    }
    text
}

fn check_measured_figures() {
    for page in pages() {
        let present = fs::read_to_string(&page).unwrap();
        let expected = with_measured_figures(&present);
        if present == expected {
            continue;
        }
        assert!(
            std::env::var_os("UPDATE_DOCUMENTATION").is_some(),
            "{}: a measured figure is not that of docs/measured; update it with:\n\
             UPDATE_DOCUMENTATION=1 cargo test -p painleve-plant documentation",
            page.display()
        );
        // Other tests read the page meanwhile.
        atomic_file::write(&page, expected.as_bytes()).unwrap();
    }
}

/// What a measurement has as its result: `#` is a number, `#.#` one with a fraction, `#.####` one with four decimals or more.
const MEASURED_KINDS: [&str; 23] = [
    "# of #",
    "#.# %",
    "#.####",
    "# N rms",
    "# mN·m",
    "# lift-offs",
    "# impacts",
    "# faults",
    "# cycles",
    "# instructions",
    "# ns",
    "# µs",
    "# ms",
    "# kHz",
    "# ticks/s",
    "# frames/s",
    "# × real",
    "# simulated",
    "# CPU",
    "# KB",
    "# MB",
    "# minutes",
    "# seconds",
];

/// Figures that look measured but are limits, settings or the paper's: page, words, reason.
const NOT_MEASURED: [(&str, &str, &str); 34] = [
    ("README.md", "to 0.0375 m", "the paper's target for its PID"),
    ("README.md", "1 kHz", "a control rate"),
    ("benchmarks.md", "10 µs", "a step of the integrators"),
    ("benchmarks.md", "1 ms", "a step of the integrators"),
    ("benchmarks.md", "50 ms", "how long a torque lasts"),
    ("benchmarks.md", "5 kHz", "a control rate"),
    ("beyond-the-paper.md", "20 ms", "a filter's window"),
    ("beyond-the-paper.md", "1 ms", "a period of the control"),
    ("beyond-the-paper.md", "50 ms", "a limit of the controller"),
    ("controller.md", "1 kHz", "a control rate"),
    ("controller.md", "10 kHz", "a control rate"),
    ("flashing.md", "10 kHz", "a control rate"),
    ("flashing.md", "1 kHz", "a control rate"),
    ("flashing.md", "1 ms", "a setting of an adapter"),
    ("flashing.md", "5 ms", "a limit, which a test holds"),
    ("flashing.md", "50 ms", "a limit, which a test holds"),
    ("flashing.md", "200 ms", "a limit, which a test holds"),
    ("flashing.md", "2.5 kHz", "a limit, which a test holds"),
    ("flashing.md", "7.5 kHz", "a limit, which a test holds"),
    (
        "flashing.md",
        "97.5 µs",
        "4,096 periods of the bus, whose limit is 42 MHz",
    ),
    (
        "flashing.md",
        "24.1 µs",
        "4,096 periods of a bus of 170 MHz",
    ),
    ("introduction.md", "0.3775 m", "the paper's arm"),
    ("recording.md", "2 MB", "a limit, which a test holds"),
    ("recording.md", "50 ms", "a definition"),
    ("reliability.md", "500 MB", "a limit, which a test holds"),
    ("reliability.md", "200 MB", "a limit, which a test holds"),
    ("scenarios.md", "10 kHz", "a control rate"),
    (
        "studies.md",
        "0.0375 m elbow down",
        "the paper's result for its PID",
    ),
    ("studies.md", "0–1 ms", "a range that is drawn"),
    ("studies.md", "20 ms", "a definition"),
    ("studies.md", "limit: 5 ms", "a limit"),
    ("studies.md", "limit: 10 ms", "a limit"),
    ("studies.md", "10 kHz", "a control rate"),
    ("studies.md", "1 kHz", "a control rate"),
];

/// Returns the prose of a page: neither code nor formulas, nor what is generated or measured.
fn prose(page: &str) -> String {
    let mut text = String::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("<!-- ") {
        text += before;
        let end = after
            .find("<!-- end -->")
            .into_iter()
            .chain(after.find(END))
            .min();
        let block = &after[end.unwrap_or(0)..];
        rest = block.split_once("-->").map_or("", |(_, after)| after);
        text += " ";
    }
    text += rest;
    for mark in ["```", "$$", "`", "$"] {
        text = text.split(mark).step_by(2).collect::<Vec<_>>().join(" ␣ ");
    }
    text
}

/// Returns whether a word of a page is what a word of a kind stands for.
fn matches(word: &str, kind: &str) -> bool {
    let word = word.trim_matches(['(', ')', ',', '.', ';', ':', '*', '±', '−']);
    let Some(fraction) = kind.strip_prefix('#') else {
        return word == kind;
    };
    let is_digit = |c: char| c.is_ascii_digit();
    let is_number =
        word.contains(is_digit) && word.chars().all(|c| is_digit(c) || ".,–−".contains(c));
    let decimals = |number: &str| number.split_once('.').map_or(0, |(_, digits)| digits.len());
    is_number
        && match fraction {
            "" => true,
            ".#" => word.contains('.'),
            _ => word.split('–').any(|number| decimals(number) >= 4),
        }
}

/// Returns the measured figures that the prose of a page contains.
fn typed_figures(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let words: Vec<&str> = text.split_whitespace().collect();
    for kind in MEASURED_KINDS {
        let kind: Vec<&str> = kind.split(' ').collect();
        for at in words.windows(kind.len()) {
            if at.iter().zip(&kind).all(|(word, kind)| matches(word, kind)) {
                found.push(at.join(" "));
            }
        }
    }
    let cells = text.lines().filter(|line| line.starts_with('|'));
    for cell in cells.flat_map(|line| line.split('|')).map(str::trim) {
        if matches(cell, "#") && cell.contains(['.', ',']) {
            found.push(format!("| {cell} |"));
        }
    }
    found
}

/// Returns a text without these words. They begin no number: "0.5 ms" stays without "5 ms".
fn without(text: &str, words: &str) -> String {
    let mut parts = text.split(words);
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        if kept.ends_with(|c: char| c.is_ascii_digit() || ".,–".contains(c)) {
            kept += words;
        }
        kept += part;
    }
    kept
}

/// A measured figure stands in a block that takes it from `docs/measured`: typed by hand, it becomes false unnoticed.
#[test]
fn no_measured_figure_is_typed_by_hand() {
    let mut found = Vec::new();
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let in_root = ["CHANGELOG.md", "CONTRIBUTING.md"].map(|page| workspace.join(page));
    for path in pages().into_iter().chain(in_root) {
        let name = path.file_name().unwrap().to_str().unwrap();
        let mut text = prose(&fs::read_to_string(&path).unwrap());
        for (_, words, reason) in NOT_MEASURED.iter().filter(|(page, ..)| *page == name) {
            assert!(
                text.contains(words),
                "{name} no longer has '{words}' ({reason}): take it off the list"
            );
            text = without(&text, words);
        }
        found.extend(
            typed_figures(&text)
                .into_iter()
                .map(|figure| format!("{name}: {figure}")),
        );
    }
    assert!(
        found.is_empty(),
        "measured figures typed by hand; take them from docs/measured, or list them as limits: {found:#?}"
    );
}

#[test]
fn figures_of_every_measured_kind_are_recognised() {
    for text in [
        "60 of 60 runs",
        "99.4 %",
        "(98.8–99.5 %)",
        "at 0.1526 m",
        "2,304 instructions,",
        "45 mN·m",
        "0.03 N rms",
        "| 9,480 |",
        "up to 6.83 kHz.",
        "0.5 ms",
    ] {
        assert_eq!(typed_figures(text).len(), 1, "{text}");
    }
    for text in [
        "95 % of them",
        "within 0.5 s",
        "2.0 m",
        "| 20 mm |",
        "| 3 |",
    ] {
        assert!(typed_figures(text).is_empty(), "{text}");
    }
    assert_eq!(without("5 ms, 0.5 ms", "5 ms"), ", 0.5 ms");
    let page =
        "<!-- measured: a.b.c -->2.5<!-- /measured --> % `7 of 8` $0.1234$\n```\n5 µs\n```\n";
    assert!(typed_figures(&prose(page)).is_empty());
}
