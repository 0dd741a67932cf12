//! Where the tip should be: the reference, and the governor that keeps it inside the
//! admissible stretch of the belt.

pub mod governor;
pub mod reference;
