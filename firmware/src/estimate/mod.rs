//! What the controller makes of its sensors: joint angles and rates, contact, friction, the
//! belt's direction, unknown torque, the links' length.

pub mod belt;
pub mod calibration;
pub mod contact;
pub mod disturbance;
pub mod friction;
pub mod joints;
pub mod model;
