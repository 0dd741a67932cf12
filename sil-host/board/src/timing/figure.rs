//! Figure of tick costs: one histogram for each scenario, all with one axis of costs.

use painleve_chart::style::{BLUE_INK, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};

use super::{TimingReport, Unit};

/// Bars between the cheapest and the most expensive of all ticks.
const BARS: usize = 120;

/// Height of a bar without ticks, below the height of a single tick.
const NONE: f64 = -0.3;

/// Returns the figure as SVG text. All reports must be of one host.
pub fn svg(reports: &[TimingReport]) -> String {
    let scale = Scale::of(reports);
    let first = reports.first();
    let host = first.map_or("", |first| first.host.as_str());
    let what = first.map_or("tick", |first| first.measured.as_str());
    Chart {
        title: match what {
            "wake-up" => "Wake-up latency of every control tick".into(),
            _ => "Cost of every control tick".into(),
        },
        subtitle: format!("{host} host; dashed: median; red: the worst tick"),
        x_title: scale.title.clone(),
        x: Some(scale.low..scale.high),
        panels: reports.iter().map(|report| panel(report, &scale)).collect(),
        ..Chart::default()
    }
    .svg()
}

/// The axis of costs.
struct Scale {
    title: String,
    /// One unit of the axis, in counts.
    unit: f64,
    low: f64,
    high: f64,
}

impl Scale {
    fn of(reports: &[TimingReport]) -> Self {
        let (name, unit) = match reports.first().map(|first| first.unit) {
            Some(Unit::Cycles { hz }) => {
                let mhz = f64::from(hz) * 1e-6;
                (format!("µs, in cycles of {mhz} MHz"), 1.0 / mhz)
            }
            Some(Unit::Nanoseconds) => ("µs".into(), 1e-3),
            Some(Unit::Instructions) | None => ("instructions".into(), 1.0),
        };
        let costs = reports.iter().flat_map(|report| [report.min, report.max]);
        let (low, high) = costs.fold((u32::MAX, 0), |(low, high), cost| {
            (low.min(cost), high.max(cost))
        });
        let margin = (0.03 * f64::from(high.saturating_sub(low))).max(1.0);
        let low = (f64::from(low.min(high)) - margin).max(0.0);
        Self {
            title: match reports.first() {
                Some(first) if first.measured == "wake-up" => format!("Lateness ({name})"),
                _ => format!("Cost of a tick ({name})"),
            },
            unit,
            low: low * unit,
            high: (f64::from(high) + margin) * unit,
        }
    }

    fn bar(&self, cost: u32) -> usize {
        let part = (f64::from(cost) * self.unit - self.low) / (self.high - self.low);
        ((part * BARS as f64) as usize).min(BARS - 1)
    }

    fn edge(&self, bar: usize) -> f64 {
        self.low + bar as f64 / BARS as f64 * (self.high - self.low)
    }
}

fn panel(report: &TimingReport, scale: &Scale) -> Panel {
    let mut bars = [0_u64; BARS];
    for (cost, ticks) in &report.histogram {
        bars[scale.bar(*cost)] += ticks;
    }
    let most = bars.iter().copied().max().unwrap_or(0).max(1);
    // Rare ticks matter most, so the height is the logarithm of their number.
    let top = (most as f64).log10().ceil().max(1.0);
    let height = |ticks: u64| {
        if ticks == 0 {
            NONE
        } else {
            (ticks as f64).log10()
        }
    };
    let mut outline = Vec::new();
    for (bar, ticks) in bars.iter().enumerate() {
        let height = height(*ticks);
        outline.extend([(scale.edge(bar), height), (scale.edge(bar + 1), height)]);
    }
    let mut marks = vec![Mark::line("", BLUE_INK, outline)];
    let upright = |cost: u32| {
        let x = f64::from(cost) * scale.unit;
        vec![(x, NONE), (x, top)]
    };
    marks.push(Mark::dashed("", BLUE_INK, upright(report.median)));
    marks.push(Mark::line("", VERMILLION, upright(report.max)));
    let worst = report.worst.as_ref().map_or(String::new(), |worst| {
        format!(", tick {} ({})", worst.tick, worst.state)
    });
    let shown = |cost: u32| match report.unit {
        Unit::Instructions => cost.to_string(),
        _ => format!("{:.1} µs", f64::from(cost) * scale.unit),
    };
    let decades = (0..=top as i32).map(|decade| {
        let ticks = 10_u64.pow(decade.unsigned_abs());
        (f64::from(decade), ticks.to_string())
    });
    Panel {
        title: format!("Ticks: {}, {} Hz", report.scenario, report.tick_hz),
        note: format!(
            "{} ticks, {} deadlines missed: median {}, 99.9 % {}, worst {}{worst}",
            report.ticks,
            report.missed_deadlines,
            shown(report.median),
            shown(report.p999),
            shown(report.max),
        ),
        y: Some(NONE..top),
        y_labels: Some(decades.collect()),
        height: 190,
        marks,
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::TickTimes;
    use painleve_shared::frame::ActuatorFrame;

    #[test]
    fn every_report_gets_a_panel_and_no_reports_give_an_empty_figure() {
        let mut times = TickTimes::default();
        for tick in 0..100_u32 {
            let answer = ActuatorFrame {
                tick,
                ..Default::default()
            };
            times.push(&answer, 500 + tick % 7);
        }
        let report =
            |name| TimingReport::new(name, 1000, "qemu", "tick", Unit::Instructions, &times);
        let figure = svg(&[report("one"), report("two")]);
        // A long note is broken into lines.
        let lines = figure.split('<').filter_map(|part| part.split_once('>'));
        let words = lines.flat_map(|(_, line)| line.split_whitespace());
        let shown = words.collect::<Vec<_>>().join(" ");
        for text in ["one, 1000 Hz", "two, 1000 Hz", "worst 506, tick 6 (idle)"] {
            assert!(shown.contains(text), "{text} is not in: {shown}");
        }
        assert!(svg(&[]).starts_with("<svg"));
    }
}
