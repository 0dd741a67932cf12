//! The arm's postures in the course of a run, each below or above its time on the axis.

use std::ops::Range;

use painleve_chart::chart::{LEFT, RIGHT};
use painleve_chart::style::{BLACK_INK, BLUE_INK, GREY, ORANGE, WIDTH};
use painleve_chart::{Mark, Panel};
use painleve_shared::ArmParameters;

use super::{RunBin, signal};

/// Number of postures.
const POSTURES: usize = 6;
/// Height of the panel, drawn units.
const HEIGHT: i32 = 180;
/// Room above the shoulder and below the belt, as a part of the shoulder's height.
const MARGIN: f64 = 0.12;

/// Draws the arm at equally spaced times, its shoulder at the time.
pub(super) fn panel(bins: &[RunBin], time: &Range<f64>, arm: &ArmParameters<f64>) -> Panel {
    let slot_s = (time.end - time.start) / POSTURES as f64;
    let height_m = arm.height_m;
    let span_m = (1.0 + 2.0 * MARGIN) * height_m;
    // The same scale along both axes.
    let units_per_m = f64::from(HEIGHT) / span_m;
    let s_per_unit = (time.end - time.start) / f64::from(WIDTH - LEFT - RIGHT);
    let s_per_m = units_per_m * s_per_unit;

    let (mut first, mut second, mut joints, mut belts) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for slot in 0..POSTURES {
        let at_s = time.start + (slot as f64 + 0.5) * slot_s;
        let Some(bin) = bins.iter().rfind(|bin| bin.start_s <= at_s) else {
            continue;
        };
        let theta = [signal::THETA1, signal::THETA2].map(|signal| bin.extents[signal].first);
        let [l1, l2] = arm.link_length_m;
        let place = |t_m: f64, n_m: f64| (at_s + s_per_m * t_m, n_m);
        let elbow = (l1 * theta[0].sin(), height_m - l1 * theta[0].cos());
        let tip = (elbow.0 + l2 * theta[1].sin(), elbow.1 - l2 * theta[1].cos());
        let shoulder = place(0.0, height_m);
        let [elbow, tip] = [elbow, tip].map(|(t_m, n_m)| place(t_m, n_m));
        let gap = (f64::NAN, f64::NAN);
        first.extend([shoulder, elbow, gap]);
        second.extend([elbow, tip, gap]);
        joints.extend([shoulder, elbow]);
        let half_s = 0.46 * slot_s;
        belts.extend([(at_s - half_s, 0.0), (at_s + half_s, 0.0), gap]);
    }
    let line = |colour, width, points| Mark::Line {
        name: String::new(),
        colour,
        width,
        dashed: false,
        points,
    };
    Panel {
        title: "Arm and belt".into(),
        note: "each posture placed at its time".into(),
        y: Some(-MARGIN * height_m..(1.0 + MARGIN) * height_m),
        y_ticks: 0,
        height: HEIGHT,
        marks: vec![
            line(GREY, 5, belts),
            line(BLUE_INK, 7, first),
            line(ORANGE, 7, second),
            Mark::Dots {
                name: String::new(),
                colour: BLACK_INK,
                size: 14,
                points: joints,
            },
        ],
        ..Panel::default()
    }
}
