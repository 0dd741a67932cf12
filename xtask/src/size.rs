//! x
use crate::command::ChoreError;
/// x
pub fn run() -> Result<(), ChoreError> {
    Ok(())
}
