//! What `painleve identify` tells of an arm: as text, as one JSON object, and as a page with the figure.

use core::fmt::Write;

use painleve_chart::markup::{document, escaped};
use painleve_commission::identification::Found;
use painleve_identify::Parameter;
use painleve_identify::parameters::JOINT_NAMES;
use painleve_identify::torques::{Cell, Estimate, Joint};
use painleve_process::terminal;
use serde_json::{Value, json};

use super::residuals;

/// Part by which the friction on the belt differs from the scenario's if this is told.
const OTHER_FRICTION: f64 = 0.1;

/// A table for readers.
struct Table {
    header: [&'static str; 4],
    rows: Vec<[String; 4]>,
}

/// Returns the result as text.
pub fn text(found: &Found) -> String {
    let mut text = String::new();
    for Table { header, rows } in [geometry(found), joints(found), cells(found)] {
        let mut table = terminal::table(header);
        table.add_rows(rows);
        text += &terminal::readable_table(table);
        text.push('\n');
    }
    text + &terminal::readable(sentences(found).join("\n"))
}

/// Returns the result as a page, with what has `changed` and the `place` where the tip may be set down.
pub fn html(name: &str, found: &Found, changed: &[String], place: &str) -> String {
    let mut body = String::new();
    for change in changed {
        // Writing to a string does not fail.
        let _ = write!(body, "<p>Warning: {}.</p>", escaped(change));
    }
    for sentence in sentences(found).iter().map(String::as_str).chain([place]) {
        let _ = write!(body, "<p>{}</p>", escaped(sentence));
    }
    for Table { header, rows } in [geometry(found), joints(found), cells(found)] {
        body += "<table><tr>";
        for name in header {
            let _ = write!(body, "<th>{name}");
        }
        for row in rows {
            body += "<tr>";
            for cell in row {
                let _ = write!(body, "<td>{}", escaped(&cell));
            }
        }
        body += "</table>";
    }
    body += &residuals::svg(found);
    document(&format!("Identification: {name}"), &body)
}

/// Returns the result as JSON.
pub fn json(found: &Found) -> Value {
    let identified = &found.identified;
    let fit = &identified.fit;
    let parameters = Parameter::ALL.map(|parameter| {
        json!({
            "parameter": parameter.to_string(),
            "unit": parameter.unit(),
            "value": fit.parameters.get(parameter),
            "deviation": fit.deviation(parameter),
            "before": found.prior.parameters.get(parameter),
            "deviation_before": found.prior.deviations[parameter.index()],
        })
    });
    let of = |it: Estimate| json!({ "value": it.value, "deviation": it.deviation });
    let of_cell = |cell: Cell| {
        json!({
            "gain": of(cell.gain),
            "cross_talk": of(cell.cross_talk),
            "zero_n": of(cell.zero_n),
        })
    };
    let of_joint = |joint: Joint| {
        json!({
            "coulomb_friction_nm": of(joint.friction_nm),
            "stiffness_nm_rad": of(joint.stiffness_nm_rad),
            "stage_gain": of(joint.gain),
            "offset_nm": of(joint.offset_nm),
        })
    };
    json!({
        "parameters": parameters,
        "joints": found.joints.joints.map(of_joint),
        "force_cells": found.joints.cells.map(of_cell),
        "friction": found.friction,
        "further_tilt_rad": of(found.joints.tilt_rad),
        "torque_left_over_nm": found.joints.left_over_nm,
        "tip_deviation_m": identified.tip_deviation_m,
        "tip_deviation_before_m": found.prior.tip_deviation_m(),
        "place_deviation_m": identified.place_deviation_m,
        "off_line_m": identified.off_line_m,
        "ripple_m_s2": found.ripple_m_s2,
        "readings": identified.readings,
        "sentences": sentences(found),
    })
}

fn sentences(found: &Found) -> Vec<String> {
    let identified = &found.identified;
    let [off_before_m, off_after_m] = identified.off_line_m;
    let of_torques = match found.joints.left_over_nm {
        Some([before_nm, after_nm]) => format!(
            "The arm's model explains the torques to {:.0} mN·m (with all but the geometry as in the scenario: {:.0} mN·m).",
            1e3 * after_nm,
            1e3 * before_nm
        ),
        None => "The torques show nothing of friction and springs: in no tenth of a second has a joint turned far enough in one direction with the tip on the belt. What the scenario says of them stays."
            .into(),
    };
    let tilt = found.joints.tilt_rad;
    let length = identified.fit.parameters.get(Parameter::Length);
    let length_deviation = identified.fit.deviation(Parameter::Length) / length;
    let mut sentences = vec![
        format!(
            "The tip stays on a line to {:.3} mm (by the values before: {:.2} mm), in {} readings.",
            1e3 * off_after_m,
            1e3 * off_before_m,
            identified.readings
        ),
        format!(
            "The tip's position is known to {:.2} mm plus {:.2} % for the length of link 1; its distance from the edges to {:.2} mm \
             (for an arm known only from its drawing: {:.1} mm).",
            1e3 * identified.place_deviation_m,
            100.0 * length_deviation,
            1e3 * identified.tip_deviation_m,
            1e3 * found.prior.tip_deviation_m()
        ),
        of_torques,
        format!(
            "Waves, vibration, unknown torques and the force cell's noise act like accelerations of the tip off the belt of {:.2} m/s² (root mean square), from which \
             controller.governor.p_per_kg follows.",
            found.ripple_m_s2
        ),
        format!(
            "According to the slides, the belt is tilted by {} mrad more than belt_tilt_rad says; check this with a level.",
            spread(1e3 * tilt.value, 1e3 * tilt.deviation, 0)
        ),
    ];
    let told = found.told_friction;
    if (found.friction / told - 1.0).abs() > OTHER_FRICTION {
        sentences.push(format!(
            "The friction coefficient of the tip on the belt is {:.2} according to the slides, but {told:.2} in the scenario: set belt.friction, on which the place to set the tip down depends.",
            found.friction
        ));
    }
    for (joint, name) in found.joints.joints.iter().zip(JOINT_NAMES) {
        if joint.drives_itself() {
            sentences.push(format!(
                "The friction of {name} comes out below zero, which no joint has: check the arm's masses and springs, and the force cell."
            ));
        }
        if joint.has_offset() {
            let as_of = joint.rest_error_rad().map_or(String::new(), |rad| {
                let farther = format!("{rad:+.3}").replace('-', "−");
                format!(", as if its spring rested {farther} rad from spring_rest_rad in arm_model")
            });
            sentences.push(format!(
                "The torque of {name} has a constant part of {} mN·m that the model lacks{as_of}: check the spring, and the stage's torque at a command of zero.",
                spread(1e3 * joint.offset_nm.value, 1e3 * joint.offset_nm.deviation, 0)
            ));
        }
        if joint.has_another_gain() {
            sentences.push(format!(
                "The torque stage of {name} seems to give {:.2} times the commanded torque: check converters.stages.",
                joint.gain.value
            ));
        }
    }
    sentences
}

/// Returns the geometry, with angles in milliradians and lengths in millimetres.
fn geometry(found: &Found) -> Table {
    let (before, fit) = (&found.prior, &found.identified.fit);
    let rows = Parameter::ALL.map(|parameter| {
        let (scale, unit) = match parameter.unit() {
            "" => (1.0, String::new()),
            unit => (1e3, format!("m{unit}")),
        };
        let of = |value: f64, deviation: f64| spread(scale * value, scale * deviation, 3);
        let known = before.deviations[parameter.index()];
        [
            parameter.to_string(),
            of(before.parameters.get(parameter), known),
            of(fit.parameters.get(parameter), fit.deviation(parameter)),
            unit,
        ]
    });
    Table {
        header: ["", "before", "now", "unit"],
        rows: rows.into(),
    }
}

/// Returns what the torques show. No setting takes the gain of a stage or a constant torque: they are for information.
fn joints(found: &Found) -> Table {
    type Of = fn(&Joint) -> Estimate;
    let rows: [(&str, Of, f64, usize, &str); 4] = [
        ("friction", |it| it.friction_nm, 1e3, 1, "mN·m"),
        (
            "stiffness of the spring",
            |it| it.stiffness_nm_rad,
            1.0,
            3,
            "N·m/rad",
        ),
        ("torque to commanded torque", |it| it.gain, 1.0, 2, ""),
        ("constant torque", |it| it.offset_nm, 1e3, 0, "mN·m"),
    ];
    let rows = rows.map(|(name, of, scale, digits, unit)| {
        let [one, two] = found.joints.joints.map(|joint| {
            let Estimate { value, deviation } = of(&joint);
            spread(scale * value, scale * deviation, digits)
        });
        [name.into(), one, two, unit.into()]
    });
    Table {
        header: ["", "joint 1", "elbow", "unit"],
        rows: rows.into(),
    }
}

/// Returns what the torques show of the force cells. No setting takes it: it is for information.
fn cells(found: &Found) -> Table {
    type Of = fn(&Cell) -> Estimate;
    let rows: [(&str, Of, usize, &str); 3] = [
        ("reading to force", |it| it.gain, 3, ""),
        ("share of the other force", |it| it.cross_talk, 3, ""),
        ("reading without a force", |it| it.zero_n, 2, "N"),
    ];
    let rows = rows.map(|(name, of, digits, unit)| {
        let [along, normal] = found.joints.cells.map(|cell| {
            let Estimate { value, deviation } = of(&cell);
            spread(value, deviation, digits)
        });
        [name.into(), along, normal, unit.into()]
    });
    Table {
        header: ["", "along the belt", "normal force", "unit"],
        rows: rows.into(),
    }
}

fn spread(value: f64, deviation: f64, digits: usize) -> String {
    format!("{value:.digits$} ± {deviation:.digits$}").replace('-', "−")
}
