//! The page that plays a run with others beside it.

use data_encoding::BASE64;
use painleve_plant::scenario::Scenario;
use painleve_record::comparison::{Comparison, Difference, Outcome, Run};
use painleve_shared::LinkMotion;
use serde_json::{Value, json};

use crate::events::Totals;
use crate::page::{LISTED_EVENTS, arm, description, html};
use crate::row::{Follower, ROW_BYTES, Row};
use crate::thinning::Thinned;

/// Returns the page of a comparison with its outcomes and differences. `scenario` is that of the first run.
pub fn comparison_html(
    comparison: &Comparison<'_>,
    outcomes: &[Outcome],
    differences: &[Difference],
    scenario: &Scenario,
) -> String {
    let runs = comparison.runs();
    let mut page = description(scenario);
    let mut encoded = runs
        .iter()
        .map(|run| BASE64.encode(&rows(run, scenario_of(run, scenario))));
    page["rows"] = encoded.next().into();
    let (listed, totals) = runs.first().map(events).unwrap_or_default();
    page["events"] = listed.into();
    page["totals"] = json!(totals);
    let others = runs.iter().enumerate().skip(1).zip(encoded);
    page["comparison"] = json!({
        "label": runs.first().map(|run| &run.label),
        "aligned": format!("Aligned at {}", comparison.alignment),
        "others": others.map(|((number, run), rows)| json!({
            "label": run.label, "shift_s": comparison.shift_s(number), "rows": rows,
            "arm": arm(scenario_of(run, scenario)),
        })).collect::<Vec<_>>(),
        "tables": tables(runs, outcomes, differences),
    });
    html(&page)
}

/// Returns the settings of a run; those of the first if they are not known.
fn scenario_of<'a>(run: &'a Run, first: &'a Scenario) -> &'a Scenario {
    run.scenario.as_ref().unwrap_or(first)
}

/// Returns the rows of a run.
fn rows(run: &Run, scenario: &Scenario) -> Vec<u8> {
    let mut follower = Follower::new(scenario);
    let mut rows = Thinned::default();
    // What a simulated arm does not have, such as a reference after a fault, no estimate replaces.
    let sources = 1 + usize::from(!run.table.knows("plant.p_per_kg"));
    for (tick, &time_s) in run.table.time_s.iter().enumerate() {
        let known = |names: [&str; 2]| {
            let value = |name: &str| run.table.column(name).get(tick).copied();
            let mut values = names.into_iter().take(sources).filter_map(value);
            values.find(|value| value.is_finite()).unwrap_or(f64::NAN)
        };
        let [belt_m_s, p_per_kg] =
            ["plant.belt_speed_m_s", "plant.p_per_kg"].map(|name| known([name; 2]));
        let theta = LinkMotion::new(
            known(["plant.theta1_rad", "estimates.theta1_rad"]),
            known(["plant.theta2_rad", "estimates.theta2_rad"]),
        );
        let followed = follower.advance(time_s, belt_m_s, &theta, p_per_kg);
        rows.push(&Row::of_columns(time_s, known, followed));
    }
    let rows = rows.finish();
    let mut bytes = Vec::with_capacity(rows.len() * ROW_BYTES);
    rows.iter().for_each(|row| row.write(&mut bytes));
    bytes
}

/// Returns the lift-offs and faults of a run as the page lists and counts them.
fn events(run: &Run) -> (Vec<Value>, Totals) {
    let lift_offs = run.lift_offs_s().into_iter().flatten();
    let lift_offs = lift_offs.map(|time_s| (time_s, "lift-off", "lift-off".to_owned()));
    let faults = run
        .table
        .changes("actuator.fault_number")
        // Not of a table that lacks it.
        .filter(|(_, _, fault)| *fault > 0.0)
        .map(|(time_s, _, fault)| (time_s, "fault", format!("fault {fault}")));
    let mut events: Vec<_> = lift_offs.chain(faults).collect();
    events.sort_by(|(one, ..), (other, ..)| one.total_cmp(other));
    let mut totals = Totals::default();
    let entries = events.into_iter().map(|(time_s, kind, text)| {
        let entry = json!([time_s, kind, text]);
        totals.add(kind, || entry.clone());
        entry
    });
    let mut entries: Vec<Value> = entries.collect();
    entries.truncate(LISTED_EVENTS);
    (entries, totals)
}

/// Returns the tables under the charts.
fn tables(runs: &[Run], outcomes: &[Outcome], differences: &[Difference]) -> Vec<Value> {
    let first = runs.first().map_or("", |run| &run.label);
    let mut tables = vec![
        json!({
            "title": "Outcome of each run",
            "head": Outcome::HEAD,
            "rows": outcomes.iter().map(Outcome::cells).collect::<Vec<_>>(),
        }),
        json!({
            "title": format!("Difference from {first}"),
            "head": Difference::HEAD,
            "rows": differences.iter().map(Difference::cells).collect::<Vec<_>>(),
        }),
    ];
    if let Some(settings) = settings(runs) {
        tables.push(settings);
    }
    tables
}

/// Returns the settings in which the runs differ from the first; `None` if there are none.
fn settings(runs: &[Run]) -> Option<Value> {
    let (first, others) = runs.split_first()?;
    let scenario = first.scenario.as_ref()?;
    let rows: Vec<_> = others
        .iter()
        .filter_map(|run| Some((run, scenario.differences(run.scenario.as_ref()?))))
        .flat_map(|(run, differences)| {
            differences.into_iter().map(|one| {
                let [key, first, second] = one.cells();
                [&run.label, key, first, second].map(str::to_owned)
            })
        })
        .collect();
    (!rows.is_empty()).then(|| {
        json!({
            "title": "Settings that differ",
            "head": ["run", "key", first.label, "here"],
            "rows": rows,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_record::comparison::COLUMNS;
    use painleve_record::run_table::RunTable;

    fn events_of(table: &str) -> (Vec<Value>, Totals) {
        let table = RunTable::of_csv(table.as_bytes(), &COLUMNS).unwrap();
        let (label, scenario) = ("run".into(), None);
        events(&Run {
            label,
            table,
            scenario,
        })
    }

    #[test]
    fn what_is_not_known_is_no_event() {
        let header =
            "time_s,estimates.tip_t_m,plant.mode_number,plant.p_per_kg,actuator.fault_number";
        let rows = |p: &str| format!("{header}\n0,0,3,{p},0\n1,0,0,{p},0\n2,0,0,{p},8\n");
        let fault = json!([2.0, "fault", "fault 8"]);
        let lift_off = json!([1.0, "lift-off", "lift-off"]);
        assert_eq!(events_of(&rows("1.5")).0, [lift_off, fault.clone()]);
        assert_eq!(events_of(&rows("")).0, [fault]);
        let nothing = events_of("time_s,estimates.tip_t_m\n0,0\n1,0\n2,0\n");
        assert_eq!(nothing.0, Vec::<Value>::new());
    }

    #[test]
    fn only_a_real_arm_has_estimates_for_what_is_not_known() {
        let header = "time_s,plant.p_per_kg,plant.reference_tip_t_m,estimates.reference_m";
        let reference = |p: &str| {
            let text = format!("{header}\n0,{p},,0.25\n");
            let run = Run {
                label: "run".into(),
                table: RunTable::of_csv(text.as_bytes(), &COLUMNS).unwrap(),
                scenario: None,
            };
            let bytes = rows(&run, &Scenario::default());
            let at = 8 + 4 * crate::row::COLUMNS
                .iter()
                .position(|name| *name == "reference_m")
                .unwrap();
            f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
        };
        assert_eq!(reference(""), 0.25);
        // After a fault, or before ENABLE.
        assert!(reference("1.5").is_nan());
    }

    #[test]
    fn events_that_are_not_listed_are_counted() {
        let mut table =
            "time_s,plant.mode_number,plant.p_per_kg,actuator.fault_number\n".to_owned();
        for tick in 0..2400 {
            table += &format!("{tick},{},1.5,{}\n", 3 * (1 - tick % 2), tick / 2399);
        }
        let (listed, totals) = events_of(&table);
        assert_eq!(listed.len(), LISTED_EVENTS);
        let (lift_off, fault) = (
            json!([1.0, "lift-off", "lift-off"]),
            json!([2399.0, "fault", "fault 1"]),
        );
        assert_eq!(
            json!(totals),
            json!({ "lift-off": [1200, lift_off], "fault": [1, fault] })
        );
    }
}
