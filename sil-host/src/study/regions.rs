//! Fig. 3: the four solution modes over (θ1, θ̇1) with the tip on the belt and no torque.
//!
//! With the tip on the belt θ1 leaves two θ2, one to either side of the vertical; θ̇2 is
//! that of a tip without normal velocity. p depends on θ1 alone, so that its zeros are upright
//! lines; b is a quadratic in θ̇1 at every θ1, so that its zeros are roots of quadratics. Both
//! are found to rounding, whatever the grid.

use std::ops::Range;

use comfy_table::Table;
use nalgebra::Vector2;
use painleve_shared::{Arm, ArmParameters, Pose, Posture, Slip, SolutionMode, range};
use plotters::style::RGBColor;
use rayon::prelude::*;
use serde::Serialize;

use super::belt_line::{BeltLine, bisected, positive_stretches};
use super::outcome::{self, Outcome};
use super::{Grid, StudyError};
use crate::plot::PlotError;
use crate::plot::chart::{Chart, Mark, Panel};
use crate::plot::style::{BLACK_INK, BLUE_INK, GREY, ORANGE, SKY, VERMILLION, over_white};
use crate::scenario::InitialState;

/// Which of the two θ2 that a θ1 leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Theta2 {
    /// θ2 > 0.
    Positive,
    /// θ2 < 0.
    Negative,
}

impl Theta2 {
    fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }
}

/// What to map.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Middles of the cells, degrees; those out of reach of the belt are left out.
    pub theta1_deg: Grid,
    /// Middles of the cells, rad/s.
    pub theta1_dot_rad_s: Grid,
    /// Sides of the vertical on which the upper arm's end may be.
    pub theta2: Vec<Theta2>,
    /// Slip directions.
    pub slips: Vec<Slip>,
}

/// All maps at one friction coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Regions {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Largest |θ1| with the tip on the belt, degrees.
    pub reach_deg: f64,
    /// One per side and slip direction.
    pub maps: Vec<Map>,
    #[serde(skip)]
    arm: Arm<f64>,
}

/// One map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Map {
    /// Side of the vertical.
    pub theta2: Theta2,
    /// Slip direction.
    pub slip: Slip,
    /// θ1 at which p = 0, degrees, ascending.
    pub p_zero_theta1_deg: Vec<f64>,
    /// Curves of (θ1 in degrees, θ̇1 in rad/s) along which b = 0.
    pub b_zero: Vec<Vec<[f64; 2]>>,
    /// Part of the cells that is sliding.
    pub sliding: f64,
    /// Part that is flight.
    pub flight: f64,
    /// Part that is indeterminate.
    pub indeterminate: f64,
    /// Part that is inconsistent.
    pub inconsistent: f64,
    #[serde(skip)]
    cells: Vec<Cell>,
    #[serde(skip)]
    grid: (Vec<f64>, Vec<f64>),
}

/// One cell, as a line of the CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    mu: f64,
    theta2: Theta2,
    slip: Slip,
    theta1_deg: f64,
    theta1_dot_rad_s: f64,
    theta2_deg: f64,
    theta2_dot_rad_s: f64,
    b_m_s2: f64,
    p_per_kg: f64,
    mode: SolutionMode,
}

/// Cells of a map in the figure.
const FINE_COLUMNS: usize = 445;
const FINE_ROWS: usize = 260;

/// Points of a curve b = 0 over the whole of θ1.
const CURVE_POINTS: usize = 2000;

/// One θ1 with the tip on the belt.
struct Column<'a> {
    arm: &'a Arm<f64>,
    theta: Vector2<f64>,
    /// θ̇2/θ̇1 without normal velocity.
    ratio: f64,
}

impl<'a> Column<'a> {
    fn new(arm: &'a Arm<f64>, theta1: f64, theta2: Theta2) -> Option<Self> {
        let parameters = arm.parameters();
        let cosine = parameters.height_m / parameters.link_length_m - libm::cos(theta1);
        // At θ2 = 0 the tip cannot move along the belt.
        (cosine.abs() < 1.0).then(|| {
            let theta = Vector2::new(theta1, theta2.sign() * libm::acos(cosine));
            Self {
                arm,
                theta,
                ratio: -libm::sin(theta.x) / libm::sin(theta.y),
            }
        })
    }

    fn b(&self, rate: f64) -> f64 {
        let rates = Vector2::new(rate, self.ratio * rate);
        let pose = Pose::new(&self.theta);
        self.arm
            .contact_terms(&self.theta, &rates, &pose, &Vector2::zeros())
            .b()
    }

    fn p(&self, mu: f64, slip: Slip) -> f64 {
        self.arm.p(&Pose::new(&self.theta), mu, slip)
    }

    /// Both θ̇1 at which b = 0, ascending.
    fn rates_of_zero_b(&self) -> Option<[f64; 2]> {
        let (minus, zero, plus) = (self.b(-1.0), self.b(0.0), self.b(1.0));
        let (square, linear) = (0.5 * (plus + minus) - zero, 0.5 * (plus - minus));
        let discriminant = linear * linear - 4.0 * square * zero;
        if discriminant < 0.0 || square == 0.0 {
            return None;
        }
        // In the form that does not cancel.
        let far = -0.5 * (linear + linear.signum() * discriminant.sqrt());
        let roots = [far / square, if far == 0.0 { 0.0 } else { zero / far }];
        Some([roots[0].min(roots[1]), roots[0].max(roots[1])])
    }
}

/// Maps the modes.
///
/// # Errors
/// [`StudyError::Range`] if the arm or the friction coefficient is out of range,
/// [`StudyError::Option`] if no θ1 of the grid reaches the belt.
pub fn regions(settings: &Settings) -> Result<Regions, StudyError> {
    range::check("--mu", settings.mu, 0.0, 10.0)?;
    let arm = Arm::new(settings.arm)?;
    let cosine = settings.arm.height_m / settings.arm.link_length_m - 1.0;
    let reach = libm::acos(cosine.clamp(-1.0, 1.0));
    let inside = |theta1: &&f64| theta1.to_radians().abs() < reach;
    let theta1: Vec<f64> = settings
        .theta1_deg
        .values()
        .iter()
        .filter(inside)
        .copied()
        .collect();
    if theta1.is_empty() {
        return Err(StudyError::Option(format!(
            "no θ1 of the grid puts the tip on the belt; |θ1| must be below {:.2} degrees",
            reach.to_degrees()
        )));
    }
    let kinds: Vec<(Theta2, Slip)> = settings
        .theta2
        .iter()
        .flat_map(|&theta2| settings.slips.iter().map(move |&slip| (theta2, slip)))
        .collect();
    let maps = kinds
        .into_par_iter()
        .map(|(theta2, slip)| map(&arm, settings, &theta1, reach, theta2, slip))
        .collect();
    Ok(Regions {
        mu: settings.mu,
        reach_deg: reach.to_degrees(),
        maps,
        arm,
    })
}

fn map(
    arm: &Arm<f64>,
    settings: &Settings,
    theta1_deg: &[f64],
    reach: f64,
    theta2: Theta2,
    slip: Slip,
) -> Map {
    let rates = settings.theta1_dot_rad_s.values();
    let mu = settings.mu;
    let mut cells = Vec::with_capacity(theta1_deg.len() * rates.len());
    for &rate in rates {
        for &degrees in theta1_deg {
            let Some(column) = Column::new(arm, degrees.to_radians(), theta2) else {
                continue;
            };
            let (b, p) = (column.b(rate), column.p(mu, slip));
            cells.push(Cell {
                mu,
                theta2,
                slip,
                theta1_deg: degrees,
                theta1_dot_rad_s: rate,
                theta2_deg: column.theta.y.to_degrees(),
                theta2_dot_rad_s: column.ratio * rate,
                b_m_s2: b,
                p_per_kg: p,
                mode: SolutionMode::classify(p, b),
            });
        }
    }
    let part = |mode| {
        let count = cells.iter().filter(|cell| cell.mode == mode).count();
        count as f64 / cells.len().max(1) as f64
    };
    Map {
        theta2,
        slip,
        p_zero_theta1_deg: zeros_of_p(arm, mu, theta2, slip),
        b_zero: zeros_of_b(arm, reach, theta2),
        sliding: part(SolutionMode::Sliding),
        flight: part(SolutionMode::Flight),
        indeterminate: part(SolutionMode::Indeterminate),
        inconsistent: part(SolutionMode::Inconsistent),
        cells,
        grid: (theta1_deg.to_vec(), rates.to_vec()),
    }
}

/// θ1 at which p = 0, degrees.
fn zeros_of_p(arm: &Arm<f64>, mu: f64, theta2: Theta2, slip: Slip) -> Vec<f64> {
    let mut zeros = Vec::new();
    for posture in [Posture::ElbowUp, Posture::ElbowDown] {
        let line = BeltLine::new(arm, posture);
        let stretches = positive_stretches(|tau| line.p(tau, mu, slip));
        // Ends of the whole line are no zeros.
        let inside = |tau: &f64| tau.abs() < core::f64::consts::FRAC_PI_2;
        let ends = stretches.into_iter().flat_map(|(from, to)| [from, to]);
        let thetas = ends.filter(inside).map(|tau| line.theta_rad(tau));
        zeros.extend(
            thetas
                .filter(|theta| theta.y * theta2.sign() > 0.0)
                .map(|theta| theta.x.to_degrees()),
        );
    }
    zeros.sort_unstable_by(f64::total_cmp);
    zeros
}

/// Curves along which b = 0: over each stretch of θ1 that has such rates, the greater
/// ones there and the lesser ones back, closed where they meet.
fn zeros_of_b(arm: &Arm<f64>, reach: f64, theta2: Theta2) -> Vec<Vec<[f64; 2]>> {
    let roots = |theta1: f64| Column::new(arm, theta1, theta2).and_then(|c| c.rates_of_zero_b());
    let points: Vec<(f64, Option<[f64; 2]>)> = (1..CURVE_POINTS)
        .map(|index| {
            // Denser towards both ends, where θ̇2 grows without bound.
            let part = core::f64::consts::PI * (index as f64 / CURVE_POINTS as f64 - 0.5);
            let theta1 = reach * libm::sin(part);
            (theta1, roots(theta1))
        })
        .collect();
    let meeting = |known: f64, unknown: f64| {
        let theta1 = bisected(known, unknown, |theta1| roots(theta1).is_some());
        roots(theta1).map(|rates| (theta1, rates))
    };
    let mut curves = Vec::new();
    let mut start = 0;
    for stretch in points.chunk_by(|one, next| one.1.is_some() == next.1.is_some()) {
        let end = start + stretch.len();
        let mut known: Vec<(f64, [f64; 2])> = stretch
            .iter()
            .filter_map(|(theta1, rates)| Some((*theta1, (*rates)?)))
            .collect();
        if let (Some(first), Some(last)) = (known.first().copied(), known.last().copied()) {
            // The lesser and the greater rate meet where this stretch gives way to one without.
            if let Some(before) = start.checked_sub(1).and_then(|index| points.get(index)) {
                known.splice(0..0, meeting(first.0, before.0));
            }
            if let Some(after) = points.get(end) {
                known.extend(meeting(last.0, after.0));
            }
            for place in [1, 0] {
                let curve = known
                    .iter()
                    .map(|(theta1, rates)| [theta1.to_degrees(), rates[place]]);
                curves.push(curve.collect());
            }
        }
        start = end;
    }
    curves
}

impl Regions {
    /// Rest angle of the spring between the links, degrees.
    pub fn spring_rest_deg(&self) -> f64 {
        self.arm.parameters().spring_rest_rad.to_degrees()
    }
}

impl Map {
    fn title(&self) -> String {
        let side = match self.theta2 {
            Theta2::Positive => "θ₂ > 0",
            Theta2::Negative => "θ₂ < 0",
        };
        let slip = match self.slip {
            Slip::Positive => "slip żᵣ > 0",
            Slip::Negative => "slip żᵣ < 0",
        };
        format!("θ̇₁ (rad/s): {side}, {slip}")
    }

    /// The paper's initial conditions on this side of the vertical.
    fn initial_conditions(&self) -> Vec<(&'static str, f64)> {
        let down = InitialState::default();
        [
            ("x₀,a", 32.0, 18.27),
            ("x₀,d", down.theta1_deg, down.theta2_deg),
            ("x₀,u", down.theta2_deg, down.theta1_deg),
        ]
        .into_iter()
        .filter(|(_, _, theta2)| theta2 * self.theta2.sign() > 0.0)
        .map(|(name, theta1, _)| (name, theta1))
        .collect()
    }

    fn panel(&self, arm: &Arm<f64>, mu: f64) -> Panel {
        let (columns, rates) = (&self.grid.0, &self.grid.1);
        let palette = [
            ("sliding", over_white(SKY, 0.45)),
            ("flight", over_white(GREY, 0.15)),
            ("indeterminate", over_white(ORANGE, 0.6)),
            ("inconsistent", over_white(VERMILLION, 0.75)),
        ];
        let place = |mode| match mode {
            SolutionMode::Sliding => 0,
            SolutionMode::Flight => 1,
            SolutionMode::Indeterminate => 2,
            SolutionMode::Inconsistent => 3,
        };
        let (theta1_range, rate_range) = (ends_of_cells(columns), ends_of_cells(rates));
        let middles = |range: &Range<f64>, count: usize| -> Vec<f64> {
            let step = (range.end - range.start) / count as f64;
            let start = range.start;
            (0..count)
                .map(|index| start + (index as f64 + 0.5) * step)
                .collect()
        };
        // A map of its own, fine enough for the eye, whatever the grid of the numbers.
        let fine: Vec<Option<Column<'_>>> = middles(&theta1_range, FINE_COLUMNS)
            .into_iter()
            .map(|theta1| Column::new(arm, theta1.to_radians(), self.theta2))
            .collect();
        let p: Vec<f64> = fine
            .iter()
            .map(|column| column.as_ref().map_or(f64::NAN, |c| c.p(mu, self.slip)))
            .collect();
        let mut cells = Vec::with_capacity(FINE_COLUMNS * FINE_ROWS);
        for rate in middles(&rate_range, FINE_ROWS) {
            cells.extend(fine.iter().zip(&p).map(|(column, &p)| match column {
                Some(column) => place(SolutionMode::classify(p, column.b(rate))),
                None => u8::MAX,
            }));
        }
        let mut marks = vec![Mark::Cells {
            x: theta1_range,
            y: rate_range.clone(),
            columns: FINE_COLUMNS,
            palette: palette.map(|(name, colour)| (name.into(), colour)).to_vec(),
            cells,
        }];
        for (index, curve) in self.b_zero.iter().enumerate() {
            let inside = |rate: f64| rate_range.contains(&rate);
            let points = curve
                .iter()
                .map(|&[theta1, rate]| (theta1, if inside(rate) { rate } else { f64::NAN }));
            let name = if index == 0 { "b = 0" } else { "" };
            marks.push(Mark::line(name, BLACK_INK, points.collect()));
        }
        for (index, &theta1) in self.p_zero_theta1_deg.iter().enumerate() {
            let name = if index == 0 { "p = 0" } else { "" };
            let points = vec![(theta1, rate_range.start), (theta1, rate_range.end)];
            marks.push(Mark::dashed(name, RED, points));
        }
        for (name, theta1) in self.initial_conditions() {
            marks.push(Mark::Dots {
                name: String::new(),
                colour: BLUE_INK,
                size: 14,
                points: vec![(theta1, 0.0)],
            });
            marks.push(Mark::Label {
                at: (theta1 + 0.5, 0.0),
                centred: false,
                text: name.into(),
            });
        }
        Panel {
            title: self.title(),
            y: Some(rate_range),
            height: 520,
            marks,
            ..Panel::default()
        }
    }
}

/// Half a step beyond the first and the last value.
fn ends_of_cells(middles: &[f64]) -> Range<f64> {
    match middles {
        [first, .., last] => {
            let half = 0.5 * (last - first) / (middles.len() - 1) as f64;
            (first - half).min(last + half)..(first - half).max(last + half)
        }
        [only] => only - 0.5..only + 0.5,
        [] => 0.0..1.0,
    }
}

impl Outcome for Regions {
    type Line = Cell;

    fn lines(&self) -> Vec<Cell> {
        let cells = self.maps.iter().flat_map(|map| &map.cells);
        cells.copied().collect()
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            format!("μ = {}", self.mu),
            "slip".into(),
            "p = 0 at θ₁ (°)".into(),
            "sliding".into(),
            "flight".into(),
            "indeterminate".into(),
            "inconsistent".into(),
        ]);
        for map in &self.maps {
            let zeros: Vec<String> = map
                .p_zero_theta1_deg
                .iter()
                .map(|theta1| format!("{theta1:.3}"))
                .collect();
            let percent = |part: f64| format!("{:.2} %", 100.0 * part);
            table.add_row([
                format!(
                    "θ₂ {}",
                    if map.theta2 == Theta2::Positive {
                        "> 0"
                    } else {
                        "< 0"
                    }
                ),
                outcome::name(&map.slip),
                if zeros.is_empty() {
                    "nowhere".into()
                } else {
                    zeros.join(", ")
                },
                percent(map.sliding),
                percent(map.flight),
                percent(map.indeterminate),
                percent(map.inconsistent),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        let columns = self.maps.first().map_or(&[][..], |map| &map.grid.0);
        let (arm, maps) = (&self.arm, self.maps.iter());
        Chart {
            title: "Solution modes with the tip on the belt (Fig. 3)".into(),
            subtitle: format!(
                "μ = {} · u = 0 · θ₂ and its rate keep the tip on the belt",
                self.mu
            ),
            x_title: "θ₁ (°)".into(),
            x: Some(ends_of_cells(columns)),
            panels: maps.map(|map| map.panel(arm, self.mu)).collect(),
        }
        .svg()
    }
}

/// The paper's colour of p = 0.
const RED: RGBColor = RGBColor(0xB0, 0x00, 0x20);

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings {
            arm: ArmParameters::default(),
            mu: 0.6,
            theta1_deg: "-37:37:0.5".parse().unwrap(),
            theta1_dot_rad_s: "-8:8:0.5".parse().unwrap(),
            theta2: vec![Theta2::Positive, Theta2::Negative],
            slips: vec![Slip::Positive, Slip::Negative],
        }
    }

    #[test]
    fn the_paradox_is_where_the_paper_has_it() {
        let regions = regions(&settings()).unwrap();
        let [map, other_slip, _, mirrored] = &regions.maps[..] else {
            panic!("four maps");
        };
        // Elbow up at z_t = 0.18269 m and elbow down at 0.16470 m, see Table II.
        let arm = Arm::new(ArmParameters::default()).unwrap();
        let theta1 = |tip: f64, posture| {
            arm.joint_angles_on_belt_rad(tip, posture)
                .unwrap()
                .x
                .to_degrees()
        };
        let expected = [
            theta1(0.182_685_924_513_854_5, Posture::ElbowUp),
            theta1(0.164_704_566_326_326_77, Posture::ElbowDown),
        ];
        assert_eq!(map.p_zero_theta1_deg.len(), 2);
        for (zero, expected) in map.p_zero_theta1_deg.iter().zip(expected) {
            assert!((zero - expected).abs() < 1e-9, "{zero} {expected}");
        }
        assert!(other_slip.p_zero_theta1_deg.is_empty());
        assert_eq!(other_slip.inconsistent, 0.0);
        // p has a mirror image.
        let zeros: Vec<f64> = mirrored
            .p_zero_theta1_deg
            .iter()
            .rev()
            .map(|zero| -zero)
            .collect();
        for (zero, mirrored) in map.p_zero_theta1_deg.iter().zip(zeros) {
            assert!((zero - mirrored).abs() < 1e-9);
        }
        // x0,a starts inconsistent.
        let start = map
            .cells
            .iter()
            .find(|cell| cell.theta1_deg == 32.0 && cell.theta1_dot_rad_s == 0.0);
        assert_eq!(start.unwrap().mode, SolutionMode::Inconsistent);
        assert!(map.inconsistent > 0.0 && map.indeterminate > 0.0);
        let parts = map.sliding + map.flight + map.indeterminate + map.inconsistent;
        assert!((parts - 1.0).abs() < 1e-12);
    }

    #[test]
    fn b_is_zero_on_its_line_and_changes_sign_across() {
        let arm = Arm::new(ArmParameters::default()).unwrap();
        let regions = regions(&settings()).unwrap();
        let mut points = 0;
        for map in &regions.maps {
            for &[theta1, rate] in map.b_zero.iter().flatten() {
                let column = Column::new(&arm, theta1.to_radians(), map.theta2).unwrap();
                let scale = column.b(2.0 * rate + 1.0).abs() + column.b(0.0).abs();
                assert!(
                    column.b(rate).abs() < 1e-9 * scale,
                    "{theta1} {rate}: {}",
                    column.b(rate)
                );
                points += 1;
            }
        }
        assert!(points > 1000, "{points}");
    }

    #[test]
    fn what_never_touches_the_belt_is_refused() {
        let settings = Settings {
            theta1_deg: "40,50".parse().unwrap(),
            ..settings()
        };
        let error = regions(&settings).unwrap_err().to_string();
        assert!(error.contains("below 37.10"), "{error}");
    }
}
