//! The frequency response of an opened loop: linearised by finite differences, and measured with sines.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;

use super::at_rest::AtRest;
use super::margins::{angle, decibels, size, turned};
use super::{NotHeld, Point};
use painleve_study_core::StudyError;

/// Duration of the recorded response to a disturbance of one tick, s: the slowest mode of the paper's PID has a time
/// constant of 8 s. Near the crossover, a shorter one is enough.
pub(super) const WHOLE_S: f64 = 40.0;
pub(super) const FAST_S: f64 = 8.0;
/// Starts of that disturbance on successive ticks, which the response is averaged over: several for each turn of the
/// controller's slow work.
const STARTS: usize = 8;
/// Size of the disturbance of one tick, in that of a sine: it lasts a thousandth of a second. With a quarter of it, counts blur
/// the response: near the arm's resonance, where the paper's PID has a gain of 60 dB, it is 14 % off, with this 2 %. Near the
/// edge it may lift the tip off, and on a slow belt reverse its slip, which are no part of the loop: then it is halved, down to
/// the size of a sine.
const TICK_SIZE: f64 = 32.0;
const LEAST_TICK_SIZE: f64 = 1.0;
/// What the response of a stable loop still contains after some ticks is slow: from this tick on it is averaged over this
/// part of the time since the disturbance, which removes the counts of the encoders.
const SMOOTH_FROM: usize = 128;
const SMOOTH_OVER: usize = 16;
/// Periods of a frequency after which the response contains nothing of it but noise.
const PERIODS: f64 = 200.0;
/// Time in which a sine settles at least, s, and its periods; time in which it is measured, s. Estimates that adapt follow a sine
/// that lasts.
const SINE_SETTLES_S: f64 = 4.0;
const SINE_SETTLES: f64 = 40.0;
const SINE_S: f64 = 4.0;
/// Lowest frequency, Hz, and highest, in control rates.
const LOWEST_HZ: f64 = 1.0;
const HIGHEST: f64 = 0.2;
/// A controller that answers with less than this of a disturbance does not close the loop.
const IDLE: f64 = 1e-6;

/// Returns frequencies with equal ratios, each with a whole number of periods in a measurement.
pub(super) fn frequencies_hz(count: usize, tick_hz: f64) -> Vec<f64> {
    let ratio = HIGHEST * tick_hz / LOWEST_HZ;
    let steps = count.saturating_sub(1).max(1) as f64;
    let exact = (0..count).map(|number| LOWEST_HZ * libm::pow(ratio, number as f64 / steps));
    exact.map(|hz| (hz * SINE_S).round() / SINE_S).collect()
}

/// The linearised loop of one command.
pub(super) struct Linearised {
    /// The command after a disturbance of one at the first tick.
    response: Vec<f64>,
    tick_hz: f64,
}

impl Linearised {
    /// Returns whether the controller does not use the command.
    pub(super) fn is_idle(&self) -> bool {
        self.response.iter().skip(1).all(|value| value.abs() < IDLE)
    }

    /// Returns the open loop L at a frequency, Hz.
    pub(super) fn open_loop(&self, hz: f64) -> Complex<f64> {
        let turn = turned(-TAU * hz / self.tick_hz);
        let all = self.response.len();
        let ticks = ((PERIODS * self.tick_hz / hz) as usize).clamp(1, all);
        // From the middle on, what is cut off fades.
        let weight = |tick: usize| {
            let beyond = 2.0 * tick as f64 / ticks as f64 - 1.0;
            if ticks == all || beyond <= 0.0 {
                1.0
            } else {
                0.5 + 0.5 * libm::cos(PI * beyond)
            }
        };
        // Horner's rule, from the last tick on.
        let closed = (0..ticks).rev().fold(Complex::new(0.0, 0.0), |sum, tick| {
            sum * turn + weight(tick) * self.response[tick]
        });
        closed.inv() - 1.0
    }
}

impl AtRest {
    /// Linearises the loop of a command from its response of this duration, s; [`NotHeld`] if even a small disturbance lifts the
    /// tip off or ends its slip.
    ///
    /// # Errors
    /// [`StudyError`] if the plant cannot continue.
    pub(super) fn linearised(
        &self,
        number: usize,
        duration_s: f64,
    ) -> Result<Result<Linearised, NotHeld>, StudyError> {
        let ticks = (duration_s * self.tick_hz()) as usize;
        let mut size = TICK_SIZE;
        loop {
            let height = size * self.command(number).size;
            match self.response(number, ticks, height)? {
                Ok(response) => {
                    return Ok(Ok(Linearised {
                        response: smoothed(&response),
                        tick_hz: self.tick_hz(),
                    }));
                }
                Err(reason) if size <= LEAST_TICK_SIZE => return Ok(Err(reason)),
                Err(_) => size *= 0.5,
            }
        }
    }

    /// Returns the command after disturbances of this height, for one of one; [`NotHeld`] if the tip leaves the belt or its slip
    /// ends.
    fn response(
        &self,
        number: usize,
        ticks: usize,
        height: f64,
    ) -> Result<Result<Vec<f64>, NotHeld>, StudyError> {
        let mut response = vec![0.0; ticks];
        for start in 0..STARTS {
            let of = |sign: f64| {
                let recorded = self.run(number, start, ticks, |tick| {
                    if tick == 0 { sign * height } else { 0.0 }
                });
                recorded.map_err(|source| self.failed(number, source))
            };
            let (plus, minus) = (of(1.0)?, of(-1.0)?);
            if let Some(reason) = plus.iter().chain(&minus).find_map(|it| it.slides.err()) {
                return Ok(Err(reason));
            }
            for (sum, (plus, minus)) in response.iter_mut().zip(plus.iter().zip(&minus)) {
                let difference = plus.commands[number] - minus.commands[number];
                *sum += difference / (2.0 * height * STARTS as f64);
            }
        }
        Ok(Ok(response))
    }

    /// Measures the open loop of a command at frequencies (Hz) with sines.
    ///
    /// # Errors
    /// [`StudyError`] if the plant cannot continue.
    pub(super) fn measured(
        &self,
        number: usize,
        frequencies_hz: &[f64],
    ) -> Result<Vec<Complex<f64>>, StudyError> {
        let tick_hz = self.tick_hz();
        let ticks = |time_s: f64| (time_s * tick_hz).round() as usize;
        let settle = |hz: f64| ticks((SINE_SETTLES / hz).clamp(SINE_SETTLES_S, WHOLE_S));
        let measured = ticks(SINE_S);
        let height = self.command(number).size;
        let run = |settles: usize, disturbance: &dyn Fn(usize) -> f64| {
            let recorded = self.run(number, 0, settles + measured, disturbance);
            recorded.map_err(|source| self.failed(number, source))
        };
        // The drift of a tip that has not quite come to rest.
        let longest = frequencies_hz.iter().map(|hz| settle(*hz)).max();
        let rest = run(longest.unwrap_or_default(), &|_| 0.0)?;
        let at = |hz: &f64| {
            let phase = |tick: usize| TAU * hz * tick as f64 / tick_hz;
            let sine = |tick: usize| height * libm::sin(phase(tick));
            let settles = settle(*hz);
            let recorded = run(settles, &sine)?;
            let share = |value: &dyn Fn(usize) -> f64| {
                let ticks = settles..settles + measured;
                let sum: Complex<f64> = ticks.map(|tick| turned(-phase(tick)) * value(tick)).sum();
                sum * 2.0 / measured as f64
            };
            let command =
                |tick: usize| recorded[tick].commands[number] - rest[tick].commands[number];
            Ok(share(&sine) / share(&command) - 1.0)
        };
        frequencies_hz.iter().map(at).collect()
    }

    fn failed(&self, number: usize, source: painleve_plant::PlantError) -> StudyError {
        StudyError::Plant {
            row: format!("{} loop", self.name(number)),
            source,
        }
    }
}

fn smoothed(response: &[f64]) -> Vec<f64> {
    let smooth = |tick: usize| {
        let half = if tick < SMOOTH_FROM {
            0
        } else {
            tick / SMOOTH_OVER / 2
        };
        let around = &response[tick - half..(tick + half + 1).min(response.len())];
        around.iter().sum::<f64>() / around.len() as f64
    };
    (0..response.len()).map(smooth).collect()
}

/// Returns the points of a loop at frequencies, Hz, from its linearised and its measured response there.
pub(super) fn points(
    frequencies_hz: &[f64],
    linear: impl Fn(f64) -> Complex<f64>,
    measured: &[Complex<f64>],
) -> Vec<Point> {
    // The first one between −270° and 90°.
    let mut before_deg = -90.0;
    let points = frequencies_hz.iter().zip(measured);
    let points = points.map(|(&frequency_hz, measured)| {
        let linear = linear(frequency_hz);
        // On the turn of its neighbour, and the measured one on that of the linearised.
        let phase_deg = near_deg(angle(linear).to_degrees(), before_deg);
        before_deg = phase_deg;
        Point {
            frequency_hz,
            gain_db: decibels(size(linear)),
            phase_deg,
            measured_gain_db: decibels(size(*measured)),
            measured_phase_deg: phase_deg + angle(measured / linear).to_degrees(),
        }
    });
    points.collect()
}

/// Returns an angle on the turn that is nearest to another angle, degrees.
fn near_deg(angle_deg: f64, other_deg: f64) -> f64 {
    angle_deg + 360.0 * ((other_deg - angle_deg) / 360.0).round()
}
