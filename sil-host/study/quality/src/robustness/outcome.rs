//! Campaigns as tables and figures.

use std::collections::BTreeMap;

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Arms, Criterion, Ending, Robustness, Row};
use crate::distribution::Percentiles;
use crate::proportion::Proportion;

/// Number of worst runs listed.
const WORST: usize = 20;

/// Where the tip ends in the runs in which it was kept.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// Distance from the governed reference, m.
    pub error_m: Option<Percentiles>,
    /// Distance from the true edge where one holds it, m.
    pub to_edge_m: Option<Percentiles>,
}

impl Place {
    /// Collects the endings of runs: each with its error and its distance from the edge that holds it, m.
    pub fn of(runs: impl Iterator<Item = (Ending, f64, Option<f64>)> + Clone) -> Self {
        let kept = runs.filter(|(ending, ..)| ending.is_kept());
        let at_edge = kept
            .clone()
            .filter(|(ending, ..)| *ending == Ending::AtEdge);
        Self {
            error_m: Percentiles::of(kept.map(|(_, error_m, _)| error_m).collect()),
            to_edge_m: Percentiles::of(at_edge.filter_map(|(.., to_edge_m)| to_edge_m).collect()),
        }
    }
}

/// Outcome of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobustnessOutcome {
    /// The arms of the campaign.
    pub arms: Arms,
    /// Seed of the campaign.
    pub seed: u64,
    /// What counts as a success.
    pub criterion: Criterion,
    /// Changes to every run, also those that switch parts off.
    pub overrides: Vec<String>,
    /// Success rate.
    pub success: Proportion,
    /// Distance of the tip from the governed reference at the end of the runs in which it was kept, and how far before
    /// the edge it ends where an edge holds it.
    #[serde(flatten)]
    pub place: Place,
    /// Change of torque from tick to tick in these runs while the tip moves, N·m.
    pub torque_change_moving_nm: Option<Percentiles>,
    /// The same while it stands.
    pub torque_change_holding_nm: Option<Percentiles>,
    /// Part of these changes, standing, that reverse the one before, 0 to 1.
    pub torque_reversals: Option<Percentiles>,
    /// Standard deviation of the normal force while it stands, N.
    pub force_ripple_n: Option<Percentiles>,
    /// Number of runs with each ending.
    pub endings: BTreeMap<Ending, usize>,
    /// Number of times that contact was mistaken for flight, before any lift-off.
    pub false_alarms: u32,
    /// Simulated time after captures, h.
    pub slid_h: f64,
    /// Numbers of the worst runs: the most severe ending first, then the largest error.
    pub worst: Vec<usize>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl RobustnessOutcome {
    /// Collects all rows of a study.
    pub fn new(study: &Robustness, rows: Vec<Row>) -> Self {
        let criterion = study.criterion;
        let mut endings = BTreeMap::new();
        for row in &rows {
            *endings.entry(row.ending).or_insert(0) += 1;
        }
        let (succeeded, mut failed): (Vec<&Row>, Vec<&Row>) =
            rows.iter().partition(|row| criterion.holds(row.ending));
        failed.sort_by(|one, other| {
            let errors = other.error_m.total_cmp(&one.error_m);
            other.ending.cmp(&one.ending).then(errors)
        });
        let kept: Vec<&Row> = rows.iter().filter(|row| row.ending.is_kept()).collect();
        let of = |value: fn(&Row) -> Option<f64>| {
            Percentiles::of(kept.iter().filter_map(|row| value(row)).collect())
        };
        Self {
            arms: study.arms,
            seed: study.seed,
            criterion,
            overrides: study.overrides.clone(),
            success: Proportion::new(succeeded.len(), rows.len()),
            place: Place::of(
                rows.iter()
                    .map(|row| (row.ending, row.error_m, row.to_edge_m)),
            ),
            torque_change_moving_nm: of(|row| row.torque_change_moving_nm),
            torque_change_holding_nm: of(|row| row.torque_change_holding_nm),
            torque_reversals: of(|row| row.torque_reversals),
            force_ripple_n: of(|row| row.force_ripple_n),
            endings,
            false_alarms: rows.iter().map(|row| row.false_alarms).sum(),
            slid_h: rows.iter().map(|row| row.slid_s).sum::<f64>() / 3600.0 + 0.0,
            worst: failed.iter().take(WORST).map(|row| row.index).collect(),
            rows,
        }
    }

    /// Returns the shell command that repeats a run, for any number of a run.
    fn command(&self) -> String {
        let mut command = format!("painleve run --replay {}:INDEX", self.seed);
        if self.arms != Arms::Paper {
            command += &format!(" --arms {}", outcome::name(&self.arms));
        }
        for text in &self.overrides {
            command += &format!(" --set {}", outcome::quoted(text));
        }
        command
    }

    /// Returns the number of runs with this ending.
    pub fn count(&self, ending: Ending) -> usize {
        self.endings.get(&ending).copied().unwrap_or(0)
    }
}

impl Outcome for RobustnessOutcome {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "result",
            "runs",
            "μ",
            "belt (m/s)",
            "rate (Hz)",
            "error (mm)",
        ]);
        let success = format!("{} (95 %)", self.criterion.words());
        table.add_row([&success, &self.success.to_string(), "", "", "", ""]);
        for (name, scale, values) in [
            ("error (mm)", 1e3, &self.place.error_m),
            ("before the edge, − beyond (mm)", 1e3, &self.place.to_edge_m),
            (
                "torque change, moving (mN·m)",
                1e3,
                &self.torque_change_moving_nm,
            ),
            (
                "torque change, holding (mN·m)",
                1e3,
                &self.torque_change_holding_nm,
            ),
            (
                "reversals of torque, holding (%)",
                1e2,
                &self.torque_reversals,
            ),
            ("force ripple, holding (N)", 1.0, &self.force_ripple_n),
        ] {
            let values = values.as_ref().map_or("–".into(), |values| {
                let [median, p95] = [values.median, values.p95].map(|value| scale * value);
                format!("median {median:.3}, 95 %: {p95:.3}")
            });
            table.add_row([name, &values, "", "", "", ""]);
        }
        for (ending, count) in &self.endings {
            let mut runs = count.to_string();
            if *ending == Ending::AtEdge {
                // The others are held by the end of the reach, or by a p that is small but stays positive.
                let before = self.place.to_edge_m.map_or(0, |values| values.count);
                runs += &format!(", {before} of them before p = 0");
            }
            table.add_row([&outcome::name(ending), &runs, "", "", "", ""]);
        }
        let alarms = format!("{} in {:.2} h", self.false_alarms, self.slid_h);
        table.add_row(["false alarms", &alarms, "", "", "", ""]);
        for row in self.worst.iter().filter_map(|&index| self.rows.get(index)) {
            table.add_row([
                outcome::name(&row.ending),
                format!("run {}", row.index),
                format!("{:.2}", row.mu),
                format!("{:.2}", row.v_belt_m_s),
                row.tick_hz.to_string(),
                format!("{:.2}", 1e3 * row.error_m),
            ]);
        }
        if !self.worst.is_empty() {
            table.add_row(["to repeat a run", &self.command(), "", "", "", ""]);
        }
        table
    }
}
