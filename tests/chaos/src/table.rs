//! Counts of trials and flaws, and how soon peers notice.

use std::collections::BTreeMap;
use std::io::{self, Write, stdout};
use std::time::Duration;

use crate::ChaosTrial;
use crate::trial::{Flaw, TrialOutcome};

/// Counts of all trials.
#[derive(Default)]
pub struct TrialTable {
    rows: BTreeMap<String, Row>,
    trials: usize,
    /// Number of flaws.
    pub findings: usize,
}

#[derive(Default)]
struct Row {
    trials: usize,
    injections: usize,
    flaws: BTreeMap<Flaw, usize>,
    /// Times from a disturbance to the end of the peer that noticed it.
    noticed: Vec<Duration>,
}

const FLAWS: [(Flaw, &str); 7] = [
    (Flaw::Hang, "hangs"),
    (Flaw::Orphan, "orphans"),
    (Flaw::Leak, "leaks"),
    (Flaw::UnusableBus, "unusable"),
    (Flaw::Panic, "panics"),
    (Flaw::ExitCode, "codes"),
    (Flaw::Message, "messages"),
];

/// Number of trials after which the progress is printed.
const REPORTED: usize = 100;

const PERCENTILES: [usize; 4] = [50, 90, 99, 100];

impl TrialTable {
    /// Adds a trial, and prints its flaws.
    pub fn add(&mut self, trial: ChaosTrial, outcome: TrialOutcome) {
        let row = self.rows.entry(trial.kind()).or_default();
        row.trials += 1;
        row.injections += usize::from(outcome.reached);
        row.noticed.extend(outcome.noticed);
        for (flaw, what) in outcome.findings {
            *row.flaws.entry(flaw).or_default() += 1;
            self.findings += 1;
            eprintln!("{trial:?}: {flaw:?}: {what} (load {})", load());
        }
        self.trials += 1;
        if self.trials.is_multiple_of(REPORTED) {
            eprintln!("{} trials, {} flaws", self.trials, self.findings);
        }
    }

    /// Prints the counts, and the percentiles of the times in which peers ended, beside their limits
    /// of silence and of waiting.
    ///
    /// # Errors
    /// If standard output is closed.
    pub fn print(
        &mut self,
        took: Duration,
        segments: &[String],
        patience_s: &[String; 2],
    ) -> io::Result<()> {
        let titles: String = FLAWS.map(|(_, title)| format!("{title:>10}")).concat();
        writeln!(
            stdout(),
            "{:24}{:>8}{:>12}{titles}",
            "disturbed",
            "trials",
            "injections"
        )?;
        for (name, row) in &self.rows {
            let counts: String = FLAWS
                .map(|(flaw, _)| format!("{:>10}", row.flaws.get(&flaw).unwrap_or(&0)))
                .concat();
            writeln!(
                stdout(),
                "{name:24}{:>8}{:>12}{counts}",
                row.trials,
                row.injections
            )?;
        }
        self.print_noticed(patience_s)?;
        writeln!(
            stdout(),
            "{} injections in {:.0} s at a load of {}, {} flaws, {} segments left{}",
            self.injections(),
            took.as_secs_f64(),
            load(),
            self.findings,
            segments.len(),
            segments
                .iter()
                .map(|name| format!("\n  {name}"))
                .collect::<String>(),
        )
    }

    /// Returns the number of disturbances that took effect.
    pub fn injections(&self) -> usize {
        self.rows.values().map(|row| row.injections).sum()
    }

    fn print_noticed(&mut self, [silence_s, wait_s]: &[String; 2]) -> io::Result<()> {
        let titles = PERCENTILES.map(|percent| match percent {
            100 => format!("{:>10}", "max ms"),
            percent => format!("{:>10}", format!("p{percent} ms")),
        });
        let titles = titles.concat();
        writeln!(
            stdout(),
            "peers were to notice a silence of {silence_s} s, and to wait {wait_s} s for a peer"
        )?;
        writeln!(stdout(), "{:24}{:>8}{titles}", "peer ended after", "times")?;
        for (name, row) in &mut self.rows {
            row.noticed.sort_unstable();
            let times = &row.noticed;
            let Some(last) = times.len().checked_sub(1) else {
                continue;
            };
            let at = |percent: usize| (percent * times.len()).div_ceil(100).max(1) - 1;
            let values = PERCENTILES.map(|percent| {
                let time = times[at(percent).min(last)];
                format!("{:>10}", time.as_millis())
            });
            writeln!(stdout(), "{name:24}{:>8}{}", times.len(), values.concat())?;
        }
        Ok(())
    }
}

/// Returns the load of the machine over the last minute: limits of time mean little at a load far
/// above the number of cores.
fn load() -> String {
    let loads = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    loads.split(' ').next().unwrap_or_default().to_owned()
}
