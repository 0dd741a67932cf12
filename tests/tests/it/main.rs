//! End-to-end tests: real processes, real shared memory, real QEMU.

mod bound;
mod broken_lines;
mod browser;
mod campaigns;
mod comparisons;
mod deadlines;
mod doctor;
mod documentation;
mod failures;
mod files;
mod first_ten_things;
mod foxglove;
mod hardware_in_the_loop;
mod hostile_surroundings;
mod json;
mod live;
mod processor_in_the_loop;
mod promises;
mod python;
mod ros2;
mod runs;
mod scarce_resources;
mod soak;
mod studies;
mod sweeps;
mod tuning;
