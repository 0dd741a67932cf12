//! The figure of the work-precision diagram, and the rows from which it is drawn.

use std::path::Path;

use painleve_chart::style::{
    BLACK_INK, BLUE_INK, Colour, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION,
};
use painleve_chart::{Chart, Mark, Panel};

pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// One measured point.
pub struct Row {
    pub ticks: usize,
    pub program: String,
    pub setting: f64,
    pub cpu_s_per_s: f64,
    pub error_rad: f64,
}

/// Reads the rows of an earlier run with this many ticks in a second.
pub fn kept(ticks: usize, results: &Path) -> Outcome<Vec<Row>> {
    let text = std::fs::read_to_string(results)?;
    let prefix = format!("{},", ticks);
    let lines = text.lines().filter_map(|line| line.strip_prefix(&prefix));
    lines.map(|line| row(ticks, line)).collect()
}

/// Returns whether a program is this project's.
pub fn is_ours(program: &str) -> bool {
    program.starts_with("painleve")
}

/// Reads a line "program,setting,cost,error" whose program may contain commas.
pub fn row(ticks: usize, line: &str) -> Outcome<Row> {
    let parts: Vec<&str> = line.rsplitn(4, ',').collect();
    let [error, cost, setting, program] = parts[..] else {
        return Err(format!("not a row: {line}").into());
    };
    Ok(Row {
        ticks,
        program: program.trim_matches('"').into(),
        setting: setting.parse()?,
        cpu_s_per_s: cost.parse()?,
        error_rad: error.parse()?,
    })
}

/// Draws the rows of both panels.
pub fn svg(rows: &[Row]) -> String {
    let colours: [Colour; 10] = [
        BLUE_INK, SKY, GREEN, PURPLE, ORANGE, VERMILLION, BLACK_INK, GREY, BLUE_INK, GREEN,
    ];
    let mut programs: Vec<&str> = rows.iter().map(|row| row.program.as_str()).collect();
    programs.sort_by_key(|name| (!is_ours(name), *name));
    programs.dedup();
    let panel = |count: usize, title: &str| {
        let curves = programs.iter().zip(colours).flat_map(|(program, colour)| {
            let points: Vec<_> = rows
                .iter()
                .filter(|row| row.ticks == count && row.program == *program && row.error_rad < 1.0)
                .map(|row| (row.cpu_s_per_s.log10(), row.error_rad.max(1e-15).log10()))
                .collect();
            let named = count == PANELS[0].0;
            [
                Mark::Line {
                    name: if named {
                        (*program).into()
                    } else {
                        String::new()
                    },
                    colour,
                    width: if is_ours(program) { 5 } else { 3 },
                    dashed: !is_ours(program),
                    points: points.clone(),
                },
                Mark::Dots {
                    name: String::new(),
                    colour,
                    size: 12,
                    points,
                },
            ]
        });
        Panel {
            title: title.into(),
            note: "error (rad)".into(),
            y: Some(-15.5..-1.0),
            y_labels: Some(powers([-15, -12, -9, -6, -3])),
            marks: curves.collect(),
            height: 560,
            ..Panel::default()
        }
    };
    Chart {
        title: "Error against cost: one second of sliding".into(),
        subtitle: "largest deviation of a link angle from the rigid arm's solution; one thread; from loose to tight settings along each curve"
            .into(),
        x_title: "CPU time per simulated second (s)".into(),
        x_labels: Some(powers([-5, -4, -3, -2, -1, 0])),
        panels: PANELS.map(|(count, title)| panel(count, title)).into(),
        ..Chart::default()
    }
    .svg()
}

/// Returns powers of ten as labels of a logarithmic axis.
fn powers<const N: usize>(exponents: [i32; N]) -> Vec<(f64, String)> {
    let raised = |digit: char| match digit.to_digit(10) {
        Some(digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize).unwrap_or(' '),
        None => '⁻',
    };
    let label = |exponent: i32| match exponent {
        0 => "1".to_owned(),
        _ => format!(
            "10{}",
            exponent.to_string().chars().map(raised).collect::<String>()
        ),
    };
    exponents
        .map(|exponent| (f64::from(exponent), label(exponent)))
        .into()
}

/// Panels of the figure: ticks in a second, and title.
pub const PANELS: [(usize, &str); 2] = [
    (1000, "A new torque every millisecond"),
    (20, "A new torque every 50 ms"),
];
