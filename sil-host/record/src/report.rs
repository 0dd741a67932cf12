//! The report of a run: one JSON object for programs, one table for readers.

use std::time::Duration;

use comfy_table::CellAlignment;
use hdrhistogram::Histogram;
use painleve_plant::closed_loop::LoopResult;
use painleve_plant::decimal::as_written;
use painleve_plant::scenario::Scenario;
use painleve_process::terminal;
use painleve_shared::{Arm, Pose};
use serde::{Deserialize, Serialize};

use crate::paradox::ParadoxDistance;

/// Percentiles of a duration, µs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DurationPercentiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Largest.
    pub max: f64,
}

impl DurationPercentiles {
    /// Returns the percentiles of a histogram of nanoseconds; `None` if it is empty.
    pub fn of_ns(histogram: &Histogram<u64>) -> Option<Self> {
        let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1e3;
        (!histogram.is_empty()).then(|| Self {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: histogram.max() as f64 / 1e3,
        })
    }
}

/// Report of a run. The field names are an interface contract: add fields, never rename them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the control law.
    pub controller: String,
    /// The host that ran the controller.
    pub host: String,
    /// Control ticks run.
    pub ticks: u64,
    /// Control rate, Hz.
    pub tick_hz: u32,
    /// Simulated time, s.
    pub sim_s: f64,
    /// Wall-clock time, s.
    pub wall_s: f64,
    /// Ratio of simulated to wall-clock time.
    pub realtime_factor: f64,
    /// Number of lift-offs: contacts that ended in flight.
    pub lift_offs: u64,
    /// Time of the first lift-off, s.
    pub first_lift_off_s: Option<f64>,
    /// Whether the tip was captured, by a contact of 0.1 s, and never lifted off again, without a fault.
    #[serde(default)]
    pub kept: bool,
    /// Number of collisions of the tip with the belt.
    pub impacts: u64,
    /// Number of impacts without collision.
    pub impacts_without_collision: u64,
    /// Smallest tip position, m.
    #[serde(default)]
    pub min_tip_t_m: f64,
    /// Largest tip position, m.
    pub max_tip_t_m: f64,
    /// Tip position at the end, m.
    pub final_tip_t_m: f64,
    /// Reference at the end, m; null if the controller follows none then.
    pub final_reference_m: Option<f64>,
    /// End of the reference that the scenario requests, before any edge holds it back, m; null if it
    /// requests none.
    #[serde(default)]
    pub requested_target_m: Option<f64>,
    /// Whether the governor holds the reference back at the end.
    #[serde(default)]
    pub at_edge: bool,
    /// Distance of the tip from the governed reference at the end, m; null without one.
    #[serde(default)]
    pub error_m: Option<f64>,
    /// Distance of the tip at the end from the place with p = 0 towards the request, m; null unless such an edge, and not
    /// the end of the reach or another limit of the governor, holds the reference back.
    #[serde(default)]
    pub to_edge_m: Option<f64>,
    /// Part of the governor's distance from the edges that is kept for what is not known of the arm, m; 0 unless an edge
    /// holds the reference back at the end.
    #[serde(default)]
    pub distance_for_knowledge_m: f64,
    /// In words, what that distance is kept for above all; null without it.
    #[serde(default)]
    pub chief_doubt: Option<String>,
    /// Least p that is kept where `controller.governor.p_per_kg` and not p/Q22 holds the reference back, 1/kg; null elsewhere.
    #[serde(default)]
    pub kept_p_per_kg: Option<f64>,
    /// Smallest normal force after the first 50 ms, N; null for shorter runs.
    pub min_normal_force_n: Option<f64>,
    /// Largest joint torque, N·m.
    pub peak_torque_nm: f64,
    /// Change of torque from tick to tick while the tip moves, N·m: root mean square over ticks and joints; null without
    /// such ticks.
    #[serde(default)]
    pub torque_change_moving_nm: Option<f64>,
    /// The same while it stands.
    #[serde(default)]
    pub torque_change_holding_nm: Option<f64>,
    /// Share of changes of torque that reverse the one before while the tip stands, 0 to 1.
    #[serde(default)]
    pub torque_reversals: Option<f64>,
    /// Standard deviation of the normal force while the tip stands, N.
    #[serde(default)]
    pub force_ripple_n: Option<f64>,
    /// Fraction of the time in contact.
    pub contact_fraction: f64,
    /// Number of ticks on which the controller limited its torque.
    pub saturated_ticks: u64,
    /// Number of ticks whose answer did not arrive in time.
    pub stale_ticks: u64,
    /// Time from sensor frame to answer, µs; null without any answer.
    pub round_trip_us: Option<DurationPercentiles>,
    /// Hash of all sensor and actuator frames in order.
    pub log_hash: String,
    /// Seed of all noise generators.
    pub seed: u64,
    /// Pacing of the run.
    pub pacing: String,
    /// Time at which the torque stages removed the torque for lack of commands, s; null if never.
    #[serde(default)]
    pub drive_watchdog_s: Option<f64>,
    /// Files that the run wrote; bytes of their names that are not UTF-8 are replaced.
    #[serde(default)]
    pub files: Vec<String>,
    /// Number of the fault latched at the end; null for none.
    pub fault: Option<u8>,
    /// Meaning of that fault.
    pub fault_description: Option<String>,
    /// Lateness of wake-ups in real-time pacing, µs.
    pub wake_up_us: Option<DurationPercentiles>,
    /// Number of wake-ups later than a whole tick in real-time pacing.
    pub missed_deadlines: Option<u64>,
}

impl RunReport {
    /// Assembles the report of a run.
    pub fn new(
        scenario: &Scenario,
        host: &str,
        pacing: &str,
        result: &LoopResult,
        wall: Duration,
    ) -> Self {
        let statistics = &result.statistics;
        let sim_s = result.ticks as f64 / f64::from(scenario.run.tick_hz);
        let wall_s = wall.as_secs_f64();
        let force = statistics.min_normal_force_n;
        let smoothness = &result.smoothness;
        let converters = &scenario.converters;
        let has_law = scenario.controller.law.name() != "off";
        let final_reference_m = result.final_reference_m.filter(|_| has_law);
        let distance_for_knowledge_m = if result.at_edge {
            distance_for_knowledge_m(scenario)
        } else {
            0.0
        };
        Self {
            scenario: scenario.name.clone(),
            controller: scenario.controller.law.name().into(),
            host: host.into(),
            ticks: result.ticks,
            tick_hz: scenario.run.tick_hz,
            sim_s,
            wall_s,
            realtime_factor: sim_s / wall_s.max(1e-9),
            lift_offs: statistics.lift_offs,
            first_lift_off_s: statistics.first_lift_off_s,
            kept: result.is_kept(),
            impacts: statistics.impacts,
            impacts_without_collision: statistics.impacts_without_collision,
            min_tip_t_m: statistics.min_tip_t_m,
            max_tip_t_m: statistics.max_tip_t_m,
            final_tip_t_m: result.final_tip_t_m,
            final_reference_m,
            requested_target_m: scenario.target_m().filter(|_| has_law),
            at_edge: result.at_edge,
            error_m: final_reference_m
                .map(|reference_m| (result.final_tip_t_m - reference_m).abs()),
            to_edge_m: to_edge_m(scenario, result),
            distance_for_knowledge_m,
            kept_p_per_kg: kept_p_per_kg(scenario, result),
            chief_doubt: (distance_for_knowledge_m >= TOLD_M)
                .then(|| {
                    scenario
                        .knowledge
                        .chief_doubt(&scenario.controller_configuration().arm)
                })
                .flatten(),
            min_normal_force_n: force.is_finite().then_some(force),
            peak_torque_nm: statistics.peak_torque_nm,
            torque_change_moving_nm: smoothness.moving.torque_change_nm(converters),
            torque_change_holding_nm: smoothness.holding.torque_change_nm(converters),
            torque_reversals: smoothness.holding.reversals(),
            force_ripple_n: smoothness.holding.force_ripple_n(),
            contact_fraction: statistics.contact_fraction(),
            saturated_ticks: result.saturated_ticks,
            stale_ticks: result.stale_ticks,
            round_trip_us: DurationPercentiles::of_ns(&result.round_trips_ns),
            log_hash: result.log_hash.clone(),
            seed: scenario.run.seed,
            pacing: pacing.into(),
            files: Vec::new(),
            drive_watchdog_s: result
                .drive_watchdog_tick
                .map(|tick| tick as f64 / f64::from(scenario.run.tick_hz)),
            fault: result.fault.map(|fault| fault as u8),
            fault_description: result.fault.map(|fault| fault.description().into()),
            wake_up_us: None,
            missed_deadlines: None,
        }
    }

    /// Returns the report as a table.
    pub fn table(&self) -> String {
        let mut table = terminal::table([self.scenario.as_str(), ""]);
        let mut row = |name: &str, value: String| {
            table.add_row([name, value.as_str()]);
        };
        row(
            "controller",
            format!(
                "{}, {} Hz, {} host, {}",
                self.controller, self.tick_hz, self.host, self.pacing
            ),
        );
        let lift_offs = match self.first_lift_off_s {
            Some(first) => format!("{} (first at {first:.3} s)", self.lift_offs),
            None => self.lift_offs.to_string(),
        };
        row("lift-offs", lift_offs);
        row(
            "tip kept on the belt",
            if self.kept { "yes" } else { "no" }.into(),
        );
        row(
            "impacts",
            format!(
                "{} by collision, {} by the paradox alone",
                self.impacts, self.impacts_without_collision
            ),
        );
        row(
            "time in contact",
            format!("{:.2} %", 100.0 * self.contact_fraction),
        );
        let reference = self.final_reference_m.map_or("–".into(), |reference_m| {
            format!("{:+.2} mm", 1e3 * reference_m)
        });
        row(
            "tip at the end",
            format!("{:+.2} mm, reference {reference}", 1e3 * self.final_tip_t_m),
        );
        let short_m = |target_m: f64| {
            let reference_m = self.final_reference_m;
            reference_m.map_or(f64::INFINITY, |reference_m| (target_m - reference_m).abs())
        };
        // Held back by an edge, or not yet reached.
        let is_short = |target_m: &f64| short_m(*target_m) > TOLD_M;
        if let Some(target_m) = self.requested_target_m.filter(is_short) {
            let short_mm = 1e3 * short_m(target_m);
            let known_mm = 1e3 * self.distance_for_knowledge_m;
            let mut reasons = Vec::new();
            if let Some(p_per_kg) = self.kept_p_per_kg {
                reasons.push(format!(
                    "controller.governor.p_per_kg keeps p at {p_per_kg} or more"
                ));
            }
            if self.distance_for_knowledge_m >= TOLD_M {
                let doubt = self.chief_doubt.as_deref().unwrap_or(UNKNOWN_PLACE);
                reasons.push(format!("{known_mm:.1} mm of it because {doubt}"));
            }
            let why = match (self.at_edge, &reasons[..]) {
                (false, _) => String::new(),
                (true, []) => format!("; held {short_mm:.1} mm short"),
                (true, _) => format!("; held {short_mm:.1} mm short: {}", reasons.join(", ")),
            };
            row("requested", format!("{:+.2} mm{why}", 1e3 * target_m));
        }
        if let Some(to_edge_m) = self.to_edge_m {
            row(
                "rests short of the edge",
                format!("{:.2} mm", 1e3 * to_edge_m),
            );
        }
        let [least_mm, largest_mm] = [self.min_tip_t_m, self.max_tip_t_m].map(|it| 1e3 * it);
        row(
            "tip along the belt",
            format!("{least_mm:+.2} … {largest_mm:+.2} mm"),
        );
        let force = self
            .min_normal_force_n
            .map_or("–".into(), |force| format!("{force:.2} N"));
        row("smallest normal force", force);
        row("largest torque", format!("{:.2} N·m", self.peak_torque_nm));
        if let (Some(change_nm), Some(reversals), Some(ripple_n)) = (
            self.torque_change_holding_nm,
            self.torque_reversals,
            self.force_ripple_n,
        ) {
            let moving = self
                .torque_change_moving_nm
                .map_or(String::new(), |moving_nm| {
                    format!("{:.0} moving, ", 1e3 * moving_nm)
                });
            row(
                "torque change",
                format!(
                    "{moving}{:.0} holding mN·m rms a tick, {:.0} % reversals",
                    1e3 * change_nm,
                    100.0 * reversals
                ),
            );
            row("force ripple", format!("{ripple_n:.3} N rms, holding"));
        }
        row(
            "ticks",
            format!(
                "{}, {} with clipped torque, {} without answer",
                self.ticks, self.saturated_ticks, self.stale_ticks
            ),
        );
        let round_trip = self.round_trip_us.as_ref();
        row("round trip", round_trip.map_or("–".into(), microseconds));
        if let Some(wake_up) = &self.wake_up_us {
            row("wake-up lateness", microseconds(wake_up));
        }
        if let Some(missed) = self.missed_deadlines {
            row("missed deadlines", missed.to_string());
        }
        row(
            "simulated",
            format!(
                "{:.2} s in {:.2} s ({:.1}× real time)",
                self.sim_s, self.wall_s, self.realtime_factor
            ),
        );
        for (index, file) in self.files.iter().enumerate() {
            let name = if index == 0 { "wrote" } else { "" };
            row(name, file.clone());
        }
        if let Some(tripped_s) = self.drive_watchdog_s {
            row(
                "drive watchdog",
                format!("no commands: no torque from {tripped_s:.3} s on"),
            );
        }
        if let (Some(number), Some(description)) = (self.fault, &self.fault_description) {
            row("fault", format!("{number}: {description}"));
        }
        row("log hash", self.log_hash.clone());
        if let Some(column) = table.column_mut(0) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        terminal::readable_table(table)
    }
}

/// Least distance that is told, m.
const TOLD_M: f64 = 5e-5;

/// Why a distance is kept if `[knowledge]` does not say it.
const UNKNOWN_PLACE: &str = "the tip is known to controller.estimator.tip_deviation_m";

/// Returns how far the tip rests from the edge p = 0 in the direction in which its reference is held back, m.
fn to_edge_m(scenario: &Scenario, result: &LoopResult) -> Option<f64> {
    if !result.at_edge {
        return None;
    }
    let direction = scenario.target_m()? - result.final_reference_m?;
    let time_s = result.ticks as f64 / f64::from(scenario.run.tick_hz);
    ParadoxDistance::new(scenario).ok()?.before_edge_m(
        time_s,
        &result.final_theta_rad,
        result.final_p_per_kg,
        direction,
    )
}

/// Returns the least p of the governor's settings if it is more than what the ratio p/Q22 asks for where the tip is held, 1/kg.
fn kept_p_per_kg(scenario: &Scenario, result: &LoopResult) -> Option<f64> {
    let governor = &scenario.controller.governor;
    let arm = Arm::new(scenario.moving_arm()).ok()?;
    let pose = Pose::new(&result.final_theta_rad);
    let by_ratio = f64::from(governor.p_ratio) * arm.inverse_tip_inertia_per_kg(&pose).m22;
    let p_per_kg = as_written(governor.p_per_kg);
    (result.at_edge && p_per_kg > by_ratio).then_some(p_per_kg)
}

/// Returns by how much the governor's distance is larger because the arm is not known exactly, m.
fn distance_for_knowledge_m(scenario: &Scenario) -> f64 {
    let configuration = scenario.controller_configuration();
    let mut known = configuration.clone();
    known.settings.estimator.tip_deviation_m = 0.0;
    f64::from(configuration.kept_distance_m()) - f64::from(known.kept_distance_m())
}

fn microseconds(percentiles: &DurationPercentiles) -> String {
    let DurationPercentiles {
        p50,
        p99,
        p999,
        max,
    } = percentiles;
    format!("p50 {p50:.1} · p99 {p99:.1} · p99.9 {p999:.1} · max {max:.1} µs")
}
