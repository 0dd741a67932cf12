//! Tests of the crate, in one binary.

#![allow(clippy::unwrap_used)]

mod drivers;
mod models;
