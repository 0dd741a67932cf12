//! The panels of a run's figure: which signals each shows, and how.

use std::ops::Range;

use painleve_chart::decimate::Bin;
use painleve_chart::style::{
    BLACK_INK, BLUE_INK, Colour, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION,
};
use painleve_chart::{Mark, Panel};
use painleve_plant::ContactMode;
use painleve_shared::ArmParameters;
use painleve_shared::status::SupervisorState;

use super::{RunBin, flag, postures, signal};

/// Height of a panel and of a lane, drawn units.
const HEIGHT: i32 = 170;
const LANE: i32 = 42;
/// A tip this high above the belt has left it, mm; on a compliant contact it rides on the belt.
const LEFT_MM: f64 = 0.01;
/// Largest exponents of ten on a logarithmic axis.
const MOST_DECADES: f64 = 6.0;
/// Largest number of shaded intervals; closer ones are drawn as one.
const INTERVALS: f64 = 600.0;

/// Builds the panels of a run.
pub(super) struct Panels<'a> {
    pub(super) bins: &'a [RunBin],
    pub(super) time: &'a Range<f64>,
    /// The belt's friction coefficient.
    pub(super) friction: f64,
    pub(super) arm: &'a ArmParameters<f64>,
}

/// A curve: its signal, name, colour and width.
struct Curve(usize, &'static str, Colour, u32);

impl Panels<'_> {
    /// Returns all panels with content, from top to bottom.
    pub(super) fn all(&self) -> Vec<Panel> {
        let mut panels = Vec::new();
        if self.has(signal::THETA1) {
            panels.push(postures::panel(self.bins, self.time, self.arm));
        }
        panels.push(self.tip());
        if self.has(signal::ERROR) {
            let curve = Curve(signal::ERROR, "", BLACK_INK, 4);
            panels.push(Panel {
                minimum_span: 0.05,
                ..self.panel("Tracking error zₜ − zₜ*", "mm", &[curve], true)
            });
        }
        if self.any(signal::GAP, |gap_mm| gap_mm > LEFT_MM) {
            panels.push(self.gap());
        }
        for (title, unit, minimum_span, curves) in [
            (
                "Normal force fₙ",
                "N",
                1.0,
                &[Curve(signal::NORMAL_FORCE, "", BLUE_INK, 4)][..],
            ),
            (
                "Joint torques",
                "N·m",
                0.5,
                &[
                    Curve(signal::U1, "u₁", VERMILLION, 6),
                    Curve(signal::U2, "u₂", BLACK_INK, 4),
                ],
            ),
        ] {
            let not_zero = |curve: &Curve| self.any(curve.0, |value| value != 0.0);
            if curves.iter().any(not_zero) {
                panels.push(Panel {
                    minimum_span,
                    ..self.panel(title, unit, curves, true)
                });
            }
        }
        if self.has(signal::FRICTION) {
            panels.push(self.friction());
        }
        panels.push(self.modes());
        panels.push(self.states());
        let b = Curve(signal::B, "", BLUE_INK, 4);
        panels.push(Panel {
            note: "lift-off where b ≥ 0".into(),
            minimum_span: 1.0,
            ..self.panel("Free normal acceleration b", "m/s²", &[b], true)
        });
        for (title, signal, colour) in [
            ("Distance to the edge, p = 0 (mm)", signal::EDGE, VERMILLION),
            ("p/Q₂₂", signal::P_RATIO, GREEN),
        ] {
            if self.has(signal) {
                panels.push(self.decades(title, Curve(signal, "", colour, 4)));
            }
        }
        panels
    }

    /// Returns a panel of the logarithm of a curve, with the paradox shaded.
    fn decades(&self, title: &str, curve: Curve) -> Panel {
        let values = self.bins.iter().map(|bin| bin.extents[curve.0]);
        let (low, high) = values
            .flat_map(|extent| [extent.min, extent.max])
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (value.min(low), value.max(high))
            });
        let (low, high) = if low <= high {
            (low, high)
        } else {
            (-1.0, 0.0)
        };
        let (low, high) = (low.max(-MOST_DECADES), high.min(MOST_DECADES));
        let range = low - 0.1..high.max(low + 0.3) + 0.1;
        let mut panel = self.panel(title, "", &[curve], false);
        panel.title = title.into();
        panel.y_labels = Some(decade_labels(&range));
        panel.y = Some(range);
        let paradox = self.times_of(flag::PARADOX);
        if !paradox.is_empty() {
            panel.marks.push(Mark::Spans {
                name: "paradox, p ≤ 0".into(),
                colour: PURPLE,
                opacity: 0.25,
                x: paradox,
            });
        }
        panel
    }

    fn has(&self, signal: usize) -> bool {
        self.any(signal, |_| true)
    }

    /// Whether some finite extreme of a signal fulfils a condition.
    fn any(&self, signal: usize, condition: impl Fn(f64) -> bool) -> bool {
        let extents = self.bins.iter().map(|bin| bin.extents[signal]);
        extents
            .flat_map(|extent| [extent.min, extent.max])
            .any(|value| value.is_finite() && condition(value))
    }

    /// Returns a panel of curves, the last on top, with flight shaded.
    fn panel(&self, title: &str, unit: &str, curves: &[Curve], zero_line: bool) -> Panel {
        let mut marks = vec![self.flights("")];
        if zero_line {
            marks.push(Mark::Level {
                value: 0.0,
                colour: GREY,
            });
        }
        let curves = curves.iter().filter(|curve| self.has(curve.0));
        marks.extend(curves.map(|Curve(signal, name, colour, width)| Mark::Line {
            name: (*name).into(),
            colour: *colour,
            width: *width,
            dashed: false,
            points: points(self.bins, *signal),
        }));
        Panel {
            title: format!("{title} ({unit})"),
            unit: unit.into(),
            height: HEIGHT,
            y_ticks: 5,
            marks,
            ..Panel::default()
        }
    }

    fn tip(&self) -> Panel {
        let curves = [
            // Wide and below, so that both are visible where they agree.
            Curve(signal::REFERENCE, "reference", ORANGE, 11),
            Curve(signal::TIP, "tip", BLACK_INK, 4),
        ];
        let mut panel = self.panel("Tip position zₜ", "m", &curves, false);
        panel.minimum_span = 0.002;
        panel.height = HEIGHT + 60;
        let dashed = |name: &str, signal, colour| Mark::Line {
            name: name.into(),
            colour,
            width: 5,
            dashed: true,
            points: points(self.bins, signal),
        };
        // Only a request that the governor does not grant differs from the reference.
        let differs = self.bins.iter().any(|bin| {
            let [requested, reference] =
                [signal::REQUESTED, signal::REFERENCE].map(|signal| bin.extents[signal].last);
            (requested - reference).abs() > 1e-4
        });
        if differs {
            panel
                .marks
                .push(dashed("requested", signal::REQUESTED, BLUE_INK));
        }
        if self.has(signal::LOWER_EDGE) || self.has(signal::UPPER_EDGE) {
            panel
                .marks
                .push(dashed("edges", signal::LOWER_EDGE, VERMILLION));
            panel.marks.push(dashed("", signal::UPPER_EDGE, VERMILLION));
        }
        panel
    }

    fn gap(&self) -> Panel {
        let mut panel = self.panel("Gap", "mm", &[Curve(signal::GAP, "", BLACK_INK, 4)], true);
        // A single short flight matters: the axis shows every height.
        let heights = self.bins.iter().map(|bin| bin.extents[signal::GAP]);
        let heights = heights.flat_map(|extent| [extent.min, extent.max]);
        let (low, high) = heights
            .filter(|height| height.is_finite())
            .fold((0.0, LEFT_MM), |(low, high): (f64, f64), height| {
                (low.min(height), high.max(height))
            });
        let margin = (0.08 * (high - low)).min(1e300);
        panel.y = Some((low - margin).max(-1e300)..(high + margin).min(1e300));
        let dots = |name: &str, colour, flag| Mark::Dots {
            name: name.into(),
            colour,
            size: 14,
            points: self
                .bins
                .iter()
                .filter(|bin| bin.flags & flag != 0)
                .map(|bin| (bin.start_s, 0.0))
                .collect(),
        };
        for mark in [
            dots("impact", BLUE_INK, flag::IMPACT),
            dots(
                "impact without collision",
                VERMILLION,
                flag::IMPACT_WITHOUT_COLLISION,
            ),
        ] {
            if let Mark::Dots { points, .. } = &mark
                && !points.is_empty()
            {
                panel.marks.push(mark);
            }
        }
        panel
    }

    fn friction(&self) -> Panel {
        let curve = Curve(signal::FRICTION, "estimate", PURPLE, 5);
        let mut panel = self.panel("Friction coefficient μ", "", &[curve], false);
        panel.title = "Friction coefficient μ".into();
        panel.minimum_span = 0.05;
        let band = self.bins.iter().map(|bin| {
            let middle_s = 0.5 * (bin.start_s + bin.end_s);
            let low = bin.extents[signal::FRICTION_LOW].min;
            let high = bin.extents[signal::FRICTION_HIGH].max;
            (middle_s, low, high)
        });
        let band = Mark::Band {
            name: "± 1 standard deviation".into(),
            colour: PURPLE,
            points: band.collect(),
        };
        panel.marks.insert(1, band);
        let ends = [self.time.start, self.time.end].map(|time_s| (time_s, self.friction));
        panel
            .marks
            .push(Mark::dashed("belt", BLACK_INK, ends.to_vec()));
        panel
    }

    fn modes(&self) -> Panel {
        let lanes = [
            (ContactMode::SlidePositive, "slide +", BLUE_INK),
            (ContactMode::SlideNegative, "slide −", SKY),
            (ContactMode::Stick, "stick", GREEN),
            (ContactMode::Flight, "flight", VERMILLION),
        ];
        let lanes = lanes.map(|(mode, name, colour)| (flag::mode(mode), name, colour));
        Panel {
            title: "Contact mode".into(),
            note: "± is the sign of slip; flight is shaded in every panel".into(),
            ..self.lanes(&lanes)
        }
    }

    fn states(&self) -> Panel {
        let state = flag::state;
        let lanes = [
            (state(SupervisorState::Idle), "idle", GREY),
            (state(SupervisorState::Armed), "armed", SKY),
            (state(SupervisorState::Tracking), "tracking", GREEN),
            (state(SupervisorState::LiftOff), "lift-off", ORANGE),
            (state(SupervisorState::Fault), "fault", VERMILLION),
            (flag::AT_EDGE, "at edge", BLUE_INK),
            (flag::RECOVERING, "recovers", PURPLE),
        ];
        Panel {
            title: "Controller".into(),
            ..self.lanes(&lanes)
        }
    }

    /// Returns a panel with one lane for each flag that occurs.
    fn lanes(&self, lanes: &[(u16, &str, Colour)]) -> Panel {
        let occurs = |flag: u16| self.bins.iter().any(|bin| bin.flags & flag != 0);
        let lanes: Vec<_> = lanes.iter().filter(|lane| occurs(lane.0)).collect();
        let count = lanes.len().max(1);
        let mut labels = Vec::new();
        let mut marks = Vec::new();
        for (index, (flag, name, colour)) in lanes.into_iter().enumerate() {
            let middle = (count - index) as f64 - 0.5;
            labels.push((middle, (*name).to_owned()));
            let bars = self.times_of(*flag).into_iter();
            marks.push(Mark::Bars {
                name: String::new(),
                colour: *colour,
                bars: bars
                    .map(|time| (time, middle - 0.38..middle + 0.38))
                    .collect(),
            });
        }
        Panel {
            y: Some(0.0..count as f64),
            y_labels: Some(labels),
            height: LANE * count as i32,
            marks,
            ..Panel::default()
        }
    }

    fn flights(&self, name: &str) -> Mark {
        Mark::Spans {
            name: name.into(),
            colour: VERMILLION,
            opacity: 0.12,
            x: self.times_of(flag::mode(ContactMode::Flight)),
        }
    }

    /// Returns the intervals in which a flag is set; close ones are joined.
    fn times_of(&self, flag: u16) -> Vec<Range<f64>> {
        let close_s = (self.time.end - self.time.start) / INTERVALS;
        let mut times: Vec<Range<f64>> = Vec::new();
        for (index, bin) in self.bins.iter().enumerate() {
            if bin.flags & flag == 0 {
                continue;
            }
            // A mode lasts until the next sample.
            let next = self.bins.get(index + 1);
            let end = next.map_or(self.time.end, |next| next.start_s);
            match times.last_mut() {
                Some(last) if bin.start_s - last.end <= close_s => last.end = last.end.max(end),
                _ => times.push(bin.start_s..end),
            }
        }
        times
    }
}

/// Returns the labels of a logarithmic axis: powers of ten, with 2 and 5 between them if the axis is short.
fn decade_labels(range: &Range<f64>) -> Vec<(f64, String)> {
    let factors: &[f64] = if range.end - range.start < 1.5 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let decades = range.start.floor() as i32..=range.end.ceil() as i32;
    let values = decades.flat_map(|decade| {
        let decimals = usize::try_from(-decade).unwrap_or_default();
        factors.iter().map(move |factor| {
            let value = factor * 10_f64.powi(decade);
            (value.log10(), format!("{value:.decimals$}"))
        })
    });
    values.filter(|(at, _)| range.contains(at)).collect()
}

/// Returns the points of a curve; a bin shows its first, smallest, largest and last value.
pub(crate) fn points<const SIGNALS: usize>(
    bins: &[Bin<SIGNALS>],
    signal: usize,
) -> Vec<(f64, f64)> {
    let mut points = Vec::with_capacity(4 * bins.len());
    for bin in bins {
        let extent = bin.extents[signal];
        let middle_s = 0.5 * (bin.start_s + bin.end_s);
        // Within a pixel or two, only rising and falling can be distinguished.
        let (sooner, later) = if extent.first <= extent.last {
            (extent.min, extent.max)
        } else {
            (extent.max, extent.min)
        };
        points.extend([
            (bin.start_s, extent.first),
            (middle_s, sooner),
            (middle_s, later),
            (bin.end_s, extent.last),
        ]);
    }
    points
}
