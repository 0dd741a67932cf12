//! Tests of the plant against references, and of the documentation that describes it.

mod alternate_readings;
mod bits;
mod contact_force;
mod contact_states;
mod documentation;
mod edges;
mod links;
mod mujoco_arms;
mod open_loop_section;
mod random_frames;
mod settings;
mod trade_off;
