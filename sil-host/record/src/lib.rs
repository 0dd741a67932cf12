//! Records of a run.
//!
//! - [`recorder`]: the thread that passes ticks and events of a run to its [`Sink`]s
//! - [`messages`]: topics, schemas and messages of a run
//! - [`mcap_log`]: every tick as an MCAP file for Foxglove, PlotJuggler and scripts
//! - [`run_table`], [`comparison`]: recorded runs as columns, and how much they differ
//! - [`csv_table`]: every tick as a row of a CSV file
//! - [`paradox`]: how far the tip is from the paradox
//! - [`plot`]: the run over time as a figure
//! - [`report`]: the results of the run as JSON and as a table
//! - [`export`]: columns of a recorded MCAP file as CSV
//! - [`ros2`]: a record as a ROS 2 bag
//! - [`record_file`]: the messages of a recorded MCAP file, checked

pub mod comparison;
pub mod csv_table;
pub mod events;
pub mod export;
pub mod fields;
pub mod mcap_log;
pub mod messages;
pub mod paradox;
pub mod plot;
pub mod record_file;
pub mod recorder;
pub mod replica;
pub mod report;
pub mod ros2;
pub mod run_table;
pub mod scene;

pub use mcap_log::McapLog;
pub use plot::RunPlot;
pub use recorder::{RecordError, RecordedTick, Recorder, Sink};
