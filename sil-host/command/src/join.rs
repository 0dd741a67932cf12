//! How a controller joins the bus of its plant.

use std::time::Duration;

use clap::Args;
use painleve_link::{BusName, ControllerEnd, LinkError, Session};
use painleve_plant::Configuration;
use painleve_plant::law_choice::build;
use painleve_system::interrupt::Interrupt;

use super::CommandError;
use super::patience::{PatienceArguments, WAIT_S};
use super::process_error::ProcessError;

/// The plant to join.
#[derive(Debug, Args)]
pub struct JoinArguments {
    /// Bus of the plant.
    #[arg(long)]
    pub bus: BusName,
    /// Longest wait for the plant, s.
    #[arg(long, value_name = "SECONDS", default_value_t = WAIT_S, value_parser = super::seconds)]
    wait_s: f64,
    #[command(flatten)]
    pub patience: PatienceArguments,
}

impl JoinArguments {
    /// Waits for the plant and joins its session; returns the plant's configuration, too.
    ///
    /// # Errors
    /// [`CommandError`] if no plant is there in time, or it is of another build.
    pub fn join(
        &self,
        interrupt: &Interrupt,
    ) -> Result<(ControllerEnd, Session, Configuration), CommandError> {
        let wait = Duration::from_secs_f64(self.wait_s);
        let (mut end, session) = ControllerEnd::open(&self.bus, wait, interrupt)?;
        end.set_silence_limit(self.patience.peer());
        let unreadable = |source| ProcessError::Unreadable {
            bus: self.bus.clone(),
            source,
        };
        let (plant_build, bytes) =
            postcard::take_from_bytes::<u64>(&session.configuration).map_err(unreadable)?;
        if plant_build != build() {
            let bus = self.bus.clone();
            return Err(LinkError::Incompatible { bus }.into());
        }
        let configuration = postcard::from_bytes(bytes).map_err(unreadable)?;
        Ok((end, session, configuration))
    }
}
