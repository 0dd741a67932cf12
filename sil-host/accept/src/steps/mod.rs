//! The steps of an acceptance, in their order.

pub mod clock;
pub mod converter;
pub mod enable;
pub mod flash;
pub mod identity;
pub mod line;
pub mod log;
pub mod options;
pub mod release;
pub mod sensors;
pub mod ticks;
pub mod watchdogs;

use painleve_board::Port;

use crate::bench::{Bench, StepError};
use crate::report::Check;

/// One step.
pub struct Step<P: Port> {
    /// Name.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// Carries it out on a board that waits for frames.
    pub carry_out: fn(&mut Bench<P>) -> Result<Vec<Check>, StepError>,
}

/// Number of steps.
pub const COUNT: usize = 12;

/// Returns the steps in their order.
pub fn steps<P: Port>() -> [Step<P>; COUNT] {
    [
        Step {
            name: "identity",
            question: "Is it the right chip, with this program's image?",
            carry_out: identity::measure,
        },
        Step {
            name: "clock",
            question: "Does the processor's clock agree with the host's?",
            carry_out: clock::measure,
        },
        Step {
            name: "options",
            question: "Do the option bytes have the values that the image relies on?",
            carry_out: options::measure,
        },
        Step {
            name: "line",
            question: "Does the serial line carry its full rate without errors, in both directions?",
            carry_out: line::measure,
        },
        Step {
            name: "ticks",
            question: "Are a closed loop's answers those of this program, bit by bit, and within the bound of cycles?",
            carry_out: ticks::measure,
        },
        Step {
            name: "converter",
            question: "Do the outputs of u1 and u2 follow their codes?",
            carry_out: converter::measure,
        },
        Step {
            name: "enable",
            question: "Do ENABLE, RESET and READY reach the board, and do the torque stages stay off?",
            carry_out: enable::measure,
        },
        Step {
            name: "sensors",
            question: "Are sensor lines that are open or shorted no readings?",
            carry_out: sensors::measure,
        },
        Step {
            name: "release",
            question: "How late after the control timer does a tick begin?",
            carry_out: release::measure,
        },
        Step {
            name: "watchdogs",
            question: "Does each watchdog reset the board when ticks cease, in its time?",
            carry_out: watchdogs::measure,
        },
        Step {
            name: "flash",
            question: "Is a configuration kept, also when a reset interrupts the storing?",
            carry_out: flash::measure,
        },
        Step {
            name: "log",
            question: "Does the image write its log, and wait for no reader?",
            carry_out: log::measure,
        },
    ]
}
