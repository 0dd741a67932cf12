//! Fig. 5: how the arm bounces. θ1 at each upward zero of θ̇1, and whether that goes on
//! periodically or chaotically, by the criterion of [`verdict`](super::chaos::verdict).

use std::collections::BTreeMap;

use comfy_table::Table;
use painleve_chart::PlotError;
use painleve_plant::PlantError;
use painleve_plant::mechanics::MotionError;
use serde::Serialize;

use super::attractor::advance_or_settle;
use super::cells::Cells;
use super::chaos::section::Returns;
use super::chaos::{Regime, Verdict};
use super::outcome::{self, Outcome};
use super::tabular::Tabular;
use super::{Study, StudyError, figure_5};

/// The diagram, cell by cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Poincare {
    /// Its cells.
    pub cells: Cells,
}

/// What the arm does in one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Initial condition: `a`, `d`, `u` or `random:K`.
    pub initial: String,
    /// Quiet, periodic, chaotic or undecided.
    pub regime: Regime,
    /// Returns per period, of a periodic motion whose period was found.
    pub period: Option<usize>,
    /// Largest Lyapunov exponent across the flow, 1/s: null where there are too few
    /// returns, and with a periodic motion that forgets deviations altogether (minus infinity).
    pub exponent_per_s: Option<f64>,
    /// Its standard error, 1/s.
    pub standard_error_per_s: Option<f64>,
    /// θ1 at each return, rad.
    pub theta1_rad: Vec<f64>,
}

impl Study for Poincare {
    type Row = Row;

    fn len(&self) -> usize {
        self.cells.len()
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let cell = self.cells.cell(index)?;
        let mut plant = self.cells.plant_of(&cell)?;
        let failed = |source: MotionError| StudyError::Plant {
            row: cell.to_string(),
            source: PlantError::new(source),
        };
        let mut returns = Returns::new(self.cells.plant.impact);
        if !advance_or_settle(&mut plant, self.cells.transient_s).map_err(failed)? {
            let until_s = plant.time_s() + self.cells.record_s;
            plant.advance(until_s, &mut returns).map_err(failed)?;
        }
        let verdict = Verdict::of(returns.returns());
        Ok(Row {
            mu: cell.mu,
            v_belt_m_s: cell.v_belt_m_s,
            initial: cell.initial.to_string(),
            regime: verdict.regime,
            period: verdict.period,
            exponent_per_s: verdict.exponent_per_s.filter(|value| value.is_finite()),
            standard_error_per_s: verdict.standard_error_per_s,
            theta1_rad: returns.returns().iter().map(|one| one.state[0]).collect(),
        })
    }
}

impl Tabular for Poincare {
    type Line = Line;

    fn lines(row: &Row) -> Vec<Line> {
        let line = |theta1_rad| Line {
            mu: row.mu,
            v_belt_m_s: row.v_belt_m_s,
            initial: row.initial.clone(),
            regime: row.regime,
            period: row.period,
            exponent_per_s: row.exponent_per_s,
            standard_error_per_s: row.standard_error_per_s,
            theta1_rad,
        };
        if row.theta1_rad.is_empty() {
            return vec![line(None)];
        }
        row.theta1_rad.iter().copied().map(Some).map(line).collect()
    }

    fn seeds(&self) -> Result<BTreeMap<String, u64>, StudyError> {
        Ok(self.cells.seeds())
    }
}

/// The whole diagram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagram {
    /// All cells, in the order of their numbers.
    pub rows: Vec<Row>,
    /// Neighbouring belt speeds with the same kind of motion.
    pub stretches: Vec<Stretch>,
    #[serde(skip)]
    settings: Cells,
}

/// Neighbouring belt speeds with the same kind of motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stretch {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Initial condition.
    pub initial: String,
    /// Belt speeds from … to, m/s.
    pub v_belt_m_s: [f64; 2],
    /// Kind of motion.
    pub regime: Regime,
    /// Returns per period.
    pub period: Option<usize>,
    /// How many belt speeds.
    pub cells: usize,
    /// Least exponent, 1/s.
    pub least_exponent_per_s: Option<f64>,
    /// Greatest exponent, 1/s.
    pub greatest_exponent_per_s: Option<f64>,
}

/// One return in the CSV file; a cell without returns has one line without θ1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    mu: f64,
    v_belt_m_s: f64,
    initial: String,
    regime: Regime,
    period: Option<usize>,
    exponent_per_s: Option<f64>,
    standard_error_per_s: Option<f64>,
    theta1_rad: Option<f64>,
}

impl Diagram {
    /// Puts the rows of a study together.
    pub fn new(study: &Poincare, rows: Vec<Row>) -> Self {
        let settings = study.cells.clone();
        let mut stretches: Vec<Stretch> = Vec::new();
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
                stretches.extend(line.chunk_by(alike).filter_map(Stretch::of));
            }
        }
        Self {
            rows,
            stretches,
            settings,
        }
    }

    /// What was varied.
    pub fn settings(&self) -> &Cells {
        &self.settings
    }
}

impl Stretch {
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

impl Outcome for Diagram {
    type Line = Line;

    fn lines(&self) -> Vec<Line> {
        self.rows.iter().flat_map(Poincare::lines).collect()
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
                stretch.regime.name().to_owned(),
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

    fn svg(&self) -> Result<String, PlotError> {
        figure_5::chart(self).svg()
    }
}
