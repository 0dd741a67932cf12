//! The configuration that a board keeps in its flash.

use std::time::Duration;

use painleve_plant::Configuration;
use painleve_plant::law_choice::build;
use painleve_shared::message::{Request, Response};
use painleve_shared::stored::{StoredConfiguration, StoredState};

use crate::serial::PATIENCE;
use crate::{BoardError, Port, Serial};

/// Longest wait for the erasure of two sectors.
const ERASURE: Duration = Duration::from_secs(10);

impl<P: Port> Serial<P> {
    /// Stores a configuration, with which the board starts from then on. Takes the torque off.
    ///
    /// # Errors
    /// [`BoardError::Refused`], [`BoardError::RateRefused`], [`BoardError::NotStored`] or [`BoardError::Silent`].
    pub fn store(
        &mut self,
        configuration: &Configuration,
    ) -> Result<StoredConfiguration, BoardError> {
        let configuration = super::encode(configuration)?;
        self.change(&Request::Store {
            build: build(),
            configuration: &configuration,
        })
    }

    /// Sends a configuration to store, and does not wait until it is.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn begin_to_store(&mut self, configuration: &Configuration) -> Result<(), BoardError> {
        let configuration = super::encode(configuration)?;
        self.send(&Request::Store {
            build: build(),
            configuration: &configuration,
        })
    }

    /// Erases the stored configuration. Takes the torque off.
    ///
    /// # Errors
    /// [`BoardError::NotStored`] or [`BoardError::Silent`].
    pub fn forget(&mut self) -> Result<StoredConfiguration, BoardError> {
        self.change(&Request::Forget)
    }

    /// Returns what the board has stored.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if the board does not answer.
    pub fn stored(&mut self) -> Result<StoredConfiguration, BoardError> {
        self.ask_for_stored(&Request::Stored, PATIENCE)
    }

    fn change(&mut self, request: &Request<'_>) -> Result<StoredConfiguration, BoardError> {
        // Not repeated meanwhile: every repetition would store it again.
        let stored = self.ask_for_stored(request, ERASURE)?;
        match stored.state {
            StoredState::Empty | StoredState::Intact => Ok(stored),
            state => Err(BoardError::NotStored(state)),
        }
    }

    fn ask_for_stored(
        &mut self,
        request: &Request<'_>,
        patience: Duration,
    ) -> Result<StoredConfiguration, BoardError> {
        let is_wanted = |response: &Response| {
            matches!(
                response,
                Response::Stored(_)
                    | Response::Refused
                    | Response::RateRefused(_)
                    | Response::OtherBuild { .. }
            )
        };
        match self.ask_within(request, patience, ERASURE, is_wanted)? {
            Response::Stored(stored) => Ok(stored),
            Response::OtherBuild { build } => Err(BoardError::other_build(build)),
            Response::RateRefused(rate) => Err(BoardError::RateRefused(rate)),
            _ => Err(BoardError::Refused),
        }
    }
}
