//! The change of the share without each part, in the same runs, sorted; a panel for each condition.

use painleve_chart::style::{BLACK_INK, GREEN, GREY};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::{self, Figure};

use super::outcome::{Ablated, Ablation};

/// Height of a row, drawn units: a label and its bar.
const ROW: i32 = 84;

impl Figure for Ablation {
    fn svg(&self) -> String {
        let differences = self.rows.iter().filter(|row| row.without.is_some());
        let (mut low, mut high) = (-0.02_f64, 0.01_f64);
        for change in differences.map(Ablated::difference) {
            low = low.min(change.lower);
            high = high.max(change.upper);
        }
        // Room for the labels of short bars.
        let x = 103.0 * low..110.0 * high;
        let panels = self.by_condition().map(|rows| panel(rows, x.start));
        Chart {
            title: "Contribution of each part".into(),
            subtitle: "the same runs for every bar of a condition".into(),
            x_title: "Change of the share of runs in which the tip is kept (percentage points)"
                .into(),
            panels: panels.collect(),
            x: Some(x),
            ..Chart::default()
        }
        .svg()
    }
}

/// Returns the panel of a condition, with labels from `left` (percentage points).
fn panel(rows: &[Ablated], left: f64) -> Panel {
    let (whole, without): (Vec<&Ablated>, Vec<&Ablated>) =
        rows.iter().partition(|row| row.without.is_none());
    let mut rows: Vec<_> = without
        .into_iter()
        .map(|row| (row, row.difference()))
        .collect();
    rows.sort_by(|one, other| one.1.difference.total_cmp(&other.1.difference));
    let count = rows.len().max(1);
    let mut marks = vec![Mark::line("", GREY, vec![(0.0, 0.0), (0.0, count as f64)])];
    for (index, (row, change)) in rows.iter().enumerate() {
        let top = (count - index) as f64;
        let points = match format!("{:+.1}", 100.0 * change.difference) {
            zero if zero.ends_with("0.0") && zero.len() == 4 => "no change".into(),
            points => points.replace('-', "−"),
        };
        marks.push(Mark::Label {
            at: (0.99 * left, top - 0.3),
            centred: false,
            text: format!("{}: {points}", row.part()),
        });
        let line = |name: &str, colour, width, from: f64, to: f64| Mark::Line {
            name: name.into(),
            colour,
            width,
            dashed: false,
            points: vec![(100.0 * from, top - 0.74), (100.0 * to, top - 0.74)],
        };
        let named = |name| if index == 0 { name } else { "" };
        marks.push(line(named("change"), GREEN, 20, 0.0, change.difference));
        marks.push(line(
            named("95 % interval"),
            BLACK_INK,
            5,
            change.lower,
            change.upper,
        ));
    }
    let title = whole.first().map_or(String::new(), |row| {
        format!(
            "{}: with everything, {:.1} % of {} runs",
            outcome::name(&row.condition),
            100.0 * row.rate,
            row.runs
        )
    });
    Panel {
        title,
        y: Some(0.0..count as f64),
        y_ticks: 0,
        height: ROW * count as i32,
        marks,
        ..Panel::default()
    }
}
