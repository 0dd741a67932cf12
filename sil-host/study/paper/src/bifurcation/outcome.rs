//! The outcome of all cells: the belt speeds with bouncing at each friction coefficient.

use comfy_table::Table;
use painleve_study_core::initial::Initial;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Bifurcation, Row};
use crate::cells::Cells;
use crate::printed;

/// The whole diagram.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BifurcationDiagram {
    /// All cells, in the order of their numbers.
    pub rows: Vec<Row>,
    /// Belt speeds with bouncing.
    pub windows: Vec<Window>,
    #[serde(skip)]
    settings: Cells,
}

/// Belt speeds with bouncing at one friction coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Window {
    /// Friction coefficient μ.
    pub mu: f64,
    /// Initial condition; `random` for all random ones together, one of which must
    /// bounce.
    pub initial: String,
    /// Intervals of belt speed, m/s, bounded by the outermost of adjacent speeds with bouncing.
    pub v_belt_m_s: Vec<[f64; 2]>,
    /// Number of cells with bouncing.
    pub bouncing: usize,
    /// Number of cells.
    pub cells: usize,
    /// Largest θ̇1, rad/s.
    pub max_theta1_dot_rad_s: f64,
    /// The paper's belt speeds with bouncing, m/s, if it has any here.
    pub paper_m_s: Option<[f64; 2]>,
}

impl BifurcationDiagram {
    /// Collects the rows of a study.
    pub fn new(study: &Bifurcation, rows: Vec<Row>) -> Self {
        let settings = study.cells.clone();
        let mut diagram = Self {
            rows,
            windows: Vec::new(),
            settings,
        };
        diagram.windows = (0..diagram.settings.mu.len())
            .flat_map(|mu| {
                let groups = diagram.groups();
                groups.into_iter().map(move |group| (mu, group))
            })
            .map(|(mu, group)| diagram.window(mu, group))
            .collect();
        diagram
    }

    /// Returns the varied parameters.
    pub fn settings(&self) -> &Cells {
        &self.settings
    }

    /// Returns the names of the initial conditions, with all random ones as one.
    pub fn groups(&self) -> Vec<&'static str> {
        let initial = self.settings.initial.iter();
        let mut groups: Vec<&str> = initial.map(|one| one.group()).collect();
        groups.dedup();
        groups
    }

    /// Returns the rows of one friction coefficient and belt speed (both by index) and group of
    /// initial conditions.
    pub fn at(&self, mu: usize, v_belt: usize, group: &str) -> impl Iterator<Item = &Row> {
        let Cells {
            v_belt_m_s,
            initial,
            ..
        } = &self.settings;
        let first = (mu * v_belt_m_s.len() + v_belt) * initial.len();
        let rows = &self.rows[first..first + initial.len()];
        rows.iter()
            .zip(initial)
            .filter(move |(_, initial)| initial.group() == group)
            .map(|(row, _)| row)
    }

    /// Returns the indices of the belt speeds in ascending order.
    pub fn rising_speeds(&self) -> Vec<usize> {
        let speeds = &self.settings.v_belt_m_s;
        let mut places: Vec<usize> = (0..speeds.len()).collect();
        places.sort_by(|&one, &other| speeds[one].total_cmp(&speeds[other]));
        places
    }

    fn window(&self, place: usize, group: &str) -> Window {
        let mu = self.settings.mu[place];
        let paper = printed::critical_friction(&self.settings.plant.arm)
            .filter(|critical| mu >= *critical && group == Initial::A.group());
        let mut window = Window {
            mu,
            initial: group.to_owned(),
            v_belt_m_s: Vec::new(),
            bouncing: 0,
            cells: 0,
            max_theta1_dot_rad_s: f64::NEG_INFINITY,
            paper_m_s: paper.map(|_| printed::BOUNCING_M_S),
        };
        let mut goes_on = false;
        for v_belt in self.rising_speeds() {
            let speed = self.settings.v_belt_m_s[v_belt];
            let mut bouncing = false;
            for row in self.at(place, v_belt, group) {
                window.cells += 1;
                window.bouncing += usize::from(row.bouncing);
                window.max_theta1_dot_rad_s =
                    window.max_theta1_dot_rad_s.max(row.max_theta1_dot_rad_s);
                bouncing |= row.bouncing;
            }
            match window.v_belt_m_s.last_mut() {
                Some(stretch) if bouncing && goes_on => stretch[1] = speed,
                _ if bouncing => window.v_belt_m_s.push([speed, speed]),
                _ => {}
            }
            goes_on = bouncing;
        }
        window
    }
}

impl Outcome for BifurcationDiagram {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "μ",
            "from",
            "bouncing for v_belt in m/s",
            "cells",
            "largest θ̇1 in rad/s",
            "paper: v_belt in m/s",
        ]);
        let stretch = |[from, to]: [f64; 2]| format!("{from} … {to}");
        // The paper starts its own arm from x0,a and x0,d.
        let is_of_paper = |initial: &str| {
            printed::critical_friction(&self.settings.plant.arm).is_some()
                && [Initial::A, Initial::D]
                    .map(Initial::group)
                    .contains(&initial)
        };
        for window in &self.windows {
            let speeds: Vec<String> = window.v_belt_m_s.iter().copied().map(stretch).collect();
            table.add_row([
                window.mu.to_string(),
                window.initial.clone(),
                if speeds.is_empty() {
                    "none".to_owned()
                } else {
                    speeds.join(", ")
                },
                format!("{} of {}", window.bouncing, window.cells),
                format!("{:.3}", window.max_theta1_dot_rad_s + 0.0),
                match window.paper_m_s {
                    Some(speeds) => stretch(speeds),
                    None if is_of_paper(&window.initial) => "none".to_owned(),
                    None => "–".to_owned(),
                },
            ]);
        }
        table
    }
}
