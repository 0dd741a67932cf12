//! The paper's figures and tables.
//!
//! - [`printed`]: the paper's values, for comparison
//! - [`admissible`]: Table II, where on the belt p > 0
//! - [`regions`]: Fig. 3, the solution modes over (θ1, θ̇1)
//! - [`bifurcation`]: Fig. 4, where over μ × v_belt the arm keeps bouncing
//! - [`poincare`]: Fig. 5, periodic and chaotic bouncing
//! - [`sliding_range`]: Z_t,sliding, how far a controller slides
//! - [`closed_loop_bifurcation`]: Fig. 12, bifurcation over the belt speed with the controller in the loop
//! - [`cells`]: the cells of a diagram over friction and belt speed; [`attractor`], [`settled`]: the long-term motion of one
//! - [`chaos`]: classification as periodic or chaotic by the largest Lyapunov exponent

pub mod admissible;
pub mod attractor;
pub mod bifurcation;
mod cell_options;
pub mod cells;
pub mod chaos;
pub mod closed_loop_bifurcation;
mod page_cells;
mod places;
pub mod poincare;
pub mod printed;
pub mod regions;
pub mod settled;
pub mod sliding_range;
