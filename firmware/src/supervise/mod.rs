//! What the controller may do: the supervisor's states, and the faults that stop it.

pub mod lapses;
pub mod supervisor;
