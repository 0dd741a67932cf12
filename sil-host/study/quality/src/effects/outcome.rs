//! Success rates by level, and the levels at which success falls below 99, 90 and 50 %.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Contact, EFFECTS, EffectsStudy, RigEffect, Row, find};
use crate::distribution::Percentiles;
use crate::proportion::Proportion;
use crate::robustness::{Criterion, Place};

/// Success rates for which the study finds the levels.
pub const RATES: [f64; 3] = [0.99, 0.9, 0.5];

/// Success at one level of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelSuccess {
    /// Level, in the effect's unit.
    pub level: f64,
    /// Success rate.
    pub success: Proportion,
    /// Where the tip ends.
    #[serde(flatten)]
    pub place: Place,
}

/// Success at all levels of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Series {
    /// The controller.
    pub controller: String,
    /// The contact.
    pub contact: Contact,
    /// Name of the effect.
    pub effect: &'static str,
    /// The key that a level sets.
    pub key: &'static str,
    /// Unit of a level.
    pub unit: &'static str,
    /// Level of a typical rig.
    pub typical: f64,
    /// Success by level, from harmless to harmful.
    pub cells: Vec<LevelSuccess>,
    /// Levels at which success falls below 99, 90 and 50 %.
    pub falls_below: [Fall; 3],
}

/// Where the observed success falls below a rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fall {
    /// Already below without the effect.
    Before,
    /// Between two levels, interpolated; at the lowest level, if it is below there.
    At(f64),
    /// Not at the levels of the study.
    Beyond,
}

/// Outcome of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectsOutcome {
    /// Seed of all runs.
    pub seed: u64,
    /// What counts as a success.
    pub criterion: Criterion,
    /// Runs of each level.
    pub runs: usize,
    /// Success by controller, contact and effect.
    pub effects: Vec<Series>,
    /// All runs.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

impl EffectsOutcome {
    /// Collects all rows of a study.
    pub fn new(study: &EffectsStudy, rows: Vec<Row>) -> Self {
        let mut effects: Vec<Series> = Vec::new();
        for (place, rows) in study.cells().iter().zip(rows.chunks(study.runs.max(1))) {
            let succeeds = |row: &&Row| study.criterion.holds(row.ending);
            let cell = LevelSuccess {
                level: place.level,
                success: Proportion::new(rows.iter().filter(succeeds).count(), rows.len()),
                place: Place::of(
                    rows.iter()
                        .map(|row| (row.ending, row.error_m, row.to_edge_m)),
                ),
            };
            let (controller, effect) = (place.controller.to_string(), place.effect);
            match effects.last_mut() {
                Some(last) if last.is_of(&controller, place.contact, effect.name) => {
                    last.cells.push(cell);
                }
                _ => effects.push(Series {
                    controller,
                    contact: place.contact,
                    effect: effect.name,
                    key: effect.key,
                    unit: effect.unit,
                    typical: effect.typical,
                    cells: vec![cell],
                    falls_below: [Fall::Beyond; 3],
                }),
            }
        }
        let mut none = None;
        for series in &mut effects {
            if series.is_without() {
                none = series.cells.first().map(|cell| cell.success.rate);
            }
            series.falls_below = RATES.map(|rate| series.falls_below(rate, none));
        }
        Self {
            seed: study.seed,
            criterion: study.criterion,
            runs: study.runs,
            effects,
            rows,
        }
    }
}

impl Series {
    fn is_of(&self, controller: &str, contact: Contact, effect: &str) -> bool {
        self.controller == controller && self.contact == contact && self.effect == effect
    }

    /// Returns where success falls below a rate; `none` is the success without any effect.
    fn falls_below(&self, rate: f64, none: Option<f64>) -> Fall {
        let points = self
            .cells
            .iter()
            .map(|cell| (cell.level, cell.success.rate));
        let mut before: Option<(f64, f64)> = None;
        for (level, success) in points {
            if success < rate {
                return match before {
                    None if none.is_some_and(|none| none >= rate) => Fall::At(level),
                    None => Fall::Before,
                    Some((from, from_rate)) => {
                        let share = (from_rate - rate) / (from_rate - success);
                        // Levels above zero are spaced by factors.
                        Fall::At(if from > 0.0 && level > 0.0 {
                            from * libm::pow(level / from, share)
                        } else {
                            from + share * (level - from)
                        })
                    }
                };
            }
            before = Some((level, success));
        }
        Fall::Beyond
    }

    /// Whether these are the runs without any effect.
    pub(super) fn is_without(&self) -> bool {
        self.effect == EFFECTS[0].name
    }

    /// Returns the effect.
    pub(super) fn effect(&self) -> &'static RigEffect {
        find(self.effect).unwrap_or(EFFECTS[0])
    }
}

impl core::fmt::Display for Fall {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Before => f.pad("from the start"),
            Self::At(level) => f.pad(&number(*level)),
            Self::Beyond => f.pad("not reached"),
        }
    }
}

/// Returns a level with three significant digits at most.
pub(super) fn number(level: f64) -> String {
    let rounded: f64 = format!("{level:.2e}").parse().unwrap_or(level);
    if rounded != 0.0 && !(1e-3..1e5).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        format!("{rounded}")
    }
}

impl Outcome for EffectsOutcome {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller, contact",
            "effect, its key and unit",
            &format!("level: {} (95 %), %", self.criterion.words()),
            "error, mm: median (95 %)",
            "before the edge, mm",
            "observed rate below 99 %",
            "90 %",
            "50 %",
        ]);
        let mut before = String::new();
        for series in &self.effects {
            let loop_of = format!("{}, {}", series.controller, outcome::name(&series.contact));
            let cells = series.cells.iter().map(|cell| {
                let Proportion {
                    rate, lower, upper, ..
                } = cell.success;
                let [rate, lower, upper] = [rate, lower, upper].map(|share| 100.0 * share);
                let level = number(cell.level);
                format!("{level}: {rate:.0} ({lower:.0}–{upper:.0})")
            });
            let typical = series.cells.iter().rev().find(|cell| {
                let effect = series.effect();
                effect.severity(cell.level) <= 1.0
            });
            let place = typical.or(series.cells.first()).map(|cell| &cell.place);
            let millimetres = |of: fn(&Place) -> Option<Percentiles>| {
                place.and_then(of).map_or("–".into(), |values| {
                    let [median, p95] = [values.median, values.p95].map(|value| 1e3 * value);
                    format!("{median:.2} ({p95:.2})")
                })
            };
            // Not all runs are held by an edge.
            let held = place.and_then(|place| place.to_edge_m);
            let held = held.map_or(String::new(), |values| format!(", {} runs", values.count));
            let [most, some, half] = series.falls_below.map(|fall| fall.to_string());
            let is_new = before != loop_of;
            table.add_row([
                if is_new {
                    loop_of.clone()
                } else {
                    String::new()
                },
                series.name(),
                cells.collect::<Vec<_>>().join(", "),
                millimetres(|place| place.error_m),
                millimetres(|place| place.to_edge_m) + &held,
                most,
                some,
                half,
            ]);
            before = loop_of;
        }
        table
    }
}

impl Series {
    /// Returns the effect's name with key and unit.
    fn name(&self) -> String {
        if self.unit.is_empty() {
            format!("{} (`{}`)", self.effect, self.key)
        } else {
            format!("{} (`{}`, {})", self.effect, self.key, self.unit)
        }
    }
}
