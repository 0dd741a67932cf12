//! Tests of the studies as a user runs them.

mod beyond_the_paper;
mod bifurcation;
mod malformed_input;
mod options;
mod page_commands;
mod page_figures;
