//! The report of tick costs, as JSON and as a table.

use comfy_table::CellAlignment;
use painleve_process::terminal;
use painleve_shared::message::Health;
use serde::{Deserialize, Serialize};

use super::tick_times::WorstTick;
use super::{TickTimes, Unit};
use crate::{BoardError, ConnectedBoard, LineHealth};

/// Tick costs of one scenario. The field names are a contract: add to them, never rename them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimingReport {
    /// The scenario.
    pub scenario: String,
    /// Control rate, Hz.
    pub tick_hz: u32,
    /// Host of the controller.
    pub host: String,
    /// Measured quantity: `tick` for the work of a tick, `wake-up` for its latency.
    pub measured: String,
    /// Unit of all costs.
    pub unit: Unit,
    /// Ticks controlled.
    pub ticks: u64,
    /// Cheapest tick.
    pub min: u32,
    /// Median.
    pub median: u32,
    /// 99.9th percentile.
    pub p999: u32,
    /// Most expensive tick.
    pub max: u32,
    /// The most expensive tick with its circumstances.
    pub worst: Option<WorstTick>,
    /// Ticks not finished when the next was due.
    pub missed_deadlines: u64,
    /// Number of the fault latched at the end; null for none.
    pub fault: Option<u8>,
    /// Largest stack use on a board, bytes.
    pub stack_bytes: Option<u32>,
    /// The board's counters.
    pub board: Option<Health>,
    /// The host's counters of a board's line.
    pub line: Option<LineHealth>,
    /// Costs with their numbers of ticks, ascending.
    pub histogram: Vec<(u32, u64)>,
}

impl TimingReport {
    /// Makes the report of a board's ticks; reads the board's counters.
    ///
    /// # Errors
    /// [`BoardError`] if the board does not answer.
    pub fn of_board<B: ConnectedBoard>(
        scenario: &str,
        tick_hz: u32,
        times: &TickTimes,
        board: &mut B,
    ) -> Result<Self, BoardError> {
        let health = board.health()?;
        Ok(Self {
            stack_bytes: (health.stack_bytes > 0).then_some(health.stack_bytes),
            board: Some(health),
            line: board.line(),
            missed_deadlines: health.lapses.overruns.into(),
            ..Self::new(scenario, tick_hz, B::HOST, "tick", board.unit(), times)
        })
    }

    /// Makes the report of ticks on `host`.
    pub fn new(
        scenario: &str,
        tick_hz: u32,
        host: &str,
        measured: &str,
        unit: Unit,
        times: &TickTimes,
    ) -> Self {
        Self {
            scenario: scenario.into(),
            tick_hz,
            host: host.into(),
            measured: measured.into(),
            unit,
            ticks: times.ticks(),
            min: times.at_quantile(0.0),
            median: times.at_quantile(0.5),
            p999: times.at_quantile(0.999),
            max: times.at_quantile(1.0),
            worst: times.worst().cloned(),
            missed_deadlines: 0,
            fault: None,
            stack_bytes: None,
            board: None,
            line: None,
            histogram: times.histogram(),
        }
    }
}

/// Returns the reports as a table for readers, with one row each.
pub fn table(reports: &[TimingReport]) -> String {
    let first = reports.first();
    let head = first.map_or(String::new(), |first| {
        format!("{} on {}, {}", first.measured, first.host, first.unit)
    });
    let mut table = terminal::table([
        head.as_str(),
        "rate",
        "ticks",
        "min",
        "median",
        "p99.9",
        "max",
        "worst tick",
        "missed",
        "stack",
    ]);
    for report in reports {
        let worst = report.worst.as_ref().map_or("–".into(), |worst| {
            format!("{}, {}", worst.tick, worst.state)
        });
        let stack = report.stack_bytes;
        table.add_row([
            report.scenario.clone(),
            format!("{} Hz", report.tick_hz),
            report.ticks.to_string(),
            report.min.to_string(),
            report.median.to_string(),
            report.p999.to_string(),
            report.max.to_string(),
            worst,
            report.missed_deadlines.to_string(),
            stack.map_or("–".into(), |bytes| format!("{bytes} B")),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    terminal::readable_table(table)
}
