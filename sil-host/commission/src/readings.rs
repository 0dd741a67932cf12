//! A session with a rig: mean readings, in the units and directions found so far.

use nalgebra::Vector2;
use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_plant::converters::encoder::links_rad;
use painleve_shared::counts::{EncoderCounts, EncoderScale, ForceCounts, TorqueCounts};
use painleve_shared::{JointTorque, LinkMotion};

use crate::{CommissionError, Expected, Mistake, RawReadings, Rig};

/// Duration of a measurement, s.
const MEAN_S: f64 = 0.1;

/// Smallest share of ticks with a reading.
const LEAST_SHARE: f64 = 0.5;

/// Mean readings over a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeanReadings {
    /// Raw encoder readings, whole counts.
    pub joints: [EncoderCounts; 2],
    /// Raw f_t and f_n, counts.
    pub forces: [f64; 2],
}

/// A rig and its properties measured until now.
pub(crate) struct Session<'a, R> {
    rig: &'a mut R,
    pub expected: &'a Expected,
    reversed: [bool; 2],
    offsets: [u32; 2],
    correction: EncoderCorrection,
    stage_reversed: [bool; 2],
}

impl<'a, R: Rig> Session<'a, R> {
    pub fn new(rig: &'a mut R, expected: &'a Expected) -> Self {
        Self {
            rig,
            expected,
            reversed: [false; 2],
            offsets: [0; 2],
            correction: EncoderCorrection::default(),
            stage_reversed: [false; 2],
        }
    }

    /// Uses these directions, zeros and correction from now on.
    pub fn set_encoders(
        &mut self,
        reversed: [bool; 2],
        offsets: [u32; 2],
        correction: EncoderCorrection,
    ) {
        self.reversed = reversed;
        self.offsets = offsets;
        self.correction = correction;
    }

    /// Uses these polarities from now on.
    pub fn set_stages(&mut self, reversed: [bool; 2]) {
        self.stage_reversed = reversed;
    }

    /// Gives the operator a task.
    ///
    /// # Errors
    /// [`CommissionError::Rig`] if the rig fails.
    pub fn instruct(
        &mut self,
        instruction: crate::OperatorTask,
    ) -> Result<(), CommissionError<R::Error>> {
        self.rig.instruct(instruction).map_err(CommissionError::Rig)
    }

    /// Returns the number of ticks in a time, at least one.
    pub fn ticks(&self, time_s: f64) -> u32 {
        (time_s * self.expected.tick_hz).max(1.0) as u32
    }

    /// Commands joint torques, N·m, limited, and returns the readings.
    ///
    /// # Errors
    /// [`CommissionError::Rig`] if the rig fails.
    pub fn exchange(
        &mut self,
        torque_nm: JointTorque<f64>,
    ) -> Result<RawReadings, CommissionError<R::Error>> {
        let scale = &self.expected.converters.torque;
        let limit = self.expected.torque_limit_nm;
        let torques_nm = torque_nm.to_array();
        let mut counts = [TorqueCounts(0); 2];
        for (joint, count) in counts.iter_mut().enumerate() {
            let torque_nm = torques_nm[joint].clamp(-limit, limit);
            let signed = if self.stage_reversed[joint] {
                -torque_nm
            } else {
                torque_nm
            };
            *count = TorqueCounts(scale.counts(signed as f32).0);
        }
        self.rig.exchange(counts).map_err(CommissionError::Rig)
    }

    /// Returns the mean readings under a torque, after the arm has settled.
    ///
    /// # Errors
    /// [`CommissionError::Rig`] if the rig fails, and [`CommissionError::Refused`] if a sensor is silent.
    pub fn mean(
        &mut self,
        torque_nm: JointTorque<f64>,
    ) -> Result<MeanReadings, CommissionError<R::Error>> {
        let ticks = self.ticks(MEAN_S);
        for _ in 0..ticks {
            self.exchange(torque_nm)?;
        }
        let scales = self.expected.converters.encoders;
        let force_scale = self.expected.converters.force;
        let mut first = [None; 2];
        let mut turned = [0_i64; 2];
        let mut readings = [0_u32; 2];
        let mut forces = [0_i64; 2];
        let mut loaded = 0_u32;
        for _ in 0..ticks {
            let raw = self.exchange(torque_nm)?;
            for joint in 0..2 {
                if scales[joint].contains(raw.joints[joint]) {
                    let start = *first[joint].get_or_insert(raw.joints[joint]);
                    turned[joint] += i64::from(scales[joint].difference(start, raw.joints[joint]));
                    readings[joint] += 1;
                }
            }
            if raw.forces.iter().all(|it| force_scale.contains(it.0)) {
                loaded += 1;
                for (sum, reading) in forces.iter_mut().zip(raw.forces) {
                    *sum += i64::from(reading.0);
                }
            }
        }
        let least = (LEAST_SHARE * f64::from(ticks)) as u32;
        let mut joints = [EncoderCounts(0); 2];
        for joint in 0..2 {
            let (Some(start), true) = (first[joint], readings[joint] > least) else {
                return Err(Mistake::EncoderSilent { joint }.into());
            };
            let mean = (turned[joint] as f64 / f64::from(readings[joint])).round() as i64;
            let modulus = i64::from(scales[joint].modulus());
            joints[joint] = EncoderCounts((i64::from(start.0) + mean).rem_euclid(modulus) as u32);
        }
        if loaded <= least {
            return Err(Mistake::ForceSilent.into());
        }
        Ok(MeanReadings {
            joints,
            forces: forces.map(|sum| sum as f64 / f64::from(loaded)),
        })
    }

    /// Returns the link angles of raw readings, rad; `None` without a reading.
    pub fn theta_rad(&self, joints: [EncoderCounts; 2]) -> Option<LinkMotion<f64>> {
        let mut angles = [0.0; 2];
        for joint in 0..2 {
            let scale = EncoderScale {
                offset: EncoderCounts(self.offsets[joint]),
                ..self.expected.converters.encoders[joint]
            };
            if !scale.contains(joints[joint]) {
                return None;
            }
            let forward = forward(&scale, joints[joint], self.reversed[joint]);
            angles[joint] =
                f64::from(scale.counts_from_zero(forward)) * scale.rad_per_count::<f64>();
        }
        Some(links_rad(&self.correction, angles))
    }

    /// Returns raw forces minus the tare, N, as (f_t, f_n) in the cell's directions.
    pub fn net_force_n(&self, forces: [f64; 2], tare: [ForceCounts; 2]) -> Vector2<f64> {
        let per_count = f64::from(self.expected.converters.force.per_count());
        Vector2::new(
            (forces[0] - f64::from(tare[0].0)) * per_count,
            (forces[1] - f64::from(tare[1].0)) * per_count,
        )
    }
}

/// Returns a raw reading as it would be without a reversal, as the board corrects it.
pub(crate) fn forward(scale: &EncoderScale, raw: EncoderCounts, reversed: bool) -> EncoderCounts {
    if reversed {
        EncoderCounts(raw.0.wrapping_neg() & (scale.modulus() - 1))
    } else {
        raw
    }
}
