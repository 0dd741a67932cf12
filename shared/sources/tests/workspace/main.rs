//! Checks of the sources of the whole workspace.

#![allow(clippy::unwrap_used)]

mod imports;
mod package;
