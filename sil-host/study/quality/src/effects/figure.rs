//! The levels at which success falls below 99, 90 and 50 %, relative to those of a typical rig.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREY, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::{self, Figure};

use super::outcome::{EffectsOutcome, Fall, RATES, Series, number};

/// Ends of the axis of severity, log2 of the level over the typical one.
const LEAST: f64 = -4.0;
const MOST: f64 = 6.0;
/// Height of a line, drawn units: an effect's name above its levels.
const LINE: i32 = 84;
/// Distance of a name above the line of its levels, lines.
const NAME: f64 = 0.42;

impl Figure for EffectsOutcome {
    fn svg(&self) -> String {
        let mut panels: Vec<Panel> = Vec::new();
        let mut rest = self.effects.as_slice();
        while let Some(first) = rest.first() {
            let same = |series: &&Series| {
                series.controller == first.controller && series.contact == first.contact
            };
            let count = rest.iter().take_while(same).count();
            let (these, others) = rest.split_at(count);
            rest = others;
            panels.push(panel(these, panels.is_empty()));
        }
        Chart {
            title: "Tolerance of the closed loop to each effect".into(),
            subtitle: format!(
                "Share of {} random closed loops at each level, seed {}, that is {}; grey lines: the levels tried",
                self.runs,
                self.seed,
                self.criterion.words()
            ),
            x_title: "Level relative to the typical one given with each name, log₂ (1 is double)"
                .into(),
            x: Some(LEAST - 0.2..MOST),
            panels,
            ..Chart::default()
        }
        .svg()
    }
}

/// All effects of one controller on one contact.
fn panel(all: &[Series], is_first: bool) -> Panel {
    let shown: Vec<&Series> = all.iter().filter(|series| !series.is_without()).collect();
    let count = shown.len().max(1);
    let line = |index: usize| (count - index) as f64 - 0.75;
    let place = |series: &Series, level: f64| {
        let severity = series.effect().severity(level);
        libm::log2(severity).clamp(LEAST, MOST)
    };
    let mut marks = vec![Mark::Line {
        name: String::new(),
        colour: BLACK_INK,
        width: 2,
        dashed: true,
        points: vec![(0.0, 0.0), (0.0, count as f64)],
    }];
    for (index, series) in shown.iter().enumerate() {
        let y = line(index);
        let ends = [series.cells.first(), series.cells.last()]
            .map(|cell| (cell.map_or(LEAST, |cell| place(series, cell.level)), y));
        marks.push(Mark::Line {
            name: String::new(),
            colour: GREY,
            width: 2,
            dashed: false,
            points: ends.to_vec(),
        });
        let unit = match (series.typical, series.unit) {
            (1.0, "ticks") => "tick",
            (_, unit) => unit,
        };
        marks.push(Mark::Label {
            at: (LEAST, y + NAME),
            centred: false,
            text: format!("{}, {} {unit}", series.effect, number(series.typical)),
        });
    }
    // The rates that are lost first are drawn on top.
    let looks = [(BLUE_INK, 14), (ORANGE, 18), (VERMILLION, 22)];
    for (rate, (colour, size)) in RATES.iter().zip(looks).rev() {
        let points = shown.iter().enumerate().filter_map(|(index, series)| {
            let which = RATES.iter().position(|one| one == rate)?;
            let x = match series.falls_below[which] {
                Fall::Before => LEAST,
                Fall::At(level) => place(series, level),
                Fall::Beyond => return None,
            };
            Some((x, line(index)))
        });
        marks.push(Mark::Dots {
            name: if is_first {
                format!("below {:.0} %", 100.0 * rate)
            } else {
                String::new()
            },
            colour,
            size,
            points: points.collect(),
        });
    }
    let without = all.iter().find(|series| series.is_without());
    let without = without.and_then(|series| series.cells.first());
    let none = without.map_or(String::new(), |cell| {
        format!("without any effect: {:.1} %", 100.0 * cell.success.rate)
    });
    Panel {
        title: all.first().map_or(String::new(), |series| {
            format!(
                "{} on {} contact",
                series.controller,
                outcome::name(&series.contact)
            )
        }),
        note: none,
        y: Some(0.0..count as f64 + 0.05),
        y_ticks: 0,
        height: LINE * count as i32,
        marks,
        ..Panel::default()
    }
}
