//! Events as the page lists and counts them.

use std::collections::BTreeMap;

use painleve_record::events::RunEvent;
use serde::Serialize;
use serde_json::{Value, json};

/// Returns an event as the page lists it: time, kind, text.
pub fn entry(event: &RunEvent) -> Value {
    json!([event.time_s, event.kind.name(), event.kind.describe()])
}

/// What has happened, whether it is listed or not: the number of events of each kind, and the first one.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Totals(BTreeMap<&'static str, (u64, Value)>);

impl Totals {
    /// Counts an event.
    pub fn count(&mut self, event: &RunEvent) {
        self.add(event.kind.name(), || entry(event));
    }

    /// Counts an event of a kind, which the page lists as this entry.
    pub(crate) fn add(&mut self, kind: &'static str, entry: impl FnOnce() -> Value) {
        self.0.entry(kind).or_insert_with(|| (0, entry())).0 += 1;
    }
}
