//! The page of a recorded run as one HTML file that needs no network.

use std::io::Write;

use data_encoding::BASE64;
use painleve_files::atomic_file::AtomicFile;
use painleve_plant::scenario::Scenario;
use painleve_record::events::RunEvent;
use painleve_record::{RecordError, RecordedTick, Sink};
use serde_json::{Value, json};

use crate::events::{Totals, entry};
use crate::row::{BYTE_COLUMNS, COLUMNS, Follower, ROW_BYTES, Row};
use crate::thinning::Thinned;

/// Number of events listed individually; all are counted.
pub(crate) const LISTED_EVENTS: usize = 1000;

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
        "arm": arm(scenario),
        "settings": scenario.to_toml().unwrap_or_default(),
        "columns": COLUMNS,
        "byte_columns": BYTE_COLUMNS,
    })
}

/// Returns what the page draws an arm from.
pub fn arm(scenario: &Scenario) -> Value {
    json!({
        "link_length_m": scenario.arm.link_length_m,
        "height_m": scenario.arm.height_m,
    })
}

/// Writes the page of a run to a file that appears once it is complete.
pub struct PageFile {
    file: AtomicFile,
    description: Value,
    follower: Follower,
    rows: Thinned,
    events: Vec<Value>,
    totals: Totals,
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
            totals: Totals::default(),
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
        self.totals.count(event);
        if self.events.len() < LISTED_EVENTS {
            self.events.push(entry(event));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        let Self {
            mut file,
            mut description,
            rows,
            events,
            totals,
            ..
        } = *self;
        let rows = rows.finish();
        let mut bytes = Vec::with_capacity(rows.len() * ROW_BYTES);
        rows.iter().for_each(|row| row.write(&mut bytes));
        description["rows"] = BASE64.encode(&bytes).into();
        description["events"] = events.into();
        description["totals"] = json!(totals);
        let path = file.path().to_path_buf();
        file.write_all(html(&description).as_bytes())
            .map_err(|error| RecordError::write(&path, error))?;
        Ok(Some(file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::{ContactMode, Event};
    use painleve_record::events::EventKind;
    use painleve_shared::status::Fault;

    #[test]
    fn a_fault_after_the_last_listed_event_is_on_the_page() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.html");
        let file = AtomicFile::create(&path).unwrap();
        let mut page = PageFile::new(file, &Scenario::default());
        let lift_off = EventKind::Plant(Event::ModeChange {
            from: ContactMode::Stick,
            to: ContactMode::Flight,
        });
        let fault = EventKind::Fault(Fault::LiftOffTooLong);
        let lift_offs = (1..=1200).map(|number| (0.5 * f64::from(number), lift_off));
        for (time_s, kind) in lift_offs.chain([(601.0, fault), (602.0, fault)]) {
            page.event(&RunEvent { time_s, kind }).unwrap();
        }
        let file = Sink::finish(Box::new(page)).unwrap();
        file.unwrap().commit().unwrap();
        let html = std::fs::read_to_string(&path).unwrap();
        let text = fault.describe();
        let totals = format!(
            r#""totals":{{"fault":[2,[601.0,"fault","{text}"]],"lift-off":[1200,[0.5,"lift-off","#
        );
        assert!(html.contains(&totals));
    }
}
