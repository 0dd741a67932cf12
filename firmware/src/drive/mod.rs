//! From wanted torques to counts, and the task that does so once a tick.
//!
//! - [`torque`]: kept on the belt, limited, rounded

pub mod torque;
