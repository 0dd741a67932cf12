//! A bound on the number of integration steps: a plant that is too stiff ends with an error instead of
//! a run that takes hours.

use super::motion_error::MotionError;

/// Steps for each second of simulated time. Ordinary arms take a few thousand.
const STEPS_PER_S: f64 = 5e5;
/// Steps beyond these, for example for series of impacts.
const RESERVE: f64 = 1e6;

/// Number of steps taken since time zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct StepBudget(u64);

impl StepBudget {
    /// Counts a step that starts at `time_s`.
    ///
    /// # Errors
    /// [`MotionError::TooStiff`] if there have been too many.
    #[inline]
    pub fn spend(&mut self, time_s: f64) -> Result<(), MotionError> {
        self.0 += 1;
        if self.0 as f64 > RESERVE + STEPS_PER_S * time_s {
            return Err(MotionError::TooStiff { time_s });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_steps_are_too_many_only_if_time_stands_still() {
        let mut budget = StepBudget::default();
        assert!((0..5_000_000).all(|step| budget.spend(1e-5 * f64::from(step)).is_ok()));
        let mut budget = StepBudget::default();
        let endless = (0..).find(|_| budget.spend(0.5).is_err());
        assert_eq!(endless, Some(1_250_000));
    }
}
