//! One run over time: tip position, normal force, torques, contact mode, b and p.
//!
//! Panels are stacked on one time axis as in the paper's simulation figures. Flight
//! is shaded in every panel, so that cause and effect line up.

mod panels;

use std::io::Write;
use std::ops::Range;
use std::path::PathBuf;

use painleve_chart::PlotError;
use painleve_chart::axis::{ValueAxis, label};
use painleve_chart::decimate::{Bin, Decimator, Extent};
use painleve_chart::style::{
    self, Area, BLUE_INK, Drawn, GREEN, GREY, GRID, HEADING, LEGEND, NOTE, SKY, SUBTITLE, TICK,
    TITLE, VERMILLION, text, text_width, ticks, without_straight_ons,
};
use painleve_plant::ContactMode;
use painleve_plant::sample::Sample;
use painleve_system::atomic_file::{self, AtomicFile};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::recorder::{RecordError, RecordedTick, Sink};

use self::panels::{
    B_PANEL, Curve, FORCE_PANEL, P_PANEL, SignalPanel, TIP_PANEL, TORQUE_PANEL, signal,
};
/// Lanes of the contact mode, from top to bottom.
const LANES: [(ContactMode, &str, RGBColor); 4] = [
    (ContactMode::SlidePositive, "slide +", BLUE_INK),
    (ContactMode::SlideNegative, "slide −", SKY),
    (ContactMode::Stick, "stick", GREEN),
    (ContactMode::Flight, "flight", VERMILLION),
];

const WIDTH: i32 = 2000;
const LEFT: i32 = 170;
const RIGHT: i32 = 50;
const TITLE_HEIGHT: i32 = 124;
const HEADER_HEIGHT: i32 = 50;
const PANEL_HEIGHT: i32 = 200;
const LANE_HEIGHT: i32 = 34;
const GAP: i32 = 18;
const TIME_AXIS_HEIGHT: i32 = 110;
const HEIGHT: i32 = TITLE_HEIGHT
    + 5 * (HEADER_HEIGHT + PANEL_HEIGHT + GAP)
    + HEADER_HEIGHT
    + LANES.len() as i32 * LANE_HEIGHT
    + TIME_AXIS_HEIGHT;

const TIME_TICKS: usize = 10;
const VALUE_TICKS: usize = 5;

/// The figure of one run; its memory does not grow with the length of the run.
#[derive(Clone, Debug)]
pub struct RunPlot {
    title: String,
    subtitle: String,
    samples: Decimator<{ signal::COUNT }>,
}

impl RunPlot {
    /// Creates an empty figure. The subtitle has room for about 110 characters.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        // Control characters are not allowed in XML.
        let printable = |text: String| text.replace(char::is_control, " ");
        Self {
            title: printable(title.into()),
            subtitle: printable(subtitle.into()),
            samples: Decimator::default(),
        }
    }

    /// Adds a sample without allocating. Values may be infinite or NaN: an infinity is
    /// shown as off scale, NaN as a gap.
    #[inline]
    pub fn push(&mut self, sample: &Sample) {
        let mut values = [0.0; signal::COUNT];
        values[signal::TIP] = sample.plant.tip_t_m;
        values[signal::REFERENCE] = sample.reference_tip_t_m;
        values[signal::NORMAL_FORCE] = sample.plant.normal_force_n;
        values[signal::U1] = sample.plant.torque_nm[0];
        values[signal::U2] = sample.plant.torque_nm[1];
        values[signal::B] = sample.plant.b_m_s2;
        values[signal::P] = sample.plant.p_per_kg;
        self.samples
            .push(sample.plant.time_s, values, flag(sample.plant.mode));
    }

    /// Returns the figure as SVG text.
    ///
    /// # Errors
    /// [`PlotError::Draw`] if the drawing library fails, which is not expected.
    pub fn svg(&self) -> Result<String, PlotError> {
        style::svg((WIDTH, HEIGHT), |root| self.draw(root))
    }

    /// Writes the figure to an SVG file, either completely or not at all.
    ///
    /// # Errors
    /// [`PlotError`] if the file cannot be written.
    pub fn write(&self, path: impl Into<PathBuf>) -> Result<(), PlotError> {
        Ok(atomic_file::write(path, self.svg()?.as_bytes())?)
    }

    fn draw(&self, root: &Area<'_>) -> Drawn {
        text(root, &self.title, &TITLE, (LEFT, 44), HPos::Left)?;
        text(root, &self.subtitle, &SUBTITLE, (LEFT, 90), HPos::Left)?;

        let figure = SignalFigure {
            root,
            bins: self.samples.bins(),
            time: time_range(self.samples.bins()),
        };
        let mut top = TITLE_HEIGHT;
        for panel in [&TIP_PANEL, &FORCE_PANEL, &TORQUE_PANEL] {
            figure.draw_panel(panel, top)?;
            top += HEADER_HEIGHT + PANEL_HEIGHT + GAP;
        }
        figure.draw_modes(top)?;
        top += HEADER_HEIGHT + LANES.len() as i32 * LANE_HEIGHT + GAP;
        figure.draw_panel(&B_PANEL, top)?;
        top += HEADER_HEIGHT + PANEL_HEIGHT + GAP;
        figure.draw_panel(&P_PANEL, top)?;
        figure.draw_time_axis(top + HEADER_HEIGHT + PANEL_HEIGHT)
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
        self.plot.push(tick.sample);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordError> {
        let svg = self
            .plot
            .svg()
            .map_err(|error| RecordError::Draw(error.to_string()))?;
        let path = self.file.path().to_path_buf();
        self.file
            .write_all(svg.as_bytes())
            .map_err(|error| RecordError::write(&path, error))?;
        Ok(self.file.commit()?)
    }
}

/// Layout and time axis that all panels share.
struct SignalFigure<'a, 'svg> {
    root: &'a Area<'svg>,
    bins: &'a [Bin<{ signal::COUNT }>],
    time: Range<f64>,
}

impl SignalFigure<'_, '_> {
    fn draw_panel(&self, panel: &SignalPanel, top: i32) -> Drawn {
        let axis = ValueAxis::new(
            panel
                .curves
                .iter()
                .flat_map(|curve| self.bins.iter().map(|bin| bin.extents[curve.signal])),
            panel.zero_line.then_some(0.0),
            panel.minimum_span,
        );
        self.draw_header(panel, &axis, top)?;

        let top = top + HEADER_HEIGHT;
        let bottom = top + PANEL_HEIGHT;
        let y = |value: f64| {
            let part = (axis.clamp(value) - axis.range.start) / (axis.range.end - axis.range.start);
            bottom - (part * f64::from(PANEL_HEIGHT)).round() as i32
        };
        self.draw_flights(top, bottom)?;
        self.draw_time_grid(top, bottom)?;
        let (ticks, step) = ticks(&axis.range, VALUE_TICKS);
        for tick in ticks {
            self.line([(LEFT, y(tick)), (WIDTH - RIGHT, y(tick))], GRID, 2)?;
            self.tick_label(&label(tick, step), (LEFT - 14, y(tick)), HPos::Right)?;
        }
        if panel.zero_line {
            self.line([(LEFT, y(0.0)), (WIDTH - RIGHT, y(0.0))], GREY, 3)?;
        }
        for curve in panel.curves.iter().rev() {
            self.draw_curve(curve, y)?;
        }
        self.draw_off_scale_marks(panel, &axis, top, bottom)?;
        self.draw_frame(top, bottom)
    }

    /// Draws the title with unit and off-scale note; legend or note to the right.
    fn draw_header(&self, panel: &SignalPanel, axis: &ValueAxis, top: i32) -> Drawn {
        let title = format!("{} ({})", panel.title, panel.unit);
        self.draw_heading(&title, panel.note, top)?;
        let middle = top + HEADER_HEIGHT / 2;
        let off_scale = axis.off_scale_note(panel.unit);
        let after_title = LEFT + text_width(&title, &HEADING) + 60;
        text(
            self.root,
            &off_scale,
            &NOTE,
            (after_title, middle),
            HPos::Left,
        )?;

        let mut x = WIDTH - RIGHT;
        for curve in panel.curves.iter().rev() {
            if curve.name.is_empty() {
                continue;
            }
            x -= text_width(curve.name, &LEGEND);
            text(self.root, curve.name, &LEGEND, (x, middle), HPos::Left)?;
            x -= 80;
            self.line([(x, middle), (x + 66, middle)], curve.colour, curve.width)?;
            x -= 50;
        }
        Ok(())
    }

    fn draw_heading(&self, title: &str, note: &str, top: i32) -> Drawn {
        let middle = top + HEADER_HEIGHT / 2;
        text(self.root, title, &HEADING, (LEFT, middle), HPos::Left)?;
        text(self.root, note, &NOTE, (WIDTH - RIGHT, middle), HPos::Right)
    }

    fn draw_curve(&self, curve: &Curve, y: impl Fn(f64) -> i32) -> Drawn {
        for part in self.bins.split(|bin| bin.extents[curve.signal].is_empty()) {
            let points = part.iter().flat_map(|bin| {
                let extent = bin.extents[curve.signal];
                let (start, end) = (self.x(bin.start_s), self.x(bin.end_s));
                let middle = (start + end) / 2;
                // Within a pixel or two, only rising and falling can be distinguished.
                let (sooner, later) = if extent.first <= extent.last {
                    (extent.min, extent.max)
                } else {
                    (extent.max, extent.min)
                };
                [
                    (start, y(extent.first)),
                    (middle, y(sooner)),
                    (middle, y(later)),
                    (end, y(extent.last)),
                ]
            });
            match without_straight_ons(points).as_slice() {
                [] => {}
                [only] => {
                    let radius = curve.width as i32 + 2;
                    let dot = Circle::new(*only, radius, curve.colour.filled());
                    self.root.draw(&dot)?;
                }
                points => {
                    let style = curve.colour.stroke_width(curve.width);
                    self.root.draw(&PathElement::new(points, style))?;
                }
            }
        }
        Ok(())
    }

    /// Draws a small triangle at the edge where a curve leaves the panel.
    fn draw_off_scale_marks(
        &self,
        panel: &SignalPanel,
        axis: &ValueAxis,
        top: i32,
        bottom: i32,
    ) -> Drawn {
        const HALF_WIDTH: i32 = 9;
        const MARK_HEIGHT: i32 = 15;
        type Beyond = fn(&Extent, &Range<f64>) -> bool;
        let edges: [(i32, i32, Beyond); 2] = [
            (top, MARK_HEIGHT, |extent, range| extent.max > range.end),
            (bottom, -MARK_HEIGHT, |extent, range| {
                extent.min < range.start
            }),
        ];
        for curve in panel.curves {
            for (edge, height, beyond) in edges {
                let mut free_from = i32::MIN;
                for bin in self.bins {
                    let x = self.x(bin.start_s);
                    if x < free_from || !beyond(&bin.extents[curve.signal], &axis.range) {
                        continue;
                    }
                    free_from = x + 2 * HALF_WIDTH;
                    let triangle = [
                        (x, edge),
                        (x - HALF_WIDTH, edge + height),
                        (x + HALF_WIDTH, edge + height),
                    ];
                    self.root
                        .draw(&Polygon::new(triangle, curve.colour.filled()))?;
                }
            }
        }
        Ok(())
    }

    fn draw_modes(&self, top: i32) -> Drawn {
        let note = "± is the direction of slip; flight is shaded in every panel";
        self.draw_heading("Contact mode", note, top)?;
        let top = top + HEADER_HEIGHT;
        let bottom = top + LANES.len() as i32 * LANE_HEIGHT;
        self.draw_time_grid(top, bottom)?;
        let mut lane_top = top;
        for (mode, name, colour) in LANES {
            self.tick_label(name, (LEFT - 14, lane_top + LANE_HEIGHT / 2), HPos::Right)?;
            for (start, end) in self.times_of(mode) {
                let lane = [(start, lane_top + 4), (end, lane_top + LANE_HEIGHT - 4)];
                self.root.draw(&Rectangle::new(lane, colour.filled()))?;
            }
            lane_top += LANE_HEIGHT;
            self.line([(LEFT, lane_top), (WIDTH - RIGHT, lane_top)], GRID, 2)?;
        }
        self.draw_frame(top, bottom)
    }

    fn draw_flights(&self, top: i32, bottom: i32) -> Drawn {
        for (start, end) in self.times_of(ContactMode::Flight) {
            let shade = VERMILLION.mix(0.12).filled();
            self.root
                .draw(&Rectangle::new([(start, top), (end, bottom)], shade))?;
        }
        Ok(())
    }

    /// Returns the intervals of a mode in pixels, each at least two pixels wide, so that
    /// the shortest flight is visible.
    fn times_of(&self, mode: ContactMode) -> Vec<(i32, i32)> {
        let mut times: Vec<(i32, i32)> = Vec::new();
        for (index, bin) in self.bins.iter().enumerate() {
            if bin.flags & flag(mode) == 0 {
                continue;
            }
            // A mode lasts until the next sample.
            let end_s = self
                .bins
                .get(index + 1)
                .map_or(self.time.end, |next| next.start_s);
            let start = self.x(bin.start_s).min(WIDTH - RIGHT - 2);
            let end = self.x(end_s).max(start + 2);
            match times.last_mut() {
                Some(last) if start <= last.1 + 1 => last.1 = last.1.max(end),
                _ => times.push((start, end)),
            }
        }
        times
    }

    fn draw_time_axis(&self, top: i32) -> Drawn {
        let (ticks, step) = ticks(&self.time, TIME_TICKS);
        for tick in ticks {
            self.tick_label(&label(tick, step), (self.x(tick), top + 26), HPos::Center)?;
        }
        let middle = (LEFT + WIDTH - RIGHT) / 2;
        let title = if self.bins.is_empty() {
            "Simulated time (s): no samples"
        } else {
            "Simulated time (s)"
        };
        text(self.root, title, &HEADING, (middle, top + 68), HPos::Center)
    }

    fn draw_time_grid(&self, top: i32, bottom: i32) -> Drawn {
        for tick in ticks(&self.time, TIME_TICKS).0 {
            self.line([(self.x(tick), top), (self.x(tick), bottom)], GRID, 2)?;
        }
        Ok(())
    }

    fn draw_frame(&self, top: i32, bottom: i32) -> Drawn {
        let (left, right) = (LEFT, WIDTH - RIGHT);
        let corners = [
            (left, top),
            (right, top),
            (right, bottom),
            (left, bottom),
            (left, top),
        ];
        self.line(corners, GREY, 2)
    }

    fn line<const N: usize>(&self, points: [(i32, i32); N], colour: RGBColor, width: u32) -> Drawn {
        self.root
            .draw(&PathElement::new(points, colour.stroke_width(width)))
    }

    fn tick_label(&self, label: &str, at: (i32, i32), side: HPos) -> Drawn {
        text(self.root, label, &TICK, at, side)
    }

    fn x(&self, time_s: f64) -> i32 {
        let part = (time_s - self.time.start) / (self.time.end - self.time.start);
        LEFT + (part.clamp(0.0, 1.0) * f64::from(WIDTH - RIGHT - LEFT)).round() as i32
    }
}

fn flag(mode: ContactMode) -> u8 {
    1 << mode as u8
}

/// Returns the interval from the first sample to one sample after the last, where its mode ends;
/// one second
/// if there are fewer than two samples.
fn time_range<const SIGNALS: usize>(bins: &[Bin<SIGNALS>]) -> Range<f64> {
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
