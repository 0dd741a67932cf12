//! The change of success without each part, in the same runs, sorted.

use painleve_chart::style::{BLACK_INK, GREEN, GREY};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::outcome::{Ablated, Ablation};

/// Height of a row, drawn units: a label and its bar.
const ROW: i32 = 84;

impl Figure for Ablation {
    fn svg(&self) -> String {
        let (whole, without): (Vec<&Ablated>, Vec<&Ablated>) =
            self.rows.iter().partition(|row| row.without.is_none());
        let mut rows: Vec<_> = without
            .into_iter()
            .map(|row| (row, row.difference()))
            .collect();
        rows.sort_by(|one, other| one.1.difference.total_cmp(&other.1.difference));
        let lower = rows.iter().map(|row| 100.0 * row.1.lower);
        let upper = rows.iter().map(|row| 100.0 * row.1.upper);
        // Room for the labels of short bars.
        let (low, high) = (lower.fold(-2.0, f64::min), upper.fold(1.0, f64::max));
        let x = 1.03 * low..1.1 * high;
        let count = rows.len().max(1);
        let mut marks = vec![Mark::line("", GREY, vec![(0.0, 0.0), (0.0, count as f64)])];
        for (index, (row, change)) in rows.iter().enumerate() {
            let top = (count - index) as f64;
            let points = match format!("{:+.1}", 100.0 * change.difference) {
                zero if zero.ends_with("0.0") && zero.len() == 4 => "no change".into(),
                points => points.replace('-', "−"),
            };
            marks.push(Mark::Label {
                at: (x.start + 0.01 * (x.end - x.start), top - 0.3),
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
        let whole = whole.first().map_or(String::new(), |row| {
            format!(
                "the same {} runs for every bar; with everything, {:.1} % succeed",
                row.runs,
                100.0 * row.rate
            )
        });
        Chart {
            title: "Contribution of each part".into(),
            subtitle: whole,
            x_title: "Change of success (percentage points)".into(),
            x: Some(x),
            panels: vec![Panel {
                title: "Part that is switched off".into(),
                y: Some(0.0..count as f64),
                y_ticks: 0,
                height: ROW * count as i32,
                marks,
                ..Panel::default()
            }],
            ..Chart::default()
        }
        .svg()
    }
}
