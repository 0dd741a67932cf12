//! Fig. 3: the four solution modes over (θ1, θ̇1) with the tip on the belt and no torque.
//!
//! With the tip on the belt, θ1 allows two values of θ2, one on either side of the belt normal; θ̇2 is
//! that of a tip without normal velocity. p depends only on θ1, so its zeros are vertical
//! lines; b is a quadratic in θ̇1 at every θ1, so its zeros are roots of quadratics. Both
//! are accurate to rounding on any grid.

mod figure;
mod lines;
mod options;
mod outcome;
mod page;

use lines::{RegionColumn, zeros_of_b, zeros_of_p};
use painleve_shared::{Arm, ArmParameters, Slip, SolutionMode, range};
use painleve_study_core::{Grid, Study, StudyError};
use serde::Serialize;

pub use options::Options;

/// The side of the belt normal on which θ2 lies.
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

/// Settings of the study.
#[derive(Clone, Debug)]
pub struct RegionsStudy {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Values of θ1 (cell centres), degrees; values out of reach of the belt are discarded.
    pub theta1_deg: Grid,
    /// Values of θ̇1 (cell centres), rad/s.
    pub theta1_dot_rad_s: Grid,
    /// Sides of the belt normal on which θ2 may lie.
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
    /// One map per side and slip direction.
    pub maps: Vec<Map>,
    #[serde(skip)]
    arm: ArmParameters<f64>,
}

/// One map of the solution modes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Map {
    /// Side of the belt normal on which θ2 lies.
    pub theta2: Theta2,
    /// Slip direction.
    pub slip: Slip,
    /// Angles θ1 at which p = 0, degrees, in ascending order.
    pub p_zero_theta1_deg: Vec<f64>,
    /// Curves of (θ1 in degrees, θ̇1 in rad/s) along which b = 0.
    pub b_zero: Vec<Vec<[f64; 2]>>,
    /// Fraction of the cells that is sliding.
    pub sliding: f64,
    /// Fraction of the cells that is flight.
    pub flight: f64,
    /// Fraction of the cells that is indeterminate.
    pub indeterminate: f64,
    /// Fraction of the cells that is inconsistent.
    pub inconsistent: f64,
    #[serde(skip)]
    cells: Vec<RegionCell>,
    #[serde(skip)]
    grid: (Vec<f64>, Vec<f64>),
}

/// One cell, as a line of the CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RegionCell {
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

impl RegionsStudy {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`StudyError::Range`] if the arm or the friction coefficient is out of range,
    /// [`StudyError::OffTheBelt`] if no θ1 of the grid reaches the belt.
    pub fn check(&self) -> Result<(), StudyError> {
        range::check("--mu", self.mu, 0.0, 10.0)?;
        self.columns()?;
        Arm::new(self.arm)?;
        Ok(())
    }

    /// Returns the values of θ1 within reach, degrees.
    fn columns(&self) -> Result<Vec<f64>, StudyError> {
        let reach_rad = reach_rad(&self.arm);
        let all = self.theta1_deg.values().iter().copied();
        let theta1_deg: Vec<f64> = all
            .filter(|theta1| theta1.to_radians().abs() < reach_rad)
            .collect();
        if theta1_deg.is_empty() {
            return Err(StudyError::OffTheBelt {
                below_deg: reach_rad.to_degrees(),
            });
        }
        Ok(theta1_deg)
    }
}

/// Returns the largest |θ1| with the tip on the belt.
fn reach_rad(arm: &ArmParameters<f64>) -> f64 {
    // θ2 = 0 at the full reach.
    let [length_1, length_2] = arm.link_length_m;
    let cosine = arm.height_m / length_1 - length_2 / length_1;
    libm::acos(cosine.clamp(-1.0, 1.0))
}

/// Returns every half degree of θ1 with the tip on the belt.
///
/// # Errors
/// [`StudyError::Grid`], for no arm that reaches its belt.
fn half_degrees(arm: &ArmParameters<f64>) -> Result<Grid, StudyError> {
    let last_deg = 0.5 * ((2.0 * reach_rad(arm).to_degrees()).ceil() - 1.0);
    let grid = format!("{}:{last_deg}:0.5", -last_deg);
    grid.parse().map_err(StudyError::Grid)
}

/// One row per map.
impl Study for RegionsStudy {
    type Row = Map;

    fn len(&self) -> usize {
        painleve_study_core::combinations(&[self.theta2.len(), self.slips.len()])
    }

    fn row(&self, index: usize) -> Result<Map, StudyError> {
        let theta2 = self.theta2[index / self.slips.len()];
        let slip = self.slips[index % self.slips.len()];
        let arm = Arm::new(self.arm)?;
        Ok(map(&arm, self, &self.columns()?, theta2, slip))
    }
}

impl Regions {
    /// Collects the maps of a study.
    pub fn new(settings: &RegionsStudy, maps: Vec<Map>) -> Self {
        Self {
            mu: settings.mu,
            reach_deg: reach_rad(&settings.arm).to_degrees(),
            maps,
            arm: settings.arm,
        }
    }
}

fn map(
    arm: &Arm<f64>,
    settings: &RegionsStudy,
    theta1_deg: &[f64],
    theta2: Theta2,
    slip: Slip,
) -> Map {
    let rates = settings.theta1_dot_rad_s.values();
    let mu = settings.mu;
    let mut cells = Vec::with_capacity(theta1_deg.len() * rates.len());
    for &rate in rates {
        for &degrees in theta1_deg {
            let Some(column) = RegionColumn::new(arm, degrees.to_radians(), theta2) else {
                continue;
            };
            let (b, p) = (column.b_m_s2(rate), column.p_per_kg(mu, slip));
            cells.push(RegionCell {
                mu,
                theta2,
                slip,
                theta1_deg: degrees,
                theta1_dot_rad_s: rate,
                theta2_deg: column.theta.second().to_degrees(),
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
        b_zero: zeros_of_b(arm, reach_rad(&settings.arm), theta2),
        sliding: part(SolutionMode::Sliding),
        flight: part(SolutionMode::Flight),
        indeterminate: part(SolutionMode::Indeterminate),
        inconsistent: part(SolutionMode::Inconsistent),
        cells,
        grid: (theta1_deg.to_vec(), rates.to_vec()),
    }
}

#[cfg(test)]
mod tests;
