//! The sections of the page. Every number in them comes from an outcome, and so does every
//! verdict; the words around them say why.
//!
//! - [`open_loop`]: Table II, Fig. 3 to 5
//! - [`closed_loop`]: Fig. 12, the sliding range, runs over time

pub mod closed_loop;
pub mod open_loop;

use painleve_chart::PlotError;

use super::page::Section;
use crate::Outcome;

/// What all sections have in common.
fn section(
    name: &str,
    title: &str,
    command: String,
    outcome: &impl Outcome,
) -> Result<Section, PlotError> {
    Ok(Section {
        name: name.into(),
        title: title.into(),
        command,
        svg: outcome.svg()?,
        table: Some(outcome.table()),
        files: ["svg", "csv", "json"]
            .map(|ending| format!("{name}.{ending}"))
            .to_vec(),
        ..Section::default()
    })
}
