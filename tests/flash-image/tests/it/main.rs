//! Tests of the images that are flashed, executed on modelled boards.

mod accept;
mod boot;
mod bound;
mod closed_loop;
mod control_rates;
mod dead_force_cell;
mod drive;
mod hazards;
mod open_loop;
mod random_faults;
mod release;
mod stored;
mod stuck_sensors;
mod tables;
