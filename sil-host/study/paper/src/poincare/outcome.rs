//! The outcome of all cells: intervals of belt speed with the same regime.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Poincare, Row};
use crate::cells::Cells;
use crate::chaos::Regime;

/// The whole diagram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoincareDiagram {
    /// All cells, in the order of their numbers.
    pub rows: Vec<Row>,
    /// Intervals of adjacent belt speeds with the same regime.
    pub stretches: Vec<RegimeInterval>,
    #[serde(skip)]
    settings: Cells,
}

/// Adjacent belt speeds with the same regime.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegimeInterval {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Initial condition.
    pub initial: String,
    /// Ends of the interval of belt speed, m/s.
    pub v_belt_m_s: [f64; 2],
    /// Regime.
    pub regime: Regime,
    /// Returns per period.
    pub period: Option<usize>,
    /// Number of belt speeds.
    pub cells: usize,
    /// Smallest exponent, 1/s.
    pub least_exponent_per_s: Option<f64>,
    /// Largest exponent, 1/s.
    pub greatest_exponent_per_s: Option<f64>,
}

impl PoincareDiagram {
    /// Collects the rows of a study.
    pub fn new(study: &Poincare, rows: Vec<Row>) -> Self {
        let settings = study.cells.clone();
        let mut stretches: Vec<RegimeInterval> = Vec::new();
        for mu in 0..settings.mu.len() {
            for initial in 0..settings.initial.len() {
                let place = |v_belt: usize| {
                    (mu * settings.v_belt_m_s.len() + v_belt) * settings.initial.len() + initial
                };
                let mut line: Vec<&Row> = (0..settings.v_belt_m_s.len())
                    .map(|v_belt| &rows[place(v_belt)])
                    .collect();
                line.sort_by(|one, other| one.v_belt_m_s.total_cmp(&other.v_belt_m_s));
                let alike = |one: &&Row, other: &&Row| {
                    (one.regime, one.period) == (other.regime, other.period)
                };
                stretches.extend(line.chunk_by(alike).filter_map(RegimeInterval::of));
            }
        }
        Self {
            rows,
            stretches,
            settings,
        }
    }

    /// Returns the varied parameters.
    pub fn settings(&self) -> &Cells {
        &self.settings
    }
}

impl RegimeInterval {
    fn of(rows: &[&Row]) -> Option<Self> {
        let (first, last) = (rows.first()?, rows.last()?);
        let exponents = || rows.iter().filter_map(|row| row.exponent_per_s);
        Some(Self {
            mu: first.mu,
            initial: first.initial.clone(),
            v_belt_m_s: [first.v_belt_m_s, last.v_belt_m_s],
            regime: first.regime,
            period: first.period,
            cells: rows.len(),
            least_exponent_per_s: exponents().reduce(f64::min),
            greatest_exponent_per_s: exponents().reduce(f64::max),
        })
    }
}

impl Outcome for PoincareDiagram {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        self.rows.iter().flat_map(Row::lines)
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "μ",
            "from",
            "v_belt in m/s",
            "motion",
            "returns per period",
            "exponent in 1/s",
        ]);
        for stretch in &self.stretches {
            let [from, to] = stretch.v_belt_m_s;
            let exponents = stretch
                .least_exponent_per_s
                .zip(stretch.greatest_exponent_per_s);
            table.add_row([
                stretch.mu.to_string(),
                stretch.initial.clone(),
                format!("{from} … {to}"),
                outcome::name(&stretch.regime),
                stretch
                    .period
                    .map_or("–".into(), |period| period.to_string()),
                exponents.map_or("–".into(), |(least, greatest)| {
                    format!("{least:.2} … {greatest:.2}")
                }),
            ]);
        }
        table
    }
}
