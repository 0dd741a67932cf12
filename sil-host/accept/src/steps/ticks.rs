//! A closed loop on the board, beside the same controller in this program.

use painleve_board::{ConnectedBoard, Port};
use painleve_plant::Controller;
use painleve_plant::simulation::Simulation;

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// Ticks of the loop. The first ones, at which the drive arms, are among the longest.
const TICKS: usize = 400;

/// Fewest cycles of a tick: it has more instructions.
const FEWEST: u32 = 500;

/// Factor between the usual cycles of a tick and those of the model, which takes two for every instruction: one cycle is the
/// processor's least, and four are those of a program that waits for every line of flash.
const TOLERANCE: u32 = 2;

/// Runs the loop.
///
/// # Errors
/// [`StepError`] if the board does not answer.
pub fn measure<P: Port>(bench: &mut Bench<P>) -> Result<Vec<Check>, StepError> {
    let chip = bench.chip()?;
    let (limit, usual) = (chip.tick_cycles, chip.usual_tick_cycles);
    let scenario = bench.scenario().clone();
    let failed = |error: &dyn core::fmt::Display| Ok(vec![Check::failure(&error)]);
    let (mut simulation, mut controller) = match (
        Simulation::new(&scenario),
        Controller::new(&scenario.controller_configuration()),
    ) {
        (Ok(simulation), Ok(controller)) => (simulation, controller),
        (Err(error), _) => return failed(&error),
        (_, Err(error)) => return failed(&error),
    };
    let mut cycles = Vec::new();
    let mut equal = 0;
    let mut first_other = None;
    for tick in 0..TICKS {
        let frame = match simulation.sample(&mut ()) {
            Ok(frame) => frame,
            Err(error) => return failed(&error),
        };
        let answer = bench.board.exchange(&frame)?;
        let expected = controller.tick(&frame);
        if answer.frame == expected {
            equal += 1;
        } else {
            first_other.get_or_insert(tick);
        }
        cycles.push(answer.cost);
        // Both loops go on with the same torque, so that one wrong answer is one.
        if let Err(error) = simulation.advance(Some(&expected), &mut ()) {
            return failed(&error);
        }
    }
    cycles.sort_unstable();
    let (shortest, median, longest) = (cycles[0], cycles[TICKS / 2], cycles[TICKS - 1]);
    let others = first_other.map_or(String::new(), |tick| {
        format!("; the first other one at tick {tick}")
    });
    Ok(vec![
        Check::new(
            "answers equal to this program's",
            format_args!("{equal} of {TICKS}{others}"),
            "all, bit by bit",
            equal == TICKS,
        ),
        Check::new(
            "longest tick, answer and update",
            format_args!("{longest} cycles"),
            format_args!("at most {limit} cycles, the proved bound"),
            longest <= limit,
        ),
        Check::new(
            "shortest tick",
            format_args!("{shortest} cycles"),
            format_args!("at least {FEWEST}: the cycle counter counts"),
            shortest >= FEWEST,
        ),
        Check::new(
            "usual tick: median of answer and update",
            format_args!("{median} cycles"),
            format_args!("{usual} cycles by the model, or between half and twice as many"),
            (usual / TOLERANCE..=TOLERANCE * usual).contains(&median),
        ),
    ])
}
