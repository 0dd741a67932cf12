//! Classification of an orbit as periodic or chaotic.
//!
//! - [`tangent`]: a small deviation of an orbit, propagated through smooth motion and
//!   across events (saltation), and its growth
//! - [`arm`]: the deviation along the motion of the simulated arm
//! - [`section`]: the returns of the arm to θ̇1 = 0
//! - [`verdict`]: the largest Lyapunov exponent with its uncertainty, the period, and
//!   the classification
//!
//! The exponent measures the growth of deviations *across* the flow. The component along the flow,
//! which neither grows nor shrinks, is removed, so that a periodic orbit has a
//! negative exponent rather than zero.

pub mod arm;
pub mod section;
pub mod tangent;
pub mod verdict;

#[cfg(test)]
mod bouncing_ball;
#[cfg(test)]
mod known_answers;

pub use tangent::Tangent;
pub use verdict::{Regime, RegimeVerdict, Return};
