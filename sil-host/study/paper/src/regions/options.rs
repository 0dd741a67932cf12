//! Options of the study.

use clap::{Args, ValueEnum};
use painleve_shared::Slip;
use painleve_study_core::catalogue::{PageSection, StudyOptions};
use painleve_study_core::figures::page_maker::PageMaker;
use painleve_study_core::grid::once;
use painleve_study_core::options::BaseOptions;
use painleve_study_core::{Grid, StudyError};

use super::{Map, Regions, RegionsStudy, Theta2, half_degrees, page};

/// A slip direction on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SlipOption {
    /// ż_r > 0, as in the paper.
    Positive,
    /// ż_r < 0.
    Negative,
}

/// Fig. 3: solution modes over θ1 and its rate, with the tip on the belt.
#[derive(Debug, Args)]
pub struct Options {
    /// Friction coefficient μ; the scenario's by default.
    #[arg(long)]
    mu: Option<f64>,
    /// θ1 in degrees, FROM:TO:STEP or a list; values that do not reach the belt are discarded. By default every half degree
    /// that does.
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    theta1_deg: Option<Grid>,
    /// Rate of θ1 in rad/s, FROM:TO:STEP or a list.
    #[arg(
        long,
        value_name = "GRID",
        default_value = "-8:8:0.2",
        allow_hyphen_values = true
    )]
    theta1_dot_rad_s: Grid,
    /// Sides of the belt normal on which θ2 lies.
    #[arg(
        long,
        value_name = "SIGNS",
        value_enum,
        value_delimiter = ',',
        default_value = "positive,negative"
    )]
    theta2: Vec<Theta2>,
    /// Directions of slip.
    #[arg(
        long,
        value_name = "SIGNS",
        value_enum,
        value_delimiter = ',',
        default_value = "positive,negative"
    )]
    slip: Vec<SlipOption>,
    #[command(flatten)]
    base: BaseOptions,
}

impl StudyOptions for Options {
    const NAME: &'static str = "regions";
    type Study = RegionsStudy;
    type Outcome = Regions;

    fn study(&self) -> Result<RegionsStudy, StudyError> {
        let scenario = self
            .base
            .load_rigid(&[("belt.friction", "--mu")], &["arm"])?;
        let slips = once(&self.slip).into_iter().map(|slip| match slip {
            SlipOption::Positive => Slip::Positive,
            SlipOption::Negative => Slip::Negative,
        });
        let settings = RegionsStudy {
            arm: scenario.arm,
            mu: self.mu.unwrap_or(scenario.belt.friction),
            theta1_deg: match &self.theta1_deg {
                Some(grid) => grid.clone(),
                None => half_degrees(&scenario.arm)?,
            },
            theta1_dot_rad_s: self.theta1_dot_rad_s.clone(),
            theta2: once(&self.theta2),
            slips: slips.collect(),
        };
        settings.check()?;
        Ok(settings)
    }

    fn outcome(settings: &RegionsStudy, maps: Vec<Map>) -> Regions {
        Regions::new(settings, maps)
    }

    fn sections(page: &PageMaker<'_>) -> Result<Vec<PageSection>, StudyError> {
        page::sections(page)
    }
}
