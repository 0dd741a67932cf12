//! The page that plays a run with others beside it.

use data_encoding::BASE64;
use painleve_plant::scenario::{Scenario, describe};
use painleve_record::comparison::{Comparison, Run};
use painleve_shared::LinkMotion;
use serde_json::{Value, json};

use crate::page::{description, html};
use crate::row::{Follower, ROW_BYTES, Row};
use crate::thinning::Thinned;

/// Returns the page of a comparison. `scenario` is that of the first run.
pub fn comparison_html(runs: &[Run], comparison: &Comparison<'_>, scenario: &Scenario) -> String {
    let mut page = description(scenario);
    let mut encoded = runs
        .iter()
        .map(|run| BASE64.encode(&rows(run, run.scenario.as_ref().unwrap_or(scenario))));
    page["rows"] = encoded.next().into();
    page["events"] = runs.first().map(events).into();
    let others = runs.iter().enumerate().skip(1).zip(encoded);
    page["comparison"] = json!({
        "label": runs.first().map(|run| &run.label),
        "aligned": format!("Aligned at {}", comparison.alignment),
        "others": others.map(|((number, run), rows)| json!({
            "label": run.label, "shift_s": comparison.shift_s(number), "rows": rows,
        })).collect::<Vec<_>>(),
        "tables": tables(runs, comparison),
    });
    html(&page)
}

/// Returns the rows of a run.
fn rows(run: &Run, scenario: &Scenario) -> Vec<u8> {
    let mut follower = Follower::new(scenario);
    let mut rows = Thinned::default();
    for (tick, &time_s) in run.table.time_s.iter().enumerate() {
        let known = |names: [&str; 2]| {
            let value = |name: &str| run.table.column(name).get(tick).copied();
            let mut values = names.into_iter().filter_map(value);
            values.find(|value| value.is_finite()).unwrap_or(f64::NAN)
        };
        let angle = |joint| {
            known([
                &format!("plant.theta{joint}_rad"),
                &format!("estimates.theta{joint}_rad"),
            ])
        };
        let [belt_m_s, p_per_kg] =
            ["plant.belt_speed_m_s", "plant.p_per_kg"].map(|name| known([name; 2]));
        let theta = LinkMotion::new(angle(1), angle(2));
        let followed = follower.advance(time_s, belt_m_s, &theta, p_per_kg);
        rows.push(&Row::of_columns(time_s, known, followed));
    }
    let rows = rows.finish();
    let mut bytes = Vec::with_capacity(rows.len() * ROW_BYTES);
    rows.iter().for_each(|row| row.write(&mut bytes));
    bytes
}

/// Returns the lift-offs and faults of a run as the page lists them.
fn events(run: &Run) -> Vec<Value> {
    let changes = |column: &str, kind: &str, is_event: fn(f64, f64) -> bool| {
        let pairs = run
            .table
            .column(column)
            .windows(2)
            .zip(run.table.time_s.iter().skip(1));
        let events = pairs.filter(|(pair, _)| is_event(pair[0], pair[1]));
        events
            .map(|(pair, time_s)| match kind {
                "fault" => json!([time_s, kind, format!("fault {}", pair[1])]),
                _ => json!([time_s, kind, kind]),
            })
            .collect::<Vec<_>>()
    };
    let mut events = changes("plant.mode_number", "lift-off", |from, to| {
        from != 0.0 && to == 0.0
    });
    events.extend(changes("actuator.fault_number", "fault", |from, to| {
        from != to && to != 0.0
    }));
    events.sort_by(|one, other| {
        one[0]
            .as_f64()
            .unwrap_or_default()
            .total_cmp(&other[0].as_f64().unwrap_or_default())
    });
    events
}

/// Returns the tables under the charts.
fn tables(runs: &[Run], comparison: &Comparison<'_>) -> Vec<Value> {
    let number = |value: Option<f64>, digits: i32| {
        value.map_or("–".into(), |value| Comparison::decimals(value, digits))
    };
    let outcomes = comparison.outcomes().into_iter().map(|one| {
        vec![
            one.run,
            number(Some(one.event_s), 3),
            number(Some(one.duration_s), 3),
            one.lift_offs.map_or("–".into(), |count| count.to_string()),
            number(one.first_lift_off_s, 3),
            if one.fault == 0 {
                "none".into()
            } else {
                one.fault.to_string()
            },
            number(one.final_tip_mm, 2),
            number(one.final_error_mm, 2),
        ]
    });
    let differences = comparison.differences().into_iter().map(|one| {
        vec![
            one.run,
            Comparison::label(one.quantity),
            number(Some(one.mean), 3),
            number(Some(one.rms), 3),
            number(Some(one.largest), 3),
            number(Some(one.at_s), 3),
        ]
    });
    let mut tables = vec![
        json!({
            "title": "Outcome of each run",
            "head": ["run", "event, s", "duration after it, s", "lift-offs after it", "first, s", "fault", "final tip, mm", "final error, mm"],
            "rows": outcomes.collect::<Vec<_>>(),
        }),
        json!({
            "title": format!("Difference from {}", runs.first().map_or("", |run| &run.label)),
            "head": ["run", "quantity", "mean", "RMS", "largest", "after the event, s"],
            "rows": differences.collect::<Vec<_>>(),
        }),
    ];
    if let Some(settings) = settings(runs) {
        tables.push(settings);
    }
    tables
}

/// Returns the settings in which the runs differ from the first; `None` if no other run has settings.
fn settings(runs: &[Run]) -> Option<Value> {
    let (first, others) = runs.split_first()?;
    let scenario = first.scenario.as_ref()?;
    let absent = || "absent".to_owned();
    let rows: Vec<_> = others
        .iter()
        .filter_map(|run| Some((run, scenario.differences(run.scenario.as_ref()?))))
        .flat_map(|(run, differences)| {
            let row = |one: describe::Difference| {
                [
                    run.label.clone(),
                    one.key,
                    one.first.unwrap_or_else(absent),
                    one.second.unwrap_or_else(absent),
                ]
            };
            differences.into_iter().map(row)
        })
        .collect();
    Some(json!({
        "title": "Settings that differ",
        "head": ["run", "key", first.label, "here"],
        "rows": rows,
    }))
}
