//! How much recorded runs differ: aligned by an event, as numbers and as a figure.

mod figure;
mod quantity;

use std::fmt;

use painleve_plant::scenario::Scenario;
use serde::Serialize;

use self::quantity::{QUANTITIES, Quantity};
use crate::run_table::RunTable;

/// Most runs in one comparison: more colours could not be told apart.
pub const MOST_RUNS: usize = 7;

/// The columns of a run that a comparison and its page need.
pub const COLUMNS: [&str; 33] = [
    "plant.theta1_rad",
    "plant.theta2_rad",
    "plant.tip_t_m",
    "plant.reference_tip_t_m",
    "plant.gap_m",
    "plant.belt_speed_m_s",
    "plant.normal_force_n",
    "plant.tangential_force_n",
    "plant.u1_nm",
    "plant.u2_nm",
    "plant.b_m_s2",
    "plant.p_per_kg",
    "plant.mode_number",
    "sensor.inputs",
    "actuator.state_number",
    "actuator.fault_number",
    "actuator.flags",
    "estimates.theta1_rad",
    "estimates.theta2_rad",
    "estimates.tip_t_m",
    "estimates.reference_m",
    "estimates.normal_force_n",
    "estimates.tangential_force_n",
    "estimates.u1_nm",
    "estimates.u2_nm",
    "estimates.friction",
    "estimates.friction_deviation",
    "estimates.lower_edge_m",
    "estimates.upper_edge_m",
    "estimates.contact_confidence",
    "estimates.contact",
    "estimates.slip_sign",
    "estimates.sticks",
];

/// A recorded run.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its name in the comparison.
    pub label: String,
    /// Its ticks.
    pub table: RunTable,
    /// Its settings, if they are known.
    pub scenario: Option<Scenario>,
}

/// What happens at the same time in all runs of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// The first tick.
    Start,
    /// The input ENABLE rises.
    Enable,
    /// The controller finds the tip on the belt for the first time.
    Contact,
}

impl fmt::Display for Alignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "the first tick",
            Self::Enable => "ENABLE",
            Self::Contact => "the first contact",
        })
    }
}

/// Bit of ENABLE among the inputs, and of the contact among the controller's flags.
const ENABLE: u32 = 1;
const CONTACT: u32 = 1;

impl Run {
    /// Returns the time of an event, s; `None` if it does not happen.
    pub fn time_of(&self, event: Alignment) -> Option<f64> {
        let (column, bit) = match event {
            Alignment::Start => return self.table.time_s.first().copied(),
            Alignment::Enable => ("sensor.inputs", ENABLE),
            Alignment::Contact => ("actuator.flags", CONTACT),
        };
        let mut flags = self.table.column(column).iter();
        // NaN becomes zero.
        let tick = flags.position(|flags| *flags as u32 & bit != 0)?;
        self.table.time_s.get(tick).copied()
    }

    /// Returns the times at which the tip leaves the belt, s; `None` for a real arm, whose mode is not known. Of a table
    /// they are the first ticks in flight.
    pub fn lift_offs_s(&self) -> Option<Vec<f64>> {
        let seen_at_ticks = || {
            let changes = self.table.changes("plant.mode_number");
            let lift_offs = changes.filter(|(_, from, to)| *from > 0.0 && *to == 0.0);
            lift_offs.map(|(time_s, ..)| time_s).collect()
        };
        let is_simulated = self.table.knows("plant.p_per_kg");
        let exact = self.table.lift_offs_s.clone();
        is_simulated.then(|| exact.unwrap_or_else(seen_at_ticks))
    }
}

/// Runs beside each other.
pub struct Comparison<'a> {
    runs: &'a [Run],
    /// What happens at time zero.
    pub alignment: Alignment,
    /// Time of that event in each run, s.
    zero_s: Vec<f64>,
    /// The values of each quantity in each run.
    values: Vec<[Vec<f64>; QUANTITIES.len()]>,
}

/// How much a run differs from the first one in a quantity, where both have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The run.
    pub run: String,
    /// The quantity, with its unit.
    pub quantity: &'static str,
    /// Mean difference.
    pub mean: f64,
    /// Root mean square of the difference.
    pub rms: f64,
    /// The difference that is largest in size.
    pub largest: f64,
    /// Its time after the event, s.
    pub at_s: f64,
}

/// What became of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// The run.
    pub run: String,
    /// Time of the event, s.
    pub event_s: f64,
    /// Duration after the event, s.
    pub duration_s: f64,
    /// Number of times that the tip leaves the belt after the event; absent for a run of a real arm.
    pub lift_offs: Option<u64>,
    /// Whether they are those that the ticks of a table show: none shorter than a tick, and each up to a tick late.
    pub lift_offs_at_ticks: bool,
    /// Time of the first after the event, s.
    pub first_lift_off_s: Option<f64>,
    /// Number of the fault at the end, 0 for none.
    pub fault: u64,
    /// Position of the tip at the last tick, mm; absent if it is not known there.
    pub final_tip_mm: Option<f64>,
    /// Tracking error at the last tick, mm; absent if it is not known there, as after a fault.
    pub final_error_mm: Option<f64>,
}

impl Difference {
    /// Names of [`cells`](Self::cells).
    pub const HEAD: [&str; 6] = [
        "run",
        "quantity",
        "mean",
        "RMS",
        "largest",
        "after the event, s",
    ];

    /// Returns the difference as a table shows it.
    pub fn cells(&self) -> [String; 6] {
        let quantity = QUANTITIES
            .iter()
            .find(|quantity| quantity.key == self.quantity);
        [
            self.run.clone(),
            quantity.map_or_else(String::new, Quantity::label),
            three_digits(self.mean),
            three_digits(self.rms),
            three_digits(self.largest),
            decimals(self.at_s, 3),
        ]
    }
}

impl Outcome {
    /// Names of [`cells`](Self::cells).
    pub const HEAD: [&str; 8] = [
        "run",
        "event, s",
        "duration after it, s",
        "lift-offs after it",
        "first, s",
        "fault",
        "tip at the last tick, mm",
        "error there, mm",
    ];

    /// Returns the outcome as a table shows it.
    pub fn cells(&self) -> [String; 8] {
        let unknown = || "–".to_owned();
        let number = |value: Option<f64>, digits| {
            value.map_or_else(unknown, |value| decimals(value, digits))
        };
        [
            self.run.clone(),
            decimals(self.event_s, 3),
            decimals(self.duration_s, 3),
            self.lift_offs.map_or_else(unknown, |count| {
                let how = if self.lift_offs_at_ticks {
                    " at ticks"
                } else {
                    ""
                };
                format!("{count}{how}")
            }),
            number(self.first_lift_off_s, 3),
            match self.fault {
                0 => "none".into(),
                fault => fault.to_string(),
            },
            number(self.final_tip_mm, 2),
            self.final_error_mm.map_or_else(unknown, three_digits),
        ]
    }
}

/// Returns a number with this many decimals.
fn decimals(value: f64, digits: i32) -> String {
    painleve_chart::axis::label(value, 2.0 * 10_f64.powi(-digits))
}

/// Returns a number with three digits: a small arm's torques and a friction need more decimals than a force. Less than 10⁻⁶
/// is rounding.
fn three_digits(value: f64) -> String {
    match value.abs() {
        ..1e-6 => "0".into(),
        size => painleve_chart::axis::label(value, size / 100.0),
    }
}

/// A run lacks the event.
#[derive(Debug, thiserror::Error)]
#[error("{run}: {event} does not happen in it; align the runs by another event with --align")]
pub struct NoEvent {
    run: String,
    event: Alignment,
}

impl<'a> Comparison<'a> {
    /// Aligns runs. A quantity that one of them has only as an estimate, as from a real arm, is the estimate in all.
    ///
    /// # Errors
    /// [`NoEvent`] if the event does not happen in one of them.
    pub fn new(runs: &'a [Run], alignment: Alignment) -> Result<Self, NoEvent> {
        let zero = |run: &Run| {
            run.time_of(alignment).ok_or_else(|| NoEvent {
                run: run.label.clone(),
                event: alignment,
            })
        };
        let of_quantity = |quantity: &Quantity, run: &Run| {
            let estimated = runs.iter().any(|run| !run.table.knows(quantity.columns[0]));
            quantity.values(&run.table, usize::from(estimated))
        };
        Ok(Self {
            zero_s: runs.iter().map(zero).collect::<Result<_, _>>()?,
            values: runs
                .iter()
                .map(|run| {
                    QUANTITIES
                        .each_ref()
                        .map(|quantity| of_quantity(quantity, run))
                })
                .collect(),
            runs,
            alignment,
        })
    }

    /// Returns the runs, the first of which the others are compared with.
    pub fn runs(&self) -> &'a [Run] {
        self.runs
    }

    /// Returns the time by which a run is shifted to meet the first one, s.
    pub fn shift_s(&self, run: usize) -> f64 {
        self.zero_s[0] - self.zero_s[run]
    }

    /// Returns the differences of all runs from the first, at the ticks of the first.
    pub fn differences(&self) -> Vec<Difference> {
        let others = 1..self.runs.len();
        others
            .flat_map(|run| {
                (0..QUANTITIES.len()).filter_map(move |quantity| self.difference(run, quantity))
            })
            .collect()
    }

    fn difference(&self, run: usize, quantity: usize) -> Option<Difference> {
        let (mut count, mut sum, mut squares) = (0_u64, 0.0, 0.0);
        let (mut largest, mut at_s) = (0.0_f64, 0.0);
        for (time_s, difference) in self.curve_of_difference(run, quantity) {
            if difference.is_finite() {
                count += 1;
                sum += difference;
                squares += difference * difference;
                if difference.abs() > largest.abs() {
                    (largest, at_s) = (difference, time_s);
                }
            }
        }
        (count > 0).then(|| Difference {
            run: self.runs[run].label.clone(),
            quantity: QUANTITIES[quantity].key,
            mean: sum / count as f64,
            rms: (squares / count as f64).sqrt(),
            largest,
            at_s,
        })
    }

    /// Returns the difference from the first run, with the time after the event, s.
    fn curve_of_difference(
        &self,
        run: usize,
        quantity: usize,
    ) -> impl Iterator<Item = (f64, f64)> + '_ {
        let ticks = self.runs[0]
            .table
            .time_s
            .iter()
            .zip(&self.values[0][quantity]);
        ticks.map(move |(time_s, first)| {
            let after_s = time_s - self.zero_s[0];
            let other = self.runs[run]
                .table
                .at(&self.values[run][quantity], after_s + self.zero_s[run]);
            (after_s, other - first)
        })
    }

    /// Returns what became of each run.
    pub fn outcomes(&self) -> Vec<Outcome> {
        let runs = self.runs.iter().zip(&self.zero_s).zip(&self.values);
        runs.map(|((run, zero_s), values)| {
            let table = &run.table;
            let mut lift_offs = run.lift_offs_s();
            if let Some(times) = &mut lift_offs {
                times.retain(|time_s| time_s >= zero_s);
            }
            let first = lift_offs.as_ref().and_then(|times| times.first());
            let end_s = table.time_s.last().copied().unwrap_or_default();
            // After a fault there is no reference: an earlier error is not that at the end.
            let at_end = |values: &[f64]| values.last().copied().filter(|value| value.is_finite());
            let faults = table.column("actuator.fault_number").iter().rev();
            let fault = faults.copied().find(|fault| fault.is_finite());
            Outcome {
                run: run.label.clone(),
                event_s: *zero_s,
                duration_s: end_s - zero_s,
                first_lift_off_s: first.map(|time_s| time_s - zero_s),
                lift_offs_at_ticks: lift_offs.is_some() && table.lift_offs_s.is_none(),
                lift_offs: lift_offs.map(|times| times.len() as u64),
                fault: fault.unwrap_or_default() as u64,
                final_tip_mm: at_end(&values[0]),
                final_error_mm: at_end(&values[1]),
            }
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcap_log::tests::{record, scenario};

    /// A run whose tip moves at 10 mm/s from ENABLE on, which is on the belt 0.1 s later.
    fn run(label: &str, enabled_s: f64, offset_m: f64, columns: &str) -> Run {
        let mut text = format!("time_s,{columns},sensor.inputs,actuator.flags\n");
        for tick in 0..100 {
            let time_s = 0.01 * f64::from(tick);
            let tip_m = 0.01 * (time_s - enabled_s) + offset_m;
            let after = |start_s: f64| u8::from(time_s > start_s - 1e-9);
            let (enable, contact) = (after(enabled_s), after(enabled_s + 0.1));
            text += &format!("{time_s},{tip_m},{enable},{contact}\n");
        }
        Run {
            label: label.into(),
            table: RunTable::of_csv(text.as_bytes(), &COLUMNS).unwrap(),
            scenario: None,
        }
    }

    #[test]
    fn runs_are_aligned_by_their_events() {
        let runs = [
            run("a", 0.1, 0.0, "plant.tip_t_m"),
            run("b", 0.3, 0.002, "plant.tip_t_m"),
        ];
        let enabled = Comparison::new(&runs, Alignment::Enable).unwrap();
        assert!((enabled.shift_s(1) + 0.2).abs() < 1e-12);
        let [tip] = enabled.differences().try_into().unwrap();
        let Difference {
            mean, rms, largest, ..
        } = tip;
        for value in [mean, rms, largest] {
            assert!((value - 2.0).abs() < 1e-9, "{value}");
        }
        let contact = Comparison::new(&runs, Alignment::Contact).unwrap();
        assert!((contact.zero_s[1] - 0.4).abs() < 1e-9);
        // From the first tick on, the second run moves 0.2 s later: 2 mm less.
        let start = Comparison::new(&runs, Alignment::Start).unwrap();
        assert!(start.differences()[0].rms < 1e-9);
        assert!(enabled.svg().contains("Time after ENABLE"));
    }

    #[test]
    fn a_real_arm_is_compared_by_estimates() {
        let both = "plant.tip_t_m,estimates.tip_t_m";
        let mut simulated = run("simulated", 0.1, 0.0, "plant.tip_t_m");
        let text = format!(
            "time_s,{both},sensor.inputs,actuator.flags\n0,9.0,0.001,1,1\n1,9.0,0.001,1,1\n"
        );
        simulated.table = RunTable::of_csv(text.as_bytes(), &COLUMNS).unwrap();
        let mut arm = simulated.clone();
        let text =
            format!("time_s,{both},sensor.inputs,actuator.flags\n0,,0.004,1,1\n1,,0.004,1,1\n");
        arm.table = RunTable::of_csv(text.as_bytes(), &COLUMNS).unwrap();
        let runs = [simulated, arm];
        let comparison = Comparison::new(&runs, Alignment::Enable).unwrap();
        assert!((comparison.differences()[0].mean - 3.0).abs() < 1e-9);
        assert_eq!(comparison.outcomes()[1].lift_offs, None);
    }

    fn of_rows(columns: &str, rows: &str) -> Run {
        let text = format!("time_s,{columns},actuator.fault_number\n{rows}");
        Run {
            label: "run".into(),
            table: RunTable::of_csv(text.as_bytes(), &COLUMNS).unwrap(),
            scenario: None,
        }
    }

    #[test]
    fn the_error_before_a_fault_is_not_the_final_one() {
        let columns = "plant.tip_t_m,plant.reference_tip_t_m";
        let runs = [of_rows(columns, "0,0.1,0.102,0\n1,0.1,0.101,0\n2,0.3,,8\n")];
        let outcomes = Comparison::new(&runs, Alignment::Start).unwrap().outcomes();
        let Outcome {
            fault,
            final_tip_mm,
            final_error_mm,
            ..
        } = outcomes[0];
        assert_eq!(
            (fault, final_tip_mm, final_error_mm),
            (8, Some(300.0), None)
        );
        assert_eq!(outcomes[0].cells()[7], "–");
    }

    #[test]
    fn only_a_simulated_tip_is_known_to_lift_off() {
        let columns = "plant.mode_number,plant.p_per_kg,estimates.tip_t_m";
        let modes = |p: &str| format!("0,0,{p},0,0\n1,3,{p},0,0\n2,0,{p},0,0\n3,1,{p},0,0\n");
        let [simulated, arm] = ["1.5", ""].map(|p| of_rows(columns, &modes(p)));
        assert_eq!(simulated.lift_offs_s(), Some(vec![2.0]));
        assert_eq!(arm.lift_offs_s(), None);
        let runs = [arm];
        let outcomes = Comparison::new(&runs, Alignment::Start).unwrap().outcomes();
        assert_eq!(
            (outcomes[0].lift_offs, outcomes[0].first_lift_off_s),
            (None, None)
        );
    }

    #[test]
    fn a_record_has_the_lift_offs_that_no_tick_shows() {
        let folder = tempfile::tempdir().unwrap();
        // Its first lift-off is at its first instant.
        let scenario = scenario("open-loop-bounce", &["run.duration_s=0.01"]);
        let (record, csv) = record(folder.path(), &scenario);
        let runs = [
            RunTable::of_record(&record[..], &COLUMNS),
            RunTable::of_csv(csv.as_bytes(), &COLUMNS),
        ]
        .map(|table| Run {
            label: "run".into(),
            table: table.unwrap(),
            scenario: None,
        });
        let outcomes = Comparison::new(&runs, Alignment::Start).unwrap().outcomes();
        let found: Vec<_> = outcomes
            .iter()
            .map(|one| (one.first_lift_off_s, one.cells()[3].clone()))
            .collect();
        assert_eq!(found[0], (Some(0.0), "1".into()));
        assert_eq!(found[1], (None, "0 at ticks".into()));
    }

    #[test]
    fn differences_have_three_digits_whatever_their_size() {
        let of = |mean, rms, largest| Difference {
            run: "run".into(),
            quantity: "friction",
            mean,
            rms,
            largest,
            at_s: 0.5,
        };
        assert_eq!(
            of(1.0914e-5, -0.000125145, 37.461).cells()[2..],
            ["1.09e−5", "−0.000125", "37.5", "0.500"]
        );
        assert_eq!(
            of(-8.3e-14, 0.0, -1234.5).cells()[2..5],
            ["0", "0", "−1234"]
        );
    }

    #[test]
    fn a_run_without_the_event_is_named() {
        let runs = [
            run("a", 0.1, 0.0, "plant.tip_t_m"),
            run("late.csv", 5.0, 0.0, "plant.tip_t_m"),
        ];
        let error = Comparison::new(&runs, Alignment::Contact)
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains("late.csv: the first contact does not happen"),
            "{error}"
        );
    }
}
