//! Work-precision diagram: error against cost for one second of sliding under torques that change
//! every millisecond, or every 50 ms, with this plant's methods, SciPy's and MuJoCo.
//!
//! ```text
//! python3 -m venv target/peers && target/peers/bin/pip install numpy scipy mujoco
//! cargo bench -p painleve-study --bench work_precision
//! ```
//!
//! Writes `benches/work_precision/results.csv` and `docs/images/work-precision.svg`. Without the
//! Python environment, or with `PAINLEVE_KEEP_PEERS=1`, the other programs' rows of an earlier run are
//! kept; with `-- --redraw` at the end of the command only the figure is drawn again. The error is
//! the largest deviation of either link angle at any tick from the plant's own solution with a tolerance of
//! 1e-13; SciPy's methods, which share no code with it, converge to the same solution.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::cash_karp::ShortStep;
use painleve_plant::mechanics::compliant::{CompliantArmOnBelt, ContactKind, TipContact};
use painleve_plant::mechanics::dop853::{Dop853Step, Tolerance};
use painleve_plant::mechanics::effects::Effects;
use painleve_plant::mechanics::motion::{Motion, theta};
use painleve_plant::mechanics::torque::TorqueSegment;
use painleve_plant::mechanics::turned_pose::KnownPose;
use painleve_plant::mechanics::{ArmOnBelt, InitialState, PlantParameters, SolverSettings};
use painleve_plant::{ContactMode, Plant, State};
use painleve_shared::{Arm, ArmParameters, JointTorque};

#[path = "work_precision/figure.rs"]
mod figure;

use figure::{Outcome, PANELS, Row, is_ours, kept, row, svg};

/// Simulated time, s.
const DURATION_S: f64 = 1.0;

/// Torques that change from tick to tick.
#[derive(Clone, Copy)]
struct Ticks {
    count: usize,
}

impl Ticks {
    fn time_s(self, tick: usize) -> f64 {
        tick as f64 * DURATION_S / self.count as f64
    }
}

fn torque_nm(tick: usize) -> JointTorque<f64> {
    JointTorque::new(0.01 * (tick % 7) as f64, 0.005 * (tick % 5) as f64)
}

fn parameters(relative_tolerance: f64) -> PlantParameters {
    PlantParameters {
        belt: BeltProfile::Constant { speed_m_s: -0.4 },
        solver: SolverSettings {
            relative_tolerance,
            absolute_tolerance: (0.1 * relative_tolerance).max(1e-14),
            ..SolverSettings::default()
        },
        ..PlantParameters::default()
    }
}

/// The state of rest to which the arm slides without torque.
fn attractor() -> Outcome<State> {
    let mut plant = ArmOnBelt::new(
        &parameters(1e-12),
        InitialState::default().state(&ArmParameters::default())?,
    )?;
    plant.advance(60.0, &mut ())?;
    Ok(*plant.state())
}

/// The plant's states at all ticks. An arm that stopped sliding would be no test of methods without
/// events.
fn solved(ticks: Ticks, start: State, relative_tolerance: f64) -> Outcome<Vec<State>> {
    let mut plant = ArmOnBelt::new(&parameters(relative_tolerance), start)?;
    let mut states = vec![start];
    for tick in 0..ticks.count {
        plant.command_torque(torque_nm(tick), 0.0);
        plant.advance(ticks.time_s(tick + 1), &mut ())?;
        states.push(*plant.state());
        if plant.mode() != ContactMode::SlidePositive {
            return Err("the arm does not slide".into());
        }
    }
    Ok(states)
}

/// The states at all ticks by one method alone, with adaptive steps, projected onto the belt.
fn by_one_method(
    ticks: Ticks,
    start: State,
    relative: f64,
    order: f64,
    mut step: impl FnMut(&Motion<'_>, f64, &State, f64, &Tolerance) -> (State, f64),
) -> Outcome<Vec<State>> {
    let parameters = parameters(relative);
    let arm = Arm::new(parameters.arm)?;
    let absolute = parameters.solver.absolute_tolerance;
    let tolerance = Tolerance { relative, absolute };
    let (mut states, mut state, mut size_s) = (vec![start], start, 1e-3_f64);
    for tick in 0..ticks.count {
        let motion = Motion {
            arm: &arm,
            belt: &parameters.belt,
            friction: parameters.friction,
            torque: TorqueSegment::constant(torque_nm(tick)),
        };
        let (mut now_s, end_s) = (ticks.time_s(tick), ticks.time_s(tick + 1));
        while end_s - now_s > 1e-12 {
            let tried_s = size_s.min(end_s - now_s);
            let (end, error) = step(&motion, now_s, &state, tried_s, &tolerance);
            let factor = (0.9 * error.powf(-1.0 / order)).clamp(0.2, 6.0);
            if error <= 1.0 {
                now_s += tried_s;
                state = motion.onto_belt(&end);
                let proposed_s = tried_s * factor;
                // A truncated step does not limit the next one.
                size_s = if tried_s < size_s {
                    size_s.max(proposed_s)
                } else {
                    proposed_s
                };
            } else {
                size_s = tried_s * factor;
            }
        }
        states.push(state);
    }
    Ok(states)
}

fn order_5(ticks: Ticks, start: State, relative: f64) -> Outcome<Vec<State>> {
    by_one_method(
        ticks,
        start,
        relative,
        5.0,
        |motion, now_s, state, size_s, tolerance| {
            let mode = ContactMode::SlidePositive;
            let torque_nm = motion.torque.at(now_s);
            let known = KnownPose::new(&theta(state));
            let slope = motion.derivative_near(&known, mode, now_s, torque_nm, state);
            let derivative =
                |_, t, x: &State| motion.derivative_near(&known, mode, t, torque_nm, x);
            let step = ShortStep::take(derivative, now_s, state, &slope, size_s, tolerance);
            (step.end, step.error)
        },
    )
}

fn order_8(ticks: Ticks, start: State, relative: f64) -> Outcome<Vec<State>> {
    let mut step = Dop853Step::empty();
    by_one_method(
        ticks,
        start,
        relative,
        8.0,
        |motion, now_s, state, size_s, tolerance| {
            let derivative =
                |t: f64, x: &State| motion.derivative(ContactMode::SlidePositive, t, x);
            let slope = derivative(now_s, state);
            step.take(&derivative, now_s, state, &slope, size_s, tolerance);
            (step.end, step.error)
        },
    )
}

fn compliant(ticks: Ticks, start: State, relative: f64) -> Outcome<Vec<State>> {
    let contact = TipContact {
        kind: ContactKind::Compliant,
        ..TipContact::default()
    };
    let parameters = parameters(relative);
    let mut plant = CompliantArmOnBelt::new(&parameters, &contact, &Effects::default(), start)?;
    let mut states = vec![start];
    for tick in 0..ticks.count {
        plant.command_torque(torque_nm(tick), 0.0);
        plant.advance(ticks.time_s(tick + 1), &mut ())?;
        let angles = plant.link_angles_rad();
        states.push(State::new(angles.first(), angles.second(), 0.0, 0.0));
    }
    Ok(states)
}

fn error_rad(states: &[State], reference: &[State]) -> f64 {
    let pairs = states.iter().zip(reference);
    pairs.fold(0.0, |worst, (state, exact)| {
        let difference = theta(&(state - exact));
        difference.amax().max(worst)
    })
}

/// Median time of a second of simulation and its error.
fn measured(
    ticks: Ticks,
    program: &str,
    setting: f64,
    reference: &[State],
    solve: impl Fn() -> Outcome<Vec<State>>,
) -> Outcome<Row> {
    let mut times_s = Vec::new();
    let mut states = solve()?;
    for _ in 0..25 {
        let start = Instant::now();
        states = solve()?;
        times_s.push(start.elapsed().as_secs_f64());
    }
    times_s.sort_by(f64::total_cmp);
    Ok(Row {
        ticks: ticks.count,
        program: program.into(),
        setting,
        cpu_s_per_s: times_s[times_s.len() / 2] / DURATION_S,
        error_rad: error_rad(&states, reference),
    })
}

fn ours(ticks: Ticks, reference: &[State]) -> Outcome<Vec<Row>> {
    let start = reference[0];
    let mut rows = Vec::new();
    for exponent in 3..=12 {
        let relative = 10_f64.powi(-exponent);
        let name = "painleve (order 5(4), else 8(5,3))";
        rows.push(measured(ticks, name, relative, reference, || {
            solved(ticks, start, relative)
        })?);
        let name = "painleve, order 5(4) alone";
        rows.push(measured(ticks, name, relative, reference, || {
            order_5(ticks, start, relative)
        })?);
        let name = "painleve, order 8(5,3) alone";
        rows.push(measured(ticks, name, relative, reference, || {
            order_8(ticks, start, relative)
        })?);
        if exponent <= 9 {
            let name = "painleve, compliant contact";
            rows.push(measured(ticks, name, relative, reference, || {
                compliant(ticks, start, relative)
            })?);
        }
    }
    Ok(rows)
}

/// Returns the rows of the other programs: measured now, or kept from an earlier run.
fn others(ticks: Ticks, root: &Path, results: &Path, reference: &[State]) -> Outcome<Vec<Row>> {
    let python = root.join("target/peers/bin/python");
    let text = if python.exists() && std::env::var_os("PAINLEVE_KEEP_PEERS").is_none() {
        let path = root.join("target/work-precision-reference.csv");
        let mut text = String::from("time_s,theta1_rad,theta2_rad,u1_nm,u2_nm\n");
        for (tick, state) in reference.iter().enumerate() {
            let torque = torque_nm(tick);
            let (u1, u2) = (torque.first(), torque.second());
            writeln!(
                text,
                "{},{:e},{:e},{u1},{u2}",
                ticks.time_s(tick),
                state[0],
                state[1]
            )?;
        }
        std::fs::write(&path, text)?;
        let script = root.join("benches/work_precision/peers.py");
        let done = Command::new(python)
            .arg(script)
            .arg(path)
            // Where MuJoCo writes its log.
            .current_dir(root.join("target"))
            .output()?;
        if !done.status.success() {
            return Err(String::from_utf8_lossy(&done.stderr).into());
        }
        String::from_utf8(done.stdout)?
    } else {
        println!("no target/peers: the other programs' rows are kept");
        let mut rows = kept(ticks.count, results)?;
        rows.retain(|row| !is_ours(&row.program));
        return Ok(rows);
    };
    text.lines().map(|line| row(ticks.count, line)).collect()
}

fn run() -> Outcome<()> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let results = root.join("benches/work_precision/results.csv");
    let figure = root.join("docs/images/work-precision.svg");
    let mut rows = Vec::new();
    if std::env::args().any(|argument| argument == "--redraw") {
        for (count, _) in PANELS {
            rows.extend(kept(count, &results)?);
        }
        return Ok(std::fs::write(figure, svg(&rows))?);
    }
    for (count, _) in PANELS {
        let ticks = Ticks { count };
        let reference = solved(ticks, attractor()?, 1e-13)?;
        rows.extend(ours(ticks, &reference)?);
        rows.extend(others(ticks, &root, &results, &reference)?);
    }
    let mut text = String::from(
        "# Written by cargo bench -p painleve-study --bench work_precision; setting: relative tolerance, or step (s) of MuJoCo\nticks_per_s,program,setting,cpu_s_per_s,error_rad\n",
    );
    for row in &rows {
        writeln!(
            text,
            "{},\"{}\",{:e},{:.4e},{:.4e}",
            row.ticks, row.program, row.setting, row.cpu_s_per_s, row.error_rad
        )?;
    }
    std::fs::write(results, &text)?;
    std::fs::write(figure, svg(&rows))?;
    print!("{text}");
    Ok(())
}

fn main() -> ExitCode {
    // `cargo test --benches` runs this without `--bench`.
    if !std::env::args().any(|argument| argument == "--bench") {
        return ExitCode::SUCCESS;
    }
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
