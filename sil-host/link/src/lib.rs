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
//! The plant creates the services and holds the [`PlantEnd`]; the host of the controller holds the
//! [`ControllerEnd`]. A bus has at most one of each. Each end stays in the thread that created it.
//!
//! Frames keep their order. Each direction buffers [`FRAME_BUFFER`] frames; in lockstep at most one
//! is under way. If a receiver falls further behind in real time, the *oldest* frames are dropped,
//! which the receiver sees as a jump of `sequence`.
//!
//! If a peer ends, is killed or falls silent, the other end returns an error within
//! [`DEFAULT_SILENCE_LIMIT`], in every phase; it never hangs. Locks that the kernel releases show
//! which processes are on a bus (`claim`). Every run has its own files (`run_files`), so that no
//! process meets the remains of a killed one. The last process to leave a bus, or the next plant on
//! the machine, removes those remains. A thread watches every call into iceoryx2 (`guardian`).
//!
//! Set `IOX2_LOG_LEVEL=debug` to see the log of iceoryx2; by default iceoryx2 is silent and
//! failures are reported as [`LinkError`].
//!
//! [`SensorFrame`]: painleve_shared::frame::SensorFrame
//! [`ActuatorFrame`]: painleve_shared::frame::ActuatorFrame

mod bell;
mod bus;
mod bus_drive;
mod claim;
mod controller_end;
mod error;
mod guardian;
mod lock_file;
pub mod lockstep;
pub mod paced;
mod patience;
mod place;
mod plant_end;
mod run_files;
mod services;
mod session;
mod survey;
#[cfg(test)]
mod tests;

pub use bus::{BusName, InvalidBusName, Pair};
pub use bus_drive::BusDrive;
pub use controller_end::{ControllerEnd, Received};
pub use error::{FolderError, LinkError};
pub use patience::DEFAULT_SILENCE_LIMIT;
pub use plant_end::PlantEnd;
pub use services::FRAME_BUFFER;
pub use session::{
    CONFIGURATION_CAPACITY, ConfigurationTooLong, Pacing, Session, UnreadableConfiguration,
};
pub use survey::{BusState, SegmentState, Segments, Survey};
