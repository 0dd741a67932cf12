//! One run over time, from the arm's postures to the distance from the paradox.
//!
//! Panels are stacked on one time axis as in the paper's simulation figures. Flight is shaded in
//! every panel, so that cause and effect line up. Panels without content are left out.

mod panels;
mod postures;
mod verdict;

use std::io::Write;
use std::ops::Range;

use painleve_chart::Chart;
use painleve_chart::decimate::{Bin, Decimator};
use painleve_chart::picture;
use painleve_files::atomic_file::AtomicFile;
use painleve_plant::scenario::Scenario;
use painleve_plant::{ContactMode, Event};
use painleve_shared::frame::StatusFlags;
use painleve_shared::status::SupervisorState;

use crate::events::{EventKind, RunEvent};
use crate::paradox::ParadoxDistance;
use crate::recorder::{RecordError, RecordedTick, Sink};
use panels::Panels;
pub(crate) use panels::points;
use verdict::Verdict;

/// Signals of the figure, by their index in a bin.
mod signal {
    pub(super) const THETA1: usize = 0;
    pub(super) const THETA2: usize = 1;
    pub(super) const TIP: usize = 2;
    pub(super) const REFERENCE: usize = 3;
    pub(super) const REQUESTED: usize = 4;
    pub(super) const LOWER_EDGE: usize = 5;
    pub(super) const UPPER_EDGE: usize = 6;
    pub(super) const ERROR: usize = 7;
    pub(super) const GAP: usize = 8;
    pub(super) const NORMAL_FORCE: usize = 9;
    pub(super) const U1: usize = 10;
    pub(super) const U2: usize = 11;
    pub(super) const FRICTION: usize = 12;
    pub(super) const FRICTION_LOW: usize = 13;
    pub(super) const FRICTION_HIGH: usize = 14;
    pub(super) const B: usize = 15;
    /// log₁₀ of the distance to the edge in mm, and of p/Q22.
    pub(super) const EDGE: usize = 16;
    pub(super) const P_RATIO: usize = 17;
    pub(super) const COUNT: usize = 18;
}

/// Flags of a bin: contact modes, then the controller's states, then the rest.
mod flag {
    use super::{ContactMode, SupervisorState};

    pub(super) fn mode(mode: ContactMode) -> u16 {
        1 << mode as u16
    }

    pub(super) fn state(state: SupervisorState) -> u16 {
        1 << (4 + state as u16)
    }

    pub(super) const AT_EDGE: u16 = 1 << 9;
    pub(super) const RECOVERING: u16 = 1 << 10;
    pub(super) const IMPACT: u16 = 1 << 11;
    pub(super) const IMPACT_WITHOUT_COLLISION: u16 = 1 << 12;
    pub(super) const PARADOX: u16 = 1 << 13;
}

type RunBin = Bin<{ signal::COUNT }>;

/// The figure of one run; its memory does not grow with the length of the run.
#[derive(Clone, Debug)]
pub struct RunPlot {
    scenario: Scenario,
    paradox: Option<ParadoxDistance>,
    samples: Decimator<{ signal::COUNT }>,
    verdict: Verdict,
    /// Flags of events since the last tick.
    pending: u16,
}

impl RunPlot {
    /// Creates an empty figure of a run of this scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            scenario: scenario.clone(),
            paradox: ParadoxDistance::new(scenario).ok(),
            samples: Decimator::default(),
            verdict: Verdict::default(),
            pending: 0,
        }
    }

    /// Adds a tick without allocating. Values may be infinite or NaN: an infinity is
    /// shown as off scale, NaN as a gap.
    #[inline]
    pub fn tick(&mut self, tick: &RecordedTick<'_>) {
        let (plant, answer) = (&tick.sample.plant, &tick.sample.actuator);
        let reference_m = tick.sample.reference_tip_t_m;
        let mut values = [f64::NAN; signal::COUNT];
        [values[signal::THETA1], values[signal::THETA2]] = plant.theta_rad.to_array();
        [values[signal::U1], values[signal::U2]] = plant.torque_nm.to_array();
        values[signal::TIP] = plant.tip_t_m;
        values[signal::REFERENCE] = reference_m;
        values[signal::ERROR] = 1e3 * (plant.tip_t_m - reference_m);
        values[signal::GAP] = 1e3 * plant.gap_m;
        values[signal::NORMAL_FORCE] = plant.normal_force_n;
        values[signal::B] = plant.b_m_s2;
        let follows = reference_m.is_finite();
        if let Some(now) = tick.estimates.filter(|_| follows) {
            let [lower, upper] = now.edges_m.map(f64::from);
            let [friction, deviation] = [now.friction, now.friction_deviation].map(f64::from);
            values[signal::REQUESTED] = f64::from(now.requested_m);
            values[signal::LOWER_EDGE] = lower;
            values[signal::UPPER_EDGE] = upper;
            values[signal::FRICTION] = friction;
            values[signal::FRICTION_LOW] = friction - deviation;
            values[signal::FRICTION_HIGH] = friction + deviation;
        }
        let mut flags = flag::mode(plant.mode) | self.pending;
        self.pending = 0;
        if let Some(paradox) = &mut self.paradox {
            let distance = paradox.measure(plant.time_s, &plant.theta_rad, plant.p_per_kg);
            if distance.p_ratio <= 0.0 {
                flags |= flag::PARADOX;
            } else {
                // Less than a micrometre is less than any encoder of a board resolves.
                values[signal::EDGE] = (1e3 * distance.edge_m).log10().clamp(-3.0, 6.0);
                values[signal::P_RATIO] = distance.p_ratio.log10();
            }
        }
        if let Some(state) = answer.supervisor_state() {
            flags |= flag::state(state);
        }
        for (status, flag) in [
            (StatusFlags::AT_EDGE, flag::AT_EDGE),
            (StatusFlags::RECOVERING, flag::RECOVERING),
        ] {
            if answer.flags.contains(status) {
                flags |= flag;
            }
        }
        self.verdict.tick(tick.sample, values[signal::REQUESTED]);
        self.samples.push(plant.time_s, values, flags);
    }

    /// Adds an event of the run.
    pub fn event(&mut self, event: &RunEvent) {
        match event.kind {
            EventKind::Plant(Event::Impact { .. }) => self.pending |= flag::IMPACT,
            EventKind::Plant(Event::ImpactWithoutCollision { .. }) => {
                self.pending |= flag::IMPACT_WITHOUT_COLLISION;
            }
            _ => {}
        }
        self.verdict.event(event);
    }

    /// Returns the figure as SVG text.
    pub fn svg(&self) -> String {
        let scenario = &self.scenario;
        let bins = self.samples.bins();
        let time = time_range(bins);
        let settings = format!(
            "law: {} · {} Hz · μ = {} · seed {}",
            scenario.controller.law.name(),
            scenario.run.tick_hz,
            scenario.belt.friction,
            scenario.run.seed,
        );
        let panels = Panels {
            bins,
            time: &time,
            friction: scenario.belt.friction,
            arm: &scenario.arm,
        };
        Chart {
            title: scenario.name.clone(),
            subtitle: format!("{}\n{settings}", self.verdict.words()),
            x_title: if bins.is_empty() {
                "Simulated time (s): no samples".into()
            } else {
                "Simulated time (s)".into()
            },
            x: Some(time.clone()),
            panels: panels.all(),
            ..Chart::default()
        }
        .svg()
    }
}

/// A figure with the file that it is written to.
pub struct PlotFile {
    /// The figure.
    pub plot: RunPlot,
    /// The file.
    pub file: AtomicFile,
}

impl Sink for PlotFile {
    fn tick(&mut self, tick: &RecordedTick<'_>) -> Result<(), RecordError> {
        self.plot.tick(tick);
        Ok(())
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecordError> {
        self.plot.event(event);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<Option<AtomicFile>, RecordError> {
        let path = self.file.path().to_path_buf();
        let content = picture::encoded(&path, self.plot.svg())?;
        self.file
            .write_all(&content)
            .map_err(|error| RecordError::write(&path, error))?;
        Ok(Some(self.file))
    }
}

/// Returns the interval from the first sample to one sample after the last, where its mode ends;
/// one second if there are fewer than two samples.
fn time_range(bins: &[RunBin]) -> Range<f64> {
    // At larger times, adjacent ticks could not be distinguished.
    const FAR_S: f64 = 1e9;
    let start = bins.iter().fold(FAR_S, |start, bin| start.min(bin.start_s));
    let end = bins.iter().fold(-FAR_S, |end, bin| end.max(bin.end_s));
    let (start, end) = (start.max(-FAR_S), end.min(FAR_S));
    let samples: u64 = bins.iter().map(Bin::samples).sum();
    match bins {
        [] => 0.0..1.0,
        _ if end - start > 1e-9 * (1.0 + start.abs()) => {
            start..end + (end - start) / samples.saturating_sub(1).max(1) as f64
        }
        _ => start..start + 1.0,
    }
}

#[cfg(test)]
mod tests;
