//! Supervision: the supervisor's states, and the lapses and faults that stop the drive.

pub mod lapses;
pub mod supervisor;
