//! The panels of a run's figure: which signals each shows, and how.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, VERMILLION};
use plotters::style::RGBColor;

/// Signals of the figure, by their index in a bin.
pub(super) mod signal {
    pub(in crate::plot) const TIP: usize = 0;
    pub(in crate::plot) const REFERENCE: usize = 1;
    pub(in crate::plot) const NORMAL_FORCE: usize = 2;
    pub(in crate::plot) const U1: usize = 3;
    pub(in crate::plot) const U2: usize = 4;
    pub(in crate::plot) const B: usize = 5;
    pub(in crate::plot) const P: usize = 6;
    pub(in crate::plot) const COUNT: usize = 7;
}

pub(super) struct Curve {
    pub(super) signal: usize,
    pub(super) name: &'static str,
    pub(super) colour: RGBColor,
    pub(super) width: u32,
}

pub(super) struct SignalPanel {
    pub(super) title: &'static str,
    pub(super) unit: &'static str,
    /// Signals in the order of the legend; the first is drawn on top.
    pub(super) curves: &'static [Curve],
    /// Note on how to read the panel.
    pub(super) note: &'static str,
    /// Whether the panel shows a line at zero.
    pub(super) zero_line: bool,
    /// Smallest span of the value axis, so that noise on a constant stays small.
    pub(super) minimum_span: f64,
}

pub(super) const TIP_PANEL: SignalPanel = SignalPanel {
    title: "Tip position zₜ",
    unit: "m",
    curves: &[
        Curve {
            signal: signal::TIP,
            name: "tip zₜ",
            colour: BLACK_INK,
            width: 3,
        },
        // Wide and below, so that both are visible where they agree.
        Curve {
            signal: signal::REFERENCE,
            name: "reference zₜ*",
            colour: ORANGE,
            width: 9,
        },
    ],
    note: "",
    zero_line: false,
    minimum_span: 0.002,
};
pub(super) const FORCE_PANEL: SignalPanel = SignalPanel {
    title: "Normal force fₙ",
    unit: "N",
    curves: &[Curve {
        signal: signal::NORMAL_FORCE,
        name: "",
        colour: BLUE_INK,
        width: 3,
    }],
    note: "",
    zero_line: true,
    minimum_span: 1.0,
};
pub(super) const TORQUE_PANEL: SignalPanel = SignalPanel {
    title: "Joint torques u₁, u₂",
    unit: "N·m",
    curves: &[
        Curve {
            signal: signal::U1,
            name: "u₁",
            colour: BLACK_INK,
            width: 3,
        },
        Curve {
            signal: signal::U2,
            name: "u₂",
            colour: VERMILLION,
            width: 5,
        },
    ],
    note: "",
    zero_line: true,
    minimum_span: 0.5,
};
pub(super) const B_PANEL: SignalPanel = SignalPanel {
    title: "Free normal acceleration b",
    unit: "m/s²",
    curves: &[Curve {
        signal: signal::B,
        name: "",
        colour: BLUE_INK,
        width: 3,
    }],
    note: "lift-off where b ≥ 0",
    zero_line: true,
    minimum_span: 1.0,
};
pub(super) const P_PANEL: SignalPanel = SignalPanel {
    title: "Contact coefficient p",
    unit: "1/kg",
    curves: &[Curve {
        signal: signal::P,
        name: "",
        colour: GREEN,
        width: 3,
    }],
    note: "paradox where p ≤ 0",
    zero_line: true,
    minimum_span: 0.5,
};
