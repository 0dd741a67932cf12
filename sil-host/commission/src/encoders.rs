//! Step 1: directions and zeros of the encoders, and the force cell's tare, from three poses in which the
//! operator holds the arm clear of the belt, with plumb line and spirit level.
//!
//! From the first pose to the second, joint 1 turns by +90° and the elbow by −90°; from the second to the
//! third, only the elbow, by −90°. This identifies the encoders and their directions.

use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_shared::counts::{EncoderCounts, EncoderScale, ForceCounts};
use painleve_shared::{JointMotion, JointTorque, Pose};

use crate::identification::terms;
use crate::readings::{MeanReadings, Session, forward};
use crate::{CommissionError, Deviation, Mistake, OperatorTask, Rig};

/// Angles of both links from the plumb line, degrees.
const POSES_DEG: [[f64; 2]; 3] = [[0.0, 90.0], [90.0, 90.0], [90.0, 0.0]];

/// Largest error of a turn of 90°: the operator's hands and the encoder's eccentricity, degrees.
const TURN_TOLERANCE_DEG: f64 = 8.0;

/// Largest error of a zero that counts as the scenario's own, degrees.
const ZERO_TOLERANCE_DEG: f64 = 3.0;

/// A turn below this is none, degrees.
const STILL_DEG: f64 = 10.0;

/// Largest tare, as a part of the force cell's range.
const LARGEST_TARE: f64 = 0.25;

/// Largest error of the tare that counts as the scenario's own, as a part of the force cell's range.
const TARE_TOLERANCE: f64 = 0.025;

/// Directions, zeros and tare as measured.
#[derive(Clone, Debug)]
pub struct EncodersFound {
    /// Whether the encoders count backwards.
    pub reversed: [bool; 2],
    /// Readings at angle zero, in the joints' directions, without a correction, counts.
    pub offsets: [u32; 2],
    /// Correction of the encoders whose directions and zeros are those of the scenario.
    pub correction: EncoderCorrection,
    /// Readings of f_t and f_n without a load.
    pub tare: [ForceCounts; 2],
    /// Deviations from the scenario.
    pub deviations: Vec<Deviation>,
}

impl EncodersFound {
    /// Returns whether directions and zeros of the encoders are those of the scenario.
    pub(crate) fn are_as_described(&self) -> bool {
        let is_of_encoder = |it: &Deviation| {
            matches!(
                it,
                Deviation::EncoderDirection { .. } | Deviation::EncoderZero { .. }
            )
        };
        !self.deviations.iter().any(is_of_encoder)
    }
}

/// Measures directions, zeros and tare.
pub(crate) fn measure<R: Rig>(
    session: &mut Session<'_, R>,
) -> Result<EncodersFound, CommissionError<R::Error>> {
    let mut held = Vec::new();
    for plumb_deg in POSES_DEG {
        session.instruct(OperatorTask::Hold { plumb_deg })?;
        held.push(session.mean(JointTorque::zeros())?);
    }
    let scales = session.expected.converters.encoders;
    let reversed = directions(&scales, &held)?;
    let mut deviations = Vec::new();
    let mut offsets = [0; 2];
    let mut correction = session.expected.correction;
    let tilt_rad = session.expected.belt_tilt_rad;
    for joint in 0..2 {
        let scale = &scales[joint];
        let zero = |correction: &EncoderCorrection| {
            zero(scale, joint, reversed[joint], tilt_rad, correction, &held)
        };
        let measured = zero(&correction)?;
        let error_deg = degrees(scale, scale.difference(scale.offset, measured));
        if reversed[joint] != session.expected.converters.mounting.encoder_reversed[joint] {
            deviations.push(Deviation::EncoderDirection { joint });
        } else if error_deg.abs() > ZERO_TOLERANCE_DEG {
            deviations.push(Deviation::EncoderZero { joint, error_deg });
        } else {
            offsets[joint] = scale.offset.0;
            continue;
        }
        // The correction was that of the encoder as it was.
        for values_rad in terms(&mut correction).map(|(_, values_rad)| values_rad) {
            values_rad[joint] = 0.0;
        }
        offsets[joint] = zero(&correction)?.0;
    }
    let tare = tare(session, &held, &mut deviations)?;
    Ok(EncodersFound {
        reversed,
        offsets,
        correction,
        tare,
        deviations,
    })
}

/// Returns an angle of counts in degrees.
fn degrees(scale: &EncoderScale, counts: i32) -> f64 {
    (f64::from(counts) * scale.rad_per_count::<f64>()).to_degrees()
}

/// Returns whether each encoder counts backwards.
fn directions(scales: &[EncoderScale; 2], held: &[MeanReadings]) -> Result<[bool; 2], Mistake> {
    let turn = |joint: usize, from: usize, to: usize| {
        let (from, to) = (held[from].joints[joint], held[to].joints[joint]);
        degrees(&scales[joint], scales[joint].difference(from, to))
    };
    let turns = [0, 1].map(|joint| [turn(joint, 0, 1), turn(joint, 1, 2)]);
    let is_still = |turn: f64| turn.abs() < STILL_DEG;
    for (joint, turns) in turns.iter().enumerate() {
        if turns.iter().all(|it| is_still(*it)) {
            return Err(Mistake::EncoderDead { joint });
        }
    }
    let [[first_turn, first_rest], [elbow_turn, elbow_only]] = turns;
    if !is_still(first_rest) && is_still(elbow_only) {
        return Err(Mistake::EncodersSwapped);
    }
    for (joint, turned_deg) in [(0, first_turn), (1, elbow_turn), (1, elbow_only)] {
        if (turned_deg.abs() - 90.0).abs() > TURN_TOLERANCE_DEG {
            return Err(Mistake::EncoderScale {
                joint,
                turned_deg: turned_deg.abs(),
            });
        }
    }
    // The elbow turns on in its direction.
    if elbow_turn * elbow_only < 0.0 {
        return Err(Mistake::HeldOtherwise { joint: 1 });
    }
    Ok([first_turn < 0.0, elbow_only > 0.0])
}

/// Returns the reading of an encoder's own zero, to which the correction is added, in the joint's direction: the mean over
/// the poses, which must agree.
fn zero(
    scale: &EncoderScale,
    joint: usize,
    reversed: bool,
    belt_tilt_rad: f64,
    correction: &EncoderCorrection,
    held: &[MeanReadings],
) -> Result<EncoderCounts, Mistake> {
    let zeros = held.iter().zip(POSES_DEG).map(|(held, [one, two])| {
        // The belt's inward normal is not plumb if the belt is tilted; the elbow's angle does not change.
        let joints_rad = [one.to_radians() - belt_tilt_rad, (two - one).to_radians()];
        let [one_rad, elbow_rad] = joints_rad.map(|it| it as f32);
        let pose = Pose::new(&JointMotion::new(one_rad, elbow_rad).to_links());
        let added_rad = correction.in_pose(&pose).to_array()[joint];
        let encoder_rad = joints_rad[joint] - f64::from(added_rad);
        let angle = (encoder_rad / scale.rad_per_count::<f64>()).round() as i32;
        let reading = forward(scale, held.joints[joint], reversed);
        EncoderCounts(reading.0.wrapping_add_signed(-angle) & (scale.modulus() - 1))
    });
    let zeros: Vec<EncoderCounts> = zeros.collect();
    let [first, ..] = zeros[..] else {
        return Ok(scale.offset);
    };
    let sum: i32 = zeros.iter().map(|it| scale.difference(first, *it)).sum();
    let mean = sum / zeros.len() as i32;
    let mean = EncoderCounts(first.0.wrapping_add_signed(mean) & (scale.modulus() - 1));
    let off_deg = |zero: &EncoderCounts| degrees(scale, scale.difference(mean, *zero)).abs();
    if zeros.iter().any(|zero| off_deg(zero) > TURN_TOLERANCE_DEG) {
        return Err(Mistake::HeldOtherwise { joint });
    }
    Ok(mean)
}

/// Returns the mean reading of the force cell without a load.
fn tare<R: Rig>(
    session: &Session<'_, R>,
    held: &[MeanReadings],
    deviations: &mut Vec<Deviation>,
) -> Result<[ForceCounts; 2], Mistake> {
    let converters = &session.expected.converters;
    let per_count = f64::from(converters.force.per_count());
    let range_n = f64::from(converters.force.range);
    let mut tare = [ForceCounts(0); 2];
    for (axis, place) in tare.iter_mut().enumerate() {
        let mean = held.iter().map(|it| it.forces[axis]).sum::<f64>() / held.len() as f64;
        let offset_n = mean * per_count;
        if offset_n.abs() > LARGEST_TARE * range_n {
            return Err(Mistake::ForceOffset { axis, offset_n });
        }
        *place = ForceCounts(mean.round() as i32);
        let error_n = (mean - f64::from(converters.mounting.force_tare[axis].0)) * per_count;
        if error_n.abs() > TARE_TOLERANCE * range_n {
            deviations.push(Deviation::ForceTare { axis, error_n });
        }
    }
    Ok(tare)
}
