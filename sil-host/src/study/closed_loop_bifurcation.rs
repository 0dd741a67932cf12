//! Fig. 12: the bifurcation diagram with the controller in the loop.
//!
//! Every cell is a closed loop that takes the tip to a target, and is then left running
//! through a transient before it is watched, as in the open loop. Encoders of finite
//! resolution keep the joints trembling, so that the largest θ̇1 is never quite zero: the
//! arm bounces if its tip leaves the belt while it is watched.

use comfy_table::Table;
use painleve_shared::{Arm, Posture};
use serde::Serialize;

use super::attractor::Attractor;
use super::case::{self, Controller, Converters, Reference};
use super::initial::Initial;
use super::outcome::{self, Outcome};
use super::trial::Trial;
use super::{Study, StudyError, paper};
use crate::plant::motion::{State, theta};
use crate::plant::statistics::Statistics;
use crate::plot::PlotError;
use crate::plot::chart::{Chart, Mark, Panel};
use crate::plot::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, VERMILLION};
use crate::scenario::{InitialState, Scenario};

/// What to study: all combinations, the last varying fastest.
#[derive(Clone, Debug)]
pub struct ClosedLoopBifurcation {
    /// Controllers.
    pub controllers: Vec<Controller>,
    /// Converter sets.
    pub converters: Vec<Converters>,
    /// Friction coefficients μ.
    pub mu: Vec<f64>,
    /// Belt speeds, m/s.
    pub v_belt_m_s: Vec<f64>,
    /// Initial conditions.
    pub initial: Vec<Initial>,
    /// Seed of the random ones.
    pub seed: u64,
    /// How the reference goes to its target.
    pub reference: Reference,
    /// Target, m; if absent the paper's Z_t,sliding of law and posture.
    pub target_m: Option<f64>,
    /// How long a cell runs before it is watched, s.
    pub transient_s: f64,
    /// How long it is watched, s.
    pub record_s: f64,
    /// Changes to every scenario.
    pub overrides: Vec<String>,
}

/// What the closed loop does in one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Controller.
    pub controller: Controller,
    /// Converter set.
    pub converters: Converters,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Belt speed, m/s.
    pub v_belt_m_s: f64,
    /// Initial condition: `a`, `d`, `u` or `random:K`.
    pub initial: String,
    /// Largest θ̇1 while watched, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// Whether the tip left the belt while watched.
    pub bouncing: bool,
    /// Part of the watched time in contact.
    pub contact_fraction: f64,
    /// Times the tip left the belt in the whole run.
    pub lift_offs: u64,
    /// When it first did, s.
    pub first_lift_off_s: Option<f64>,
    /// Number of the fault that the controller has latched at the end.
    pub fault: Option<u8>,
    /// Target of the reference, m.
    pub target_m: f64,
    /// Where the tip is at the end, m.
    pub tip_t_m: f64,
}

impl ClosedLoopBifurcation {
    /// Makes every cell once, so that a mistake is told before anything runs.
    ///
    /// # Errors
    /// [`StudyError`] of the first cell that cannot be run.
    pub fn check(&self) -> Result<(), StudyError> {
        for index in 0..self.len() {
            Trial::new(&self.scenario(index)?.1)?;
        }
        Ok(())
    }

    /// What a row starts with, and its scenario.
    fn scenario(&self, index: usize) -> Result<(Cell<'_>, Scenario), StudyError> {
        let mut rest = index;
        let mut place = |count: usize| {
            let place = rest % count;
            rest /= count;
            place
        };
        let initial = self.initial[place(self.initial.len())];
        let v_belt_m_s = self.v_belt_m_s[place(self.v_belt_m_s.len())];
        let mu = self.mu[place(self.mu.len())];
        let converters = self.converters[place(self.converters.len())];
        let controller = &self.controllers[place(self.controllers.len())];

        let mut overrides = self.overrides.clone();
        overrides.push(format!("belt.friction={mu}"));
        overrides.push(format!(
            "belt.profile={{ kind = \"constant\", speed_m_s = {v_belt_m_s:?} }}"
        ));
        let posture = |state: &State| Posture::of(&theta(state));
        let of_letter = match initial {
            Initial::D => Some(Posture::ElbowDown),
            Initial::U => Some(Posture::ElbowUp),
            Initial::A | Initial::Random(_) => None,
        };
        let guess = of_letter.unwrap_or(Posture::ElbowDown);
        let mut scenario = case::scenario(controller, guess, converters, &overrides)?;
        let mut start_posture = guess;
        if of_letter.is_none() {
            let arm = Arm::new(scenario.arm)?;
            let state = initial.state(&arm, self.seed, index as u64);
            start_posture = posture(&state);
            if start_posture != guess {
                scenario = case::scenario(controller, start_posture, converters, &overrides)?;
            }
            scenario.initial = InitialState {
                theta1_deg: state[0].to_degrees(),
                theta2_deg: state[1].to_degrees(),
                theta1_dot_rad_s: state[2],
                theta2_dot_rad_s: state[3],
            };
        }
        let target_m = self
            .target_m
            .unwrap_or_else(|| paper::target_m(controller, start_posture));
        scenario.controller.reference = self.reference.to(target_m);
        let cell = Cell {
            controller,
            converters,
            mu,
            v_belt_m_s,
            initial,
            target_m,
        };
        Ok((cell, scenario))
    }
}

struct Cell<'a> {
    controller: &'a Controller,
    converters: Converters,
    mu: f64,
    v_belt_m_s: f64,
    initial: Initial,
    target_m: f64,
}

impl Study for ClosedLoopBifurcation {
    type Row = Row;

    fn len(&self) -> usize {
        self.controllers.len()
            * self.converters.len()
            * self.mu.len()
            * self.v_belt_m_s.len()
            * self.initial.len()
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let (cell, scenario) = self.scenario(index)?;
        let failed = |source| StudyError::Plant {
            row: format!(
                "{} at mu = {}, v_belt = {} m/s from {}",
                cell.controller, cell.mu, cell.v_belt_m_s, cell.initial
            ),
            source,
        };
        let mut trial = Trial::new(&scenario)?;
        let ticks = |seconds: f64| (seconds * f64::from(scenario.run.tick_hz)).round() as u64;
        let (mut statistics, mut attractor) = (Statistics::new(0.0), Attractor::default());
        for _ in 0..ticks(self.transient_s) {
            trial.tick(&mut statistics).map_err(failed)?;
        }
        for _ in 0..ticks(self.record_s) {
            let mut both = (&mut statistics, &mut attractor);
            trial.tick(&mut both).map_err(failed)?;
        }
        Ok(Row {
            controller: cell.controller.clone(),
            converters: cell.converters,
            mu: cell.mu,
            v_belt_m_s: cell.v_belt_m_s,
            initial: cell.initial.to_string(),
            max_theta1_dot_rad_s: attractor.max_theta1_dot_rad_s,
            bouncing: attractor.is_bouncing(),
            contact_fraction: attractor.contact_fraction(),
            lift_offs: statistics.lift_offs,
            first_lift_off_s: statistics.first_lift_off_s,
            fault: trial.fault().map(|fault| fault as u8),
            target_m: cell.target_m,
            tip_t_m: trial.tip_t_m(),
        })
    }
}

/// The whole diagram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagram {
    /// All cells, in the order of their numbers.
    pub rows: Vec<Row>,
    /// One per controller, converter set, friction coefficient and initial condition.
    pub sections: Vec<Section>,
}

/// One controller over all belt speeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Section {
    /// Controller.
    pub controller: Controller,
    /// Converter set.
    pub converters: Converters,
    /// Friction coefficient μ.
    pub mu: f64,
    /// Initial condition.
    pub initial: String,
    /// Belt speeds in all.
    pub cells: usize,
    /// Belt speeds at which the arm keeps bouncing, m/s.
    pub bouncing_m_s: Vec<f64>,
    /// Belt speeds at which the tip left the belt at any time, m/s.
    pub lifted_m_s: Vec<f64>,
    /// Cells that end with a fault.
    pub faults: usize,
    /// Largest θ̇1 while watched, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// Largest distance of the tip from its target at the end, m.
    pub max_error_m: f64,
}

impl Section {
    fn is_of(&self, row: &Row) -> bool {
        (&self.controller, self.converters, self.mu, &self.initial)
            == (&row.controller, row.converters, row.mu, &row.initial)
    }
}

impl Diagram {
    /// Puts the rows of a study together.
    pub fn new(rows: Vec<Row>) -> Self {
        let mut sections: Vec<Section> = Vec::new();
        for row in &rows {
            let place = sections.iter().position(|section| section.is_of(row));
            let place = place.unwrap_or_else(|| {
                sections.push(Section {
                    controller: row.controller.clone(),
                    converters: row.converters,
                    mu: row.mu,
                    initial: row.initial.clone(),
                    cells: 0,
                    bouncing_m_s: Vec::new(),
                    lifted_m_s: Vec::new(),
                    faults: 0,
                    max_theta1_dot_rad_s: f64::NEG_INFINITY,
                    max_error_m: 0.0,
                });
                sections.len() - 1
            });
            let section = &mut sections[place];
            section.cells += 1;
            if row.bouncing {
                section.bouncing_m_s.push(row.v_belt_m_s);
            }
            if row.lift_offs > 0 {
                section.lifted_m_s.push(row.v_belt_m_s);
            }
            section.faults += usize::from(row.fault.is_some());
            section.max_theta1_dot_rad_s =
                section.max_theta1_dot_rad_s.max(row.max_theta1_dot_rad_s);
            section.max_error_m = section.max_error_m.max((row.tip_t_m - row.target_m).abs());
        }
        Self { rows, sections }
    }
}

impl Outcome for Diagram {
    type Line = Row;

    fn lines(&self) -> Vec<Row> {
        self.rows.clone()
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            "converters",
            "μ",
            "from",
            "keeps bouncing",
            "left the belt at all",
            "faults",
            "largest θ̇₁ (rad/s)",
            "farthest from target (mm)",
            "the paper",
        ]);
        for section in &self.sections {
            let of_cells = |speeds: &[f64]| match (speeds.first(), speeds.last()) {
                (Some(first), Some(last)) => {
                    format!(
                        "{} of {} ({first} … {last} m/s)",
                        speeds.len(),
                        section.cells
                    )
                }
                _ => format!("0 of {}", section.cells),
            };
            table.add_row([
                section.controller.to_string(),
                outcome::name(&section.converters),
                section.mu.to_string(),
                section.initial.clone(),
                of_cells(&section.bouncing_m_s),
                of_cells(&section.lifted_m_s),
                section.faults.to_string(),
                format!("{:.3}", section.max_theta1_dot_rad_s),
                format!("{:.2}", 1e3 * section.max_error_m),
                paper::closed_loop_bounces(&section.controller, &section.initial)
                    .unwrap_or("–")
                    .into(),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        const COLOURS: [plotters::style::RGBColor; 5] =
            [BLUE_INK, VERMILLION, GREEN, ORANGE, BLACK_INK];
        let mut panels: Vec<Panel> = Vec::new();
        let together = |one: &Section, other: &Section| {
            (&one.controller, one.converters) == (&other.controller, other.converters)
        };
        for sections in self.sections.chunk_by(together) {
            let marks = sections.iter().zip(COLOURS.iter().cycle());
            let marks = marks.map(|(section, colour)| {
                let rows = self.rows.iter().filter(|row| section.is_of(row));
                let mut points: Vec<(f64, f64)> = rows
                    .map(|row| (row.v_belt_m_s, row.max_theta1_dot_rad_s))
                    .collect();
                points.sort_by(|one, other| one.0.total_cmp(&other.0));
                let bouncing = section.bouncing_m_s.len();
                let name = format!(
                    "μ = {} from x₀,{}: bounces at {bouncing} of {}",
                    section.mu, section.initial, section.cells
                );
                Mark::line(&name, *colour, points)
            });
            let first = &sections[0];
            let highest = sections.iter().fold(1.0, |high: f64, section| {
                high.max(section.max_theta1_dot_rad_s)
            });
            panels.push(Panel {
                title: format!(
                    "Largest θ̇₁ (rad/s): {}, {} converters",
                    first.controller,
                    outcome::name(&first.converters)
                ),
                y: Some(-0.1 * highest..1.1 * highest),
                height: 360,
                marks: marks.collect(),
                ..Panel::default()
            });
        }
        Chart {
            title: "Belt speed with the controller in the loop (Fig. 12)".into(),
            subtitle: "the firmware's controller in this process, behind the same converters"
                .into(),
            x_title: "Belt speed v_belt (m/s)".into(),
            x: None,
            panels,
        }
        .svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(controller: Controller) -> ClosedLoopBifurcation {
        ClosedLoopBifurcation {
            controllers: vec![controller],
            converters: vec![Converters::Hardware],
            mu: vec![0.6],
            v_belt_m_s: vec![-0.9, -0.4],
            initial: vec![Initial::D, Initial::U],
            seed: 1,
            reference: Reference::MinimumJerk(1.0),
            target_m: None,
            transient_s: 2.0,
            record_s: 0.5,
            overrides: Vec::new(),
        }
    }

    #[test]
    fn the_hybrid_law_keeps_the_tip_on_the_belt_from_either_posture() {
        let study = study(Controller::Hybrid);
        study.check().unwrap();
        let rows = super::super::rows(&study, || ()).unwrap();
        assert_eq!(rows.len(), 4);
        for (row, (speed, initial)) in
            rows.iter()
                .zip([(-0.9, "d"), (-0.9, "u"), (-0.4, "d"), (-0.4, "u")])
        {
            assert_eq!((row.v_belt_m_s, row.initial.as_str()), (speed, initial));
            assert_eq!((row.bouncing, row.lift_offs, row.fault), (false, 0, None));
            assert_eq!(row.contact_fraction, 1.0);
            assert!((row.tip_t_m - row.target_m).abs() < 2e-3, "{row:?}");
        }
    }

    #[test]
    fn lift_offs_are_counted_and_the_rest_of_the_motion_is_watched() {
        let study = ClosedLoopBifurcation {
            initial: vec![Initial::U],
            ..study(Controller::Pid)
        };
        let diagram = Diagram::new(super::super::rows(&study, || ()).unwrap());
        assert!(
            diagram
                .rows
                .iter()
                .all(|row| row.lift_offs > 0 && row.first_lift_off_s.is_some())
        );
        assert_eq!(diagram.sections.len(), 1);
        assert_eq!(diagram.sections[0].lifted_m_s, [-0.9, -0.4]);
    }

    #[test]
    fn random_starts_are_followed_in_their_own_posture() {
        let study = ClosedLoopBifurcation {
            initial: (1..=12).map(Initial::Random).collect(),
            v_belt_m_s: vec![-0.4],
            ..study(Controller::Hybrid)
        };
        let targets: Vec<f64> = (0..study.len())
            .map(|index| study.scenario(index).unwrap().0.target_m)
            .collect();
        assert!(
            targets.contains(&0.148) && targets.contains(&0.163),
            "{targets:?}"
        );
    }

    #[test]
    fn what_is_out_of_range_is_told_before_anything_runs() {
        let far = ClosedLoopBifurcation {
            target_m: Some(0.5),
            ..study(Controller::Hybrid)
        };
        let error = far.check().unwrap_err().to_string();
        assert!(error.contains("target_m = 0.5"), "{error}");
        let fast = ClosedLoopBifurcation {
            v_belt_m_s: vec![1e9],
            ..study(Controller::Hybrid)
        };
        assert!(
            fast.check().unwrap_err().to_string().contains("belt."),
            "{:?}",
            fast.check()
        );
    }
}
