//! Periodic or chaotic, from the returns of an orbit to a section.
//!
//! **The criterion.** The largest Lyapunov exponent across the flow is the growth of a
//! deviation per unit of time, with a standard error from the means of 19 batches
//! of returns. If it is above zero by more than three standard errors, and the deviation has
//! grown by more than a factor e, the orbit is chaotic; if it is below zero by as much,
//! periodic; otherwise undecided. The period is the smallest number of returns, up to 64,
//! after which the state recurs to within 10⁻⁵ (rad, rad/s) everywhere in the second half of
//! the record; a periodic orbit without one has a longer period, or has not come close enough to it.

use nalgebra::SVector;
use serde::Serialize;

/// Number of batches into which consecutive returns are grouped.
const BATCHES: usize = 20;

/// Number of standard errors by which an exponent must differ from zero.
const CLEARLY: f64 = 3.0;

/// Smallest significant growth or decay over the whole record, as a logarithm.
const LEAST_LOG_GROWTH: f64 = 1.0;

/// Longest period searched for, returns.
pub const LONGEST_PERIOD: usize = 64;

/// Tolerance in every component within which two states are equal.
const RECURRENCE: f64 = 1e-5;

/// One return of an orbit to its section.
#[derive(Clone, Copy, Debug)]
pub struct Return<const N: usize> {
    /// Time, s (or the number of a map's iteration).
    pub time_s: f64,
    /// State.
    pub state: SVector<f64, N>,
    /// Logarithm of the growth of the deviation since the last return.
    pub log_growth: f64,
}

/// The long-term regime of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regime {
    /// The orbit does not return: the arm slides quietly.
    Quiet,
    /// Deviations decay: the orbit closes.
    Periodic,
    /// Deviations grow.
    Chaotic,
    /// The record does not decide between the two.
    Undecided,
}

/// The regime of an orbit and its evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegimeVerdict {
    /// The regime.
    pub regime: Regime,
    /// Returns per period of a periodic orbit, up to [`LONGEST_PERIOD`].
    pub period: Option<usize>,
    /// Largest Lyapunov exponent across the flow, 1/s; minus infinity where
    /// deviations vanish. `None` without enough returns.
    pub exponent_per_s: Option<f64>,
    /// Standard error of the exponent, 1/s; `None` if the exponent is minus infinity.
    pub standard_error_per_s: Option<f64>,
}

impl RegimeVerdict {
    /// Classifies an orbit by its returns after the transient.
    pub fn of<const N: usize>(returns: &[Return<N>]) -> Self {
        let mut verdict = Self {
            regime: if returns.is_empty() {
                Regime::Quiet
            } else {
                Regime::Undecided
            },
            period: None,
            exponent_per_s: None,
            standard_error_per_s: None,
        };
        let period = period(returns);
        let Some(exponent) = Exponent::of(returns, period) else {
            return verdict;
        };
        verdict.exponent_per_s = Some(exponent.mean_per_s);
        if exponent.mean_per_s == f64::NEG_INFINITY {
            verdict.regime = Regime::Periodic;
            verdict.period = period;
            return verdict;
        }
        verdict.standard_error_per_s = Some(exponent.standard_error_per_s);
        let margin =
            (CLEARLY * exponent.standard_error_per_s).max(LEAST_LOG_GROWTH / exponent.time_s);
        if exponent.mean_per_s > margin {
            verdict.regime = Regime::Chaotic;
        } else if exponent.mean_per_s < -margin {
            verdict.regime = Regime::Periodic;
            verdict.period = period;
        }
        verdict
    }
}

/// Mean growth over an interval of time.
struct Exponent {
    mean_per_s: f64,
    standard_error_per_s: f64,
    time_s: f64,
}

impl Exponent {
    /// Returns `None` without two returns for every batch. Leaves out the first batch, in which the
    /// deviation turns into the direction of fastest growth. Batches hold whole periods
    /// where possible.
    fn of<const N: usize>(returns: &[Return<N>], period: Option<usize>) -> Option<Self> {
        let mut size = returns.len().checked_sub(1)? / BATCHES;
        if size < 2 {
            return None;
        }
        if let Some(period) = period.filter(|period| *period <= size) {
            size -= size % period;
        }
        let batches = BATCHES - 1;
        let last = &returns[returns.len() - 1 - size * batches..];
        let growth_and_time = |from: usize, to: usize| {
            let growth: f64 = last[from + 1..=to].iter().map(|one| one.log_growth).sum();
            (growth, last[to].time_s - last[from].time_s)
        };
        let (growth, time_s) = growth_and_time(0, last.len() - 1);
        let mean_per_s = growth / time_s;
        if mean_per_s.is_nan() {
            return None;
        }
        let square: f64 = (0..batches)
            .map(|batch| {
                let (growth, time_s) = growth_and_time(batch * size, (batch + 1) * size);
                (growth / time_s - mean_per_s).powi(2)
            })
            .sum();
        Some(Self {
            mean_per_s,
            standard_error_per_s: (square / (batches * (batches - 1)) as f64).sqrt(),
            time_s,
        })
    }
}

/// Returns the number of returns per period; `None` if the states do not recur.
fn period<const N: usize>(returns: &[Return<N>]) -> Option<usize> {
    let last = &returns[returns.len() / 2..];
    (1..=LONGEST_PERIOD.min(last.len() / 2)).find(|&period| {
        last.iter()
            .zip(&last[period..])
            .all(|(one, next)| (one.state - next.state).amax() < RECURRENCE)
    })
}
