//! `painleve figures`: all of the paper's studies, and one page that sets them beside it.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use clap::Args;
use painleve_chart::PlotError;
use painleve_plant::closed_loop::{ClosedLoop, LoopError, LoopResult, Monitor};
use painleve_plant::controller_host::InProcess;
use painleve_plant::mechanics::PlantParameters;
use painleve_plant::sample::Sample;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::Simulation;
use painleve_record::RunPlot;
use painleve_shared::{Posture, Slip};
use painleve_study::admissible::admissible;
use painleve_study::case::{Controller, Converters, Reference};
use painleve_study::cells::{Cells, RELATIVE_TOLERANCE};
use painleve_study::figures::sections::{closed_loop, open_loop};
use painleve_study::figures::{Page, Section};
use painleve_study::initial::Initial;
use painleve_study::regions::{Settings, Theta2, regions};
use painleve_study::sliding_range::{Criterion, SlidingRange, SlidingRanges};
use painleve_study::{
    Grid, Outcome, StudyError, bifurcation, closed_loop_bifurcation, outcome, paper, poincare,
};
use painleve_system::atomic_file::{self, AtomicFile};

use super::study::options::{Threads, output};
use super::{CommandError, say};

/// Options of `painleve figures`.
#[derive(Debug, Args)]
pub struct FiguresArguments {
    /// Folder for the page, the figures and their data.
    #[arg(long, value_name = "FOLDER", default_value = "out/figures")]
    out: PathBuf,
    /// Coarse grids and short runs, for a first look.
    #[arg(long)]
    draft: bool,
    #[command(flatten)]
    threads: Threads,
}

/// The simulations that the paper shows.
const RUNS: [&str; 4] = [
    "pid-elbow-down",
    "pid-elbow-up",
    "hybrid-elbow-down",
    "hybrid-elbow-up",
];

/// How fine everything is.
struct Fineness {
    map_mu: &'static str,
    map_v_belt: &'static str,
    section_v_belt: &'static str,
    poincare_v_belt: &'static str,
    closed_loop_v_belt: &'static str,
    ideal_v_belt: &'static str,
    open_loop_s: [f64; 2],
    closed_loop_s: [f64; 2],
    scan_step_m: f64,
}

/// The paper's steps and times, in the open loop.
const FULL: Fineness = Fineness {
    map_mu: "0.1:1:0.1",
    map_v_belt: "-1:-0.1:0.005",
    section_v_belt: "-1:-0.1:0.005",
    poincare_v_belt: "-0.6:-0.28:0.001",
    closed_loop_v_belt: "-1:-0.1:0.005",
    ideal_v_belt: "-1:-0.1:0.025",
    open_loop_s: [250.0, 50.0],
    closed_loop_s: [20.0, 10.0],
    scan_step_m: 5e-3,
};

const DRAFT: Fineness = Fineness {
    map_mu: "0.2:1:0.2",
    map_v_belt: "-1:-0.1:0.1",
    section_v_belt: "-1:-0.1:0.05",
    poincare_v_belt: "-0.6:-0.28:0.04",
    closed_loop_v_belt: "-1:-0.1:0.3",
    ideal_v_belt: "-0.4",
    open_loop_s: [60.0, 10.0],
    closed_loop_s: [5.0, 1.0],
    scan_step_m: 5e-2,
};

/// Makes everything, study by study; the page comes last.
pub fn run(arguments: &FiguresArguments) -> Result<(), CommandError> {
    let folder = &arguments.out;
    let page_path = folder.join("index.html");
    AtomicFile::create(&page_path).map_err(output)?;
    let fineness = if arguments.draft { &DRAFT } else { &FULL };
    let made = Makes {
        folder,
        files: RefCell::default(),
        threads: &arguments.threads,
        fineness,
    };
    let mut sections = vec![
        made.admissible()?,
        made.regions()?,
        made.bifurcation_section()?,
        made.bifurcation_map()?,
        made.poincare()?,
        made.sliding_range()?,
        made.closed_loop()?,
    ];
    for name in RUNS {
        sections.push(made.run(name)?);
    }
    let draft = if arguments.draft {
        " This is a draft, on coarse grids and from short runs."
    } else {
        ""
    };
    let page = Page {
        title: "The paper's studies, computed again".into(),
        introduction: format!(
            "Every figure and number of Marchese, Coraggio, Hogan and di Bernardo, Control of Painlevé \
             Paradox in a Robotic System (arXiv:1907.04070), beside what painleve {} finds.{draft}",
            env!("CARGO_PKG_VERSION")
        ),
        sections,
    };
    for (path, contents) in made.files.into_inner() {
        atomic_file::write(path, &contents).map_err(output)?;
    }
    atomic_file::write(&page_path, page.html().as_bytes()).map_err(output)?;
    say(page_path.display())
}

struct Makes<'a> {
    folder: &'a Path,
    /// All that goes beside the page, written when all of it is there: no old and new figures
    /// stand side by side after Ctrl-C.
    files: RefCell<Vec<(PathBuf, Vec<u8>)>>,
    threads: &'a Threads,
    fineness: &'a Fineness,
}

impl Makes<'_> {
    /// Puts the data of a section's outcome beside the page.
    fn save(&self, section: Section, outcome: &impl Outcome) -> Result<Section, CommandError> {
        let path = |ending: &str| self.folder.join(format!("{}.{ending}", section.name));
        let csv = outcome::csv(outcome).map_err(output)?;
        let json = serde_json::to_vec(outcome).map_err(output)?;
        let svg = section.svg.clone().into_bytes();
        self.files.borrow_mut().extend([
            (path("svg"), svg),
            (path("csv"), csv),
            (path("json"), json),
        ]);
        Ok(section)
    }

    fn admissible(&self) -> Result<Section, CommandError> {
        let outcome = admissible(&PlantParameters::default().arm, paper::FRICTION)?;
        self.save(drawn(open_loop::admissible(&outcome))?, &outcome)
    }

    fn regions(&self) -> Result<Section, CommandError> {
        let settings = Settings {
            arm: PlantParameters::default().arm,
            mu: paper::FRICTION,
            theta1_deg: grid("-37:37:0.5")?,
            theta1_dot_rad_s: grid("-8:8:0.2")?,
            theta2: vec![Theta2::Positive, Theta2::Negative],
            slips: vec![Slip::Positive, Slip::Negative],
        };
        let outcome = self.threads.in_pool(|| regions(&settings))??;
        self.save(drawn(open_loop::regions(&outcome))?, &outcome)
    }

    fn cells(&self, mu: &str, v_belt: &str, initial: &[Initial]) -> Result<Cells, CommandError> {
        let [transient_s, record_s] = self.fineness.open_loop_s;
        Ok(Cells {
            plant: PlantParameters::default(),
            relative_tolerance: RELATIVE_TOLERANCE,
            mu: grid(mu)?.values().to_vec(),
            v_belt_m_s: grid(v_belt)?.values().to_vec(),
            initial: initial.to_vec(),
            seed: 1,
            transient_s,
            record_s,
        })
    }

    fn bifurcation_section(&self) -> Result<Section, CommandError> {
        let initial = [Initial::A, Initial::D];
        let cells = self.cells("0.6", self.fineness.section_v_belt, &initial)?;
        let study = bifurcation::Bifurcation { cells };
        let rows = self.threads.compute("Fig. 4: section", &study)?;
        let outcome = bifurcation::Diagram::new(&study, rows);
        self.save(drawn(open_loop::bifurcation_section(&outcome))?, &outcome)
    }

    fn bifurcation_map(&self) -> Result<Section, CommandError> {
        let fineness = self.fineness;
        let cells = self.cells(fineness.map_mu, fineness.map_v_belt, &[Initial::A])?;
        let study = bifurcation::Bifurcation { cells };
        let rows = self.threads.compute("Friction and belt speed", &study)?;
        let outcome = bifurcation::Diagram::new(&study, rows);
        self.save(drawn(open_loop::bifurcation_map(&outcome))?, &outcome)
    }

    fn poincare(&self) -> Result<Section, CommandError> {
        let cells = self.cells("0.6", self.fineness.poincare_v_belt, &[Initial::A])?;
        let study = poincare::Poincare { cells };
        let rows = self.threads.compute("Fig. 5: Poincaré", &study)?;
        let outcome = poincare::Diagram::new(&study, rows);
        self.save(drawn(open_loop::poincare(&outcome))?, &outcome)
    }

    fn sliding_range(&self) -> Result<Section, CommandError> {
        let study = SlidingRange {
            controllers: Controller::ALL.to_vec(),
            converters: vec![Converters::Ideal, Converters::Hardware],
            postures: vec![Posture::ElbowDown, Posture::ElbowUp],
            mu: vec![paper::FRICTION],
            references: vec![Reference::MinimumJerk(3.0)],
            overrides: Vec::new(),
            criterion: Criterion {
                scan_step_m: self.fineness.scan_step_m,
                ..Criterion::default()
            },
        };
        // What the reference is worth.
        let ramps = SlidingRange {
            controllers: vec![Controller::Pid, Controller::Hybrid],
            converters: vec![Converters::Ideal],
            postures: vec![Posture::ElbowDown],
            references: vec![Reference::Ramp(2.0), Reference::Ramp(3.0)],
            ..study.clone()
        };
        let mut rows = self.threads.compute("Sliding range", &study)?;
        rows.extend(self.threads.compute("Sliding range, ramps", &ramps)?);
        let outcome = SlidingRanges { rows };
        self.save(drawn(closed_loop::sliding_range(&outcome))?, &outcome)
    }

    fn closed_loop(&self) -> Result<Section, CommandError> {
        let fineness = self.fineness;
        let [transient_s, record_s] = fineness.closed_loop_s;
        let hardware = closed_loop_bifurcation::ClosedLoopBifurcation {
            controllers: vec![
                Controller::HybridPaper,
                Controller::HybridPaperModel,
                Controller::Hybrid,
            ],
            converters: vec![Converters::Hardware],
            mu: vec![paper::FRICTION],
            v_belt_m_s: grid(fineness.closed_loop_v_belt)?.values().to_vec(),
            initial: vec![Initial::D, Initial::U],
            seed: 1,
            reference: Reference::MinimumJerk(3.0),
            target_m: None,
            transient_s,
            record_s,
            overrides: Vec::new(),
        };
        // As near to the paper as sampling goes; ten times the ticks, so fewer speeds.
        let ideal = closed_loop_bifurcation::ClosedLoopBifurcation {
            controllers: vec![Controller::HybridPaper],
            converters: vec![Converters::Ideal],
            v_belt_m_s: grid(fineness.ideal_v_belt)?.values().to_vec(),
            initial: vec![Initial::D],
            ..hardware.clone()
        };
        let mut rows = self.threads.compute("Fig. 12: ideal", &ideal)?;
        rows.extend(self.threads.compute("Fig. 12: hardware", &hardware)?);
        let outcome = closed_loop_bifurcation::Diagram::new(rows);
        self.save(drawn(closed_loop::diagram(&outcome))?, &outcome)
    }

    fn run(&self, name: &str) -> Result<Section, CommandError> {
        let scenario = Scenario::load(name, &[])?;
        let subtitle = format!(
            "law: {} · {} Hz · μ = {}",
            scenario.controller.law.name(),
            scenario.run.tick_hz,
            scenario.belt.friction
        );
        let mut drawing = Drawing(RunPlot::new(name, subtitle));
        let result = simulate(&scenario, &mut drawing)?;
        let svg = drawn(drawing.0.svg())?;
        let section = closed_loop::run(&scenario, &result, svg);
        let path = self.folder.join(format!("{}.svg", section.name));
        self.files
            .borrow_mut()
            .push((path, section.svg.clone().into_bytes()));
        Ok(section)
    }
}

/// Draws a run while it goes on.
struct Drawing(RunPlot);

impl Monitor for Drawing {
    fn sample(&mut self, sample: &Sample) -> Result<(), LoopError> {
        self.0.push(sample);
        Ok(())
    }
}

/// Runs a scenario in this process.
fn simulate(scenario: &Scenario, monitor: &mut impl Monitor) -> Result<LoopResult, CommandError> {
    let range = |source| ScenarioError::Range {
        origin: scenario.name.clone(),
        source,
    };
    let simulation = Simulation::new(scenario).map_err(range)?;
    let host = InProcess::new(&scenario.controller_configuration()).map_err(range)?;
    let mut running = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        running.tick(monitor)?;
    }
    Ok(running.finish().0)
}

fn drawn<T>(figure: Result<T, PlotError>) -> Result<T, CommandError> {
    Ok(figure.map_err(StudyError::from)?)
}

/// A grid that is known to be one.
fn grid(text: &str) -> Result<Grid, CommandError> {
    let wrong = |error: painleve_study::GridError| StudyError::Option(error.to_string());
    Ok(text.parse().map_err(wrong)?)
}
