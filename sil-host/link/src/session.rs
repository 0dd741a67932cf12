//! The session message: what the plant announces about a run before its first
//! frame.

use iceoryx2::prelude::ZeroCopySend;
use painleve_plant::Configuration;
use painleve_plant::law_choice::build;
use painleve_plant::scenario::Scenario;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest size of a session's configuration in bytes.
pub const CONFIGURATION_CAPACITY: usize = 2048;

/// The configuration does not fit the session message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the configuration takes {length} bytes; at most {CONFIGURATION_CAPACITY} fit the link")]
pub struct ConfigurationTooLong {
    /// Its length in bytes.
    pub length: usize,
}

/// How the plant paces its ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Pacing {
    /// Tick by tick, as fast as both ends can run; deterministic.
    Lockstep,
    /// At wall-clock rate, whether or not the controller has answered.
    Realtime,
}

impl Pacing {
    /// Returns the name as it is written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lockstep => "lockstep",
            Self::Realtime => "realtime",
        }
    }
}

/// The description of a run that the controller receives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Session {
    /// Control ticks per simulated second; not 0.
    pub tick_hz: u32,
    /// Pacing of the plant.
    pub pacing: Pacing,
    /// The plant's build and the controller's configuration, encoded with postcard, at most
    /// [`CONFIGURATION_CAPACITY`] bytes; the ends do not interpret it.
    pub configuration: Vec<u8>,
}

/// A controller cannot read the configuration that its plant has sent.
#[derive(Debug, Error)]
pub enum UnreadableConfiguration {
    /// Controller and plant have been built from different sources.
    #[error(
        "the plant is build {plant:016x}, this controller build {:016x}: use the same program for both ends",
        build()
    )]
    OtherBuild {
        /// Build of the plant.
        plant: u64,
    },
    /// It is not a configuration.
    #[error(transparent)]
    Malformed(#[from] postcard::Error),
}

impl Session {
    /// Returns the session of a run of `scenario`.
    ///
    /// # Errors
    /// If the controller's configuration cannot be encoded.
    pub fn new(scenario: &Scenario, pacing: Pacing) -> Result<Self, postcard::Error> {
        Ok(Self {
            tick_hz: scenario.run.tick_hz,
            pacing,
            configuration: postcard::to_stdvec(&(build(), scenario.controller_configuration()))?,
        })
    }

    /// Returns the controller's configuration. It is bytes without names, of which another build
    /// might read a number as its neighbour; so the builds are compared first.
    ///
    /// # Errors
    /// [`UnreadableConfiguration`].
    pub fn controller(&self) -> Result<Configuration, UnreadableConfiguration> {
        let (plant, configuration) = postcard::take_from_bytes(&self.configuration)?;
        if plant != build() {
            return Err(UnreadableConfiguration::OtherBuild { plant });
        }
        Ok(postcard::from_bytes(configuration)?)
    }
}

/// Content of a session message after validation.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Announcement {
    Begin(Session),
    End,
}

/// The session message in shared memory.
///
/// It holds plain numbers, since another process writes them: every bit pattern
/// is a valid value, and [`SessionMessage::read`] checks their meaning.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("painleve::SessionMessage")]
pub(super) struct SessionMessage {
    kind: u32,
    tick_hz: u32,
    pacing: u32,
    length: u32,
    configuration: [u8; CONFIGURATION_CAPACITY],
}

impl SessionMessage {
    const BEGIN: u32 = 1;
    const END: u32 = 2;
    const LOCKSTEP: u32 = 1;
    const REALTIME: u32 = 2;

    pub(super) fn begin(session: &Session) -> Result<Self, ConfigurationTooLong> {
        let length = session.configuration.len();
        let mut configuration = [0; CONFIGURATION_CAPACITY];
        configuration
            .get_mut(..length)
            .ok_or(ConfigurationTooLong { length })?
            .copy_from_slice(&session.configuration);
        Ok(Self {
            kind: Self::BEGIN,
            tick_hz: session.tick_hz,
            pacing: match session.pacing {
                Pacing::Lockstep => Self::LOCKSTEP,
                Pacing::Realtime => Self::REALTIME,
            },
            length: length as u32,
            configuration,
        })
    }

    pub(super) fn end() -> Self {
        Self {
            kind: Self::END,
            tick_hz: 0,
            pacing: 0,
            length: 0,
            configuration: [0; CONFIGURATION_CAPACITY],
        }
    }

    /// Decodes the message; `None` if this version does not understand it.
    pub(super) fn read(&self) -> Option<Announcement> {
        match self.kind {
            Self::BEGIN if self.tick_hz > 0 => Some(Announcement::Begin(Session {
                tick_hz: self.tick_hz,
                pacing: match self.pacing {
                    Self::LOCKSTEP => Pacing::Lockstep,
                    Self::REALTIME => Pacing::Realtime,
                    _ => return None,
                },
                configuration: self.configuration.get(..self.length as usize)?.to_vec(),
            })),
            Self::END => Some(Announcement::End),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(length: usize) -> Session {
        Session {
            tick_hz: 1000,
            pacing: Pacing::Realtime,
            configuration: vec![0xa5; length],
        }
    }

    #[test]
    fn a_message_is_read_back_as_it_was_written() {
        for length in [0, 1, CONFIGURATION_CAPACITY] {
            let message = SessionMessage::begin(&session(length)).unwrap();
            assert_eq!(message.read(), Some(Announcement::Begin(session(length))));
        }
        assert_eq!(SessionMessage::end().read(), Some(Announcement::End));
    }

    /// Compares a table of offsets in docs/interface.md with a type of ours.
    macro_rules! documented {
        ($type:ident: $($field:ident),*) => {{
            let name = stringify!($type);
            let page = include_str!("../../../docs/interface.md");
            let (_, section) = page.split_once(&format!("`{name}`, ")).unwrap();
            let (head, rest) = section.split_once('\n').unwrap();
            let bytes = (size_of::<$type>(), align_of::<$type>());
            assert_eq!(head, format!("{} bytes, alignment {}:", bytes.0, bytes.1), "{name}");
            let rows: Vec<(usize, &str)> = rest
                .lines()
                .skip(3)
                .take_while(|line| line.starts_with('|'))
                .map(|line| {
                    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                    (cells[1].parse().unwrap(), cells[3])
                })
                .collect();
            let fields = [$((std::mem::offset_of!($type, $field), stringify!($field))),*];
            assert_eq!(rows, fields, "{name}");
        }};
    }

    #[test]
    fn the_documented_layouts_are_those_of_the_program() {
        use painleve_shared::frame::{ActuatorFrame, SensorFrame};
        documented!(SensorFrame: tick, sequence, joints, normal_force, tangential_force, inputs);
        documented!(ActuatorFrame: tick, sequence, torques, reference_tip, estimated_tip, state, fault, flags);
        documented!(SessionMessage: kind, tick_hz, pacing, length, configuration);
    }

    #[test]
    fn the_configuration_of_another_build_is_refused() {
        let scenario = Scenario::default();
        let mut session = Session::new(&scenario, Pacing::Lockstep).unwrap();
        assert_eq!(
            session.controller().unwrap(),
            scenario.controller_configuration()
        );
        let other = build().wrapping_add(1);
        session.configuration =
            postcard::to_stdvec(&(other, scenario.controller_configuration())).unwrap();
        let error = session.controller().unwrap_err().to_string();
        assert!(error.contains(&format!("build {other:016x}")), "{error}");
        session.configuration.clear();
        let error = session.controller();
        assert!(matches!(error, Err(UnreadableConfiguration::Malformed(_))));
    }

    #[test]
    fn too_long_a_configuration_is_refused() {
        let length = CONFIGURATION_CAPACITY + 1;
        assert!(matches!(
            SessionMessage::begin(&session(length)),
            Err(ConfigurationTooLong { length: l }) if l == length
        ));
    }

    #[test]
    fn an_invalid_message_is_rejected() {
        let good = SessionMessage::begin(&session(3)).unwrap();
        for bad in [
            SessionMessage { kind: 9, ..good },
            SessionMessage { pacing: 0, ..good },
            SessionMessage { tick_hz: 0, ..good },
            SessionMessage {
                length: CONFIGURATION_CAPACITY as u32 + 1,
                ..good
            },
        ] {
            assert_eq!(bad.read(), None);
        }
    }
}
