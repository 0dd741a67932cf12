//! Progress of a long computation on standard error: a bar on a terminal, elsewhere a line every ten seconds.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use painleve_process::terminal::warn;

/// Time between two redraws of the bar.
const REDRAW: Duration = Duration::from_millis(200);

/// Time between two lines.
const LINE: Duration = Duration::from_secs(10);

/// Where progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// On a terminal and elsewhere.
    Everywhere,
    /// On a terminal only: a program reads the result.
    OnTerminal,
}

impl Shown {
    /// Returns where a command with the option `--json` shows its progress.
    pub fn with_json(json: bool) -> Self {
        if json {
            Self::OnTerminal
        } else {
            Self::Everywhere
        }
    }
}

/// The rows done of a computation; shown until it is dropped.
pub struct Progress {
    bar: ProgressBar,
    /// Ends the thread that prints lines when it is dropped.
    _lines: Option<Sender<()>>,
}

impl Progress {
    /// Starts with no row done.
    pub fn start(name: &str, rows: usize, shown: Shown) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(Some(rows as u64), ProgressDrawTarget::stderr())
            .with_finish(ProgressFinish::AndClear);
        let template = "{prefix}{bar:40} {percent:>3} %  {pos}/{len} rows  {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        if !name.is_empty() {
            bar.set_prefix(format!("{name}  "));
        }
        if is_terminal {
            bar.enable_steady_tick(REDRAW);
        }
        let has_lines = !is_terminal && shown == Shown::Everywhere;
        Self {
            _lines: has_lines
                .then(|| print_lines(name, &bar, LINE, warn))
                .flatten(),
            bar,
        }
    }

    /// Counts a row.
    pub fn row_done(&self) {
        self.bar.inc(1);
    }
}

/// Prints a line after every interval until the sender is dropped; nothing if the system refuses a thread.
fn print_lines(
    name: &str,
    bar: &ProgressBar,
    interval: Duration,
    print: impl Fn(String) + Send + 'static,
) -> Option<Sender<()>> {
    let (end, ended) = channel();
    let bar = bar.clone();
    let prefix = if name.is_empty() {
        String::new()
    } else {
        format!("{name}: ")
    };
    let lines = move || {
        while ended.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
            let (done, rows) = (bar.position(), bar.length().unwrap_or(0));
            let percent = 100 * done / rows.max(1);
            let elapsed_s = bar.elapsed().as_secs();
            print(format!(
                "{prefix}{done} of {rows} rows ({percent} %) after {elapsed_s} s"
            ));
        }
    };
    let thread = std::thread::Builder::new().spawn(lines);
    thread.is_ok().then_some(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_printed_until_the_end() {
        let bar = ProgressBar::hidden();
        bar.set_length(8);
        bar.inc(2);
        let (told, lines) = channel();
        let interval = Duration::from_millis(5);
        let end = print_lines("regions", &bar, interval, move |line| {
            let _ = told.send(line);
        });
        let line = lines.recv_timeout(Duration::from_secs(20)).unwrap();
        assert_eq!(line, "regions: 2 of 8 rows (25 %) after 0 s");
        drop(end);
        // The thread ends, and its sender with it.
        while lines.recv_timeout(Duration::from_secs(20)) != Err(RecvTimeoutError::Disconnected) {}
    }
}
