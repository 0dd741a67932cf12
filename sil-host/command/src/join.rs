//! How a controller joins the bus of its plant.

use std::time::Duration;

use clap::Args;
use painleve_link::{BusName, ControllerEnd, Pair, Session};
use painleve_plant::Configuration;
use painleve_process::interrupt::Interrupt;
use serde::{Deserialize, Serialize};

use super::CommandError;
use super::patience::{PatienceArguments, WAIT_S};
use super::process_error::ProcessError;

/// The plant to join.
#[derive(Debug, Args, Serialize, Deserialize)]
pub struct JoinArguments {
    /// Bus of the plant.
    #[arg(long)]
    pub bus: BusName,
    /// Longest wait for the plant, s.
    #[arg(long, value_name = "SECONDS", default_value_t = WAIT_S, value_parser = super::seconds)]
    pub wait_s: f64,
    #[command(flatten)]
    pub patience: PatienceArguments,
    /// Join only the plant with the same mark: set by `painleve run`.
    #[arg(skip)]
    pub pair: Option<Pair>,
    /// Print errors and warnings only: set by `painleve run`.
    #[arg(skip)]
    pub quiet: bool,
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
        let limit = self.patience.peer();
        let (end, session) = ControllerEnd::open(&self.bus, self.pair, wait, limit, interrupt)?;
        let configuration = session
            .controller()
            .map_err(|source| ProcessError::Unreadable {
                bus: self.bus.clone(),
                source,
            })?;
        Ok((end, session, configuration))
    }
}
