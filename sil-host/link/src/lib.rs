//! The link between plant and controller: shared memory, one bus per run.
//!
//! A *bus* is a name. On it live three iceoryx2 publish/subscribe services:
//!
//! | service                   | payload                        | direction           |
//! |---------------------------|--------------------------------|---------------------|
//! | `painleve/<bus>/session`  | `Begin` (kept for late joiners), `End` | plant → controller |
//! | `painleve/<bus>/sensor`   | [`SensorFrame`]                | plant → controller  |
//! | `painleve/<bus>/actuator` | [`ActuatorFrame`]              | controller → plant  |
//!
//! The plant makes the services and holds the [`PlantEnd`]; whatever hosts the
//! controller holds the [`ControllerEnd`]. There is at most one of each on a
//! bus. Both ends stay in the thread that made them.
//!
//! Frames keep their order. Each direction buffers [`FRAME_BUFFER`] frames; in
//! lockstep at most one is ever under way. When a receiver falls further behind
//! in real time, the *oldest* frames are dropped, which it sees as a jump of
//! `sequence`.
//!
//! A peer that has ended, was killed or stays silent becomes an error within
//! [`DEFAULT_SILENCE_LIMIT`], never a hang, in every phase. Who is on a bus is told by locks
//! that the kernel releases (`claim`). Every run has files of its own (`run_files`), so that
//! nobody meets what a killed process has left; the last on a bus, or the next plant on the
//! machine, removes it. A thread watches every call into iceoryx2 (`guardian`).
//!
//! Set `IOX2_LOG_LEVEL=debug` to see what iceoryx2 itself has to say; otherwise
//! it is quiet and [`LinkError`] speaks.
//!
//! [`SensorFrame`]: painleve_shared::frame::SensorFrame
//! [`ActuatorFrame`]: painleve_shared::frame::ActuatorFrame

mod bus;
mod bus_drive;
mod claim;
mod controller_end;
mod error;
mod guardian;
pub mod lockstep;
pub mod paced;
mod patience;
mod place;
mod plant_end;
mod run_files;
mod services;
mod session;
#[cfg(test)]
mod tests;

pub use bus::BusName;
pub use bus_drive::BusDrive;
pub use controller_end::{ControllerEnd, Received};
pub use error::LinkError;
pub use patience::DEFAULT_SILENCE_LIMIT;
pub use plant_end::PlantEnd;
pub use services::FRAME_BUFFER;
pub use session::{CONFIGURATION_CAPACITY, Pacing, Session};
