//! The page of a recorded run as one HTML file that needs no network.

use std::collections::BTreeMap;
use std::io::Write;

use data_encoding::BASE64;
use painleve_files::atomic_file::AtomicFile;
use painleve_plant::scenario::Scenario;
use painleve_record::events::RunEvent;
use painleve_record::{RecordError, RecordedTick, Sink};
use serde_json::{Value, json};

use crate::row::{BYTE_COLUMNS, COLUMNS, Follower, ROW_BYTES, Row};
use crate::thinning::Thinned;

/// Number of events listed individually; further ones are counted.
const LISTED_EVENTS: usize = 1000;

const TEMPLATE: &str = include_str!("../page/index.html");
const UPLOT: &str = include_str!("../page/uplot/uPlot.iife.min.js");
const STYLES: [&str; 2] = [
    include_str!("../page/uplot/uPlot.min.css"),
    include_str!("../page/style.css"),
];
const SCRIPTS: [&str; 5] = [
    include_str!("../page/model.js"),
    include_str!("../page/arm.js"),
    include_str!("../page/charts.js"),
    include_str!("../page/live.js"),
    include_str!("../page/app.js"),
];

/// Returns the page of a run; `run` is [`description`], with rows and events if the run is
/// recorded.
pub fn html(run: &Value) -> String {
    // In a script element only `</` and `<!--` are special; JSON can escape `<`.
    let run = run.to_string().replace('<', "\\u003c");
    // From the end to the start, so that inserted parts are not searched for further placeholders.
    TEMPLATE
        .replacen("/*{{program}}*/", &SCRIPTS.join("\n"), 1)
        .replacen("/*{{uplot}}*/", UPLOT, 1)
        .replacen("/*{{run}}*/", &run, 1)
        .replacen("/*{{styles}}*/", &STYLES.join("\n"), 1)
}

/// Returns the description of a scenario for the page, including the layout of its rows.
pub fn description(scenario: &Scenario) -> Value {
    json!({
        "name": scenario.name,
        "description": scenario.description,
        "law": scenario.controller.law.name(),
        "tick_hz": scenario.run.tick_hz,
        "friction": scenario.belt.friction,
        "seed": scenario.run.seed,
        "arm": {
            "link_length_m": scenario.arm.link_length_m,
            "height_m": scenario.arm.height_m,
        },
        "settings": toml::to_string(scenario).unwrap_or_default(),
        "columns": COLUMNS,
        "byte_columns": BYTE_COLUMNS,
    })
}

/// Writes the page of a run to a file that appears once it is complete.
pub struct PageFile {
    file: AtomicFile,
    description: Value,
    follower: Follower,
    rows: Thinned,
    events: Vec<Value>,
    /// Numbers of events that are not listed, by kind.
    more_events: BTreeMap<&'static str, u64>,
}

impl PageFile {
    /// Creates the page of a run of this scenario.
    pub fn new(file: AtomicFile, scenario: &Scenario) -> Self {
        Self {
            file,
            description: description(scenario),
            follower: Follower::new(scenario),
            rows: Thinned::default(),
            events: Vec::new(),
            more_events: BTreeMap::new(),
        }
    }
}

impl Sink for PageFile {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        let followed = self.follower.tick(tick);
        self.rows.push(&Row::new(tick, followed));
        Ok(())
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        if self.events.len() < LISTED_EVENTS {
            self.events.push(event_entry(event));
        } else {
            *self.more_events.entry(event.kind.name()).or_default() += 1;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        let Self {
            mut file,
            mut description,
            rows,
            events,
            more_events,
            ..
        } = *self;
        let rows = rows.finish();
        let mut bytes = Vec::with_capacity(rows.len() * ROW_BYTES);
        rows.iter().for_each(|row| row.write(&mut bytes));
        description["rows"] = BASE64.encode(&bytes).into();
        description["events"] = events.into();
        description["more_events"] = json!(more_events);
        let path = file.path().to_path_buf();
        file.write_all(html(&description).as_bytes())
            .map_err(|error| RecordError::write(&path, error))?;
        Ok(Some(file))
    }
}

/// Returns an event as the page lists it: time, kind, text.
pub fn event_entry(event: &RunEvent) -> Value {
    json!([event.time_s, event.kind.name(), event.kind.describe()])
}
