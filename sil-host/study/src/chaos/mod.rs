//! Is an orbit periodic or chaotic?
//!
//! - [`tangent`]: a small deviation from an orbit, carried through smooth motion and
//!   across events (saltation), and how fast it grows
//! - [`arm`]: the same along the motion of the simulated arm
//! - [`section`]: its returns to θ̇1 = 0
//! - [`verdict`]: the largest Lyapunov exponent with its uncertainty, the period, and
//!   what follows from them
//!
//! What is measured is the growth of deviations *across* the flow: the part along it,
//! which neither grows nor shrinks, is taken out, so that a periodic orbit has a
//! negative exponent and not zero.

pub mod arm;
pub mod section;
pub mod tangent;
pub mod verdict;

#[cfg(test)]
mod bouncing_ball;
#[cfg(test)]
mod known_answers;

pub use tangent::Tangent;
pub use verdict::{Regime, Return, Verdict};
