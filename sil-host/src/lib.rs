//! The host side of the bench: a simulated arm on a moving belt with its
//! converters, and everything around it.
//!
//! - [`plant`]: the hybrid rigid-body model
//! - [`converters`], [`simulation`]: the plant as the controller's wires see it
//! - [`controller_host`], [`link`], [`realtime`]: whatever runs the controller, and how to reach it
//! - [`board`]: the controller's image on a microcontroller, emulated or on a serial line
//! - [`timing`]: what its ticks cost
//! - [`closed_loop`]: sample, exchange, record, advance
//! - [`scenario`]: everything that defines a run, as a TOML file
//! - [`study`]: the paper's studies, many runs at a time
//! - [`figures`]: the page that sets them beside the paper
//! - [`sweep`]: studies in shards, on many machines
//! - [`record`], [`plot`], [`report`]: what a run leaves behind
//! - [`commands`]: the `painleve` command; [`interrupt`], [`lifetime`]: its processes' ends

pub mod atomic_file;
pub mod board;
pub mod closed_loop;
pub mod commands;
pub mod controller_host;
pub mod converters;
pub mod figures;
pub mod interrupt;
pub mod lifetime;
pub mod link;
pub mod plant;
pub mod plot;
pub mod realtime;
pub mod record;
pub mod report;
pub mod scenario;
pub mod simulation;
pub mod study;
pub mod sweep;
pub mod timing;
