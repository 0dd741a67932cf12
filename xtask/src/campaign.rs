//! The campaigns of `cargo xtask test --all`: random arms and belts from a fresh seed, which is printed.

use std::hash::{BuildHasher, Hasher, RandomState};

use serde_json::Value;

use crate::command::{ChoreError, say};
use crate::under_test::printed_json;

/// A contact: its name, the arguments that select it, and the least lower limit of the success rate (Wilson, 95 %). With
/// the rates that the documentation prints, chance goes below it in fewer than one of 1,000 campaigns.
const CONTACTS: [(&str, &[&str], f64); 2] = [
    ("rigid", &[], 0.94),
    (
        "compliant, 1e5 N/m",
        &["--set", "contact.kind=compliant"],
        0.89,
    ),
];

const RUNS: u32 = 300;

/// Runs the campaigns and prints their rates.
///
/// # Errors
/// If the program fails, or a rate is too low.
pub fn run() -> Result<(), ChoreError> {
    // Every hasher has random keys.
    let random = RandomState::new().build_hasher().finish();
    let seed = (random >> 32).to_string();
    for (contact, selection, least) in CONTACTS {
        let rate = success(&seed, selection)?;
        let percent = |name: &str| 100.0 * rate[name].as_f64().unwrap_or(0.0);
        say(&format!(
            "campaign, {contact} contact, seed {seed}: {:.1} % of {RUNS} succeed (95 %: {:.1}–{:.1} %)",
            percent("rate"),
            percent("lower"),
            percent("upper")
        ))?;
        if percent("lower") < 100.0 * least {
            return Err(ChoreError(format!(
                "campaign, {contact} contact, seed {seed}: too few runs succeed"
            )));
        }
    }
    Ok(())
}

/// Returns the success rate of a campaign with its interval.
fn success(seed: &str, selection: &[&str]) -> Result<Value, ChoreError> {
    let runs = RUNS.to_string();
    let campaign = [
        "study",
        "robustness",
        "--json",
        "--runs",
        &runs,
        "--seed",
        seed,
    ];
    let mut report = printed_json(&[&campaign[..], selection].concat())?;
    Ok(report["success"].take())
}
