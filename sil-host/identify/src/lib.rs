//! Identifies an arm's geometry and joints from slides of its tip along the belt.
//!
//! The tip stays on a straight line, whatever the joints do: l1 cos θ1 + l2 cos θ2 = H. Each reading of both encoders
//! is one such equation. Slides in both postures determine the encoders' zeros, their errors once and twice around, the
//! ratio of the links' lengths, and the height of the belt (planar-constraint calibration: Zhuang, Motaghedi and Roth,
//! "Robot calibration with planar constraints", ICRA 1999). The line has no scale: one length has to be measured. Nor
//! does it have a direction: the first zero is that to the belt's normal, and the belt's tilt against the vertical has to
//! come from elsewhere.
//!
//! - [`parameters`]: what is identified, and how well it is known beforehand
//! - [`geometry`]: line and tip as functions of the parameters, with their derivatives
//! - [`passes`]: slides as means over short stretches
//! - [`fit`]: nonlinear least squares with that prior knowledge, and the covariance
//! - [`verdict`]: reasons to refuse a result, and the motion that is missing
//! - [`forces`]: friction of the tip and ripple of its normal force
//! - [`torques`]: friction and springs of the joints, and gains of their stages, once the geometry is known
//!
//! Parameters are strongly correlated: a zero and the cosine of its encoder's error differ little over a part of a
//! turn. What counts is the tip, so a result is judged by the standard deviation of the tip's position
//! ([`Identified::tip_deviation_m`]).

pub mod fit;
pub mod forces;
pub mod geometry;
pub mod parameters;
pub mod passes;
pub mod refusal;
pub mod torques;
pub mod verdict;

use painleve_shared::Posture;

use fit::Fit;
use geometry::Range;
pub use parameters::{Parameter, Parameters, Prior};
use passes::Points;
pub use refusal::{Missing, Refusal};

/// Least share of a slide's readings with the tip on the belt.
const ON_BELT: f64 = 0.8;

/// Part of the torque limit from which a torque counts as limited: the drive rounds its limit down to counts, of which it has
/// some dozens at least.
const LIMITED: f64 = 0.97;

/// Largest share of a slide's readings with a limited torque. Simulated arms with torque enough have 0.004 of them. With 0.18, the
/// deviations of what their torques show are several times as large, and with 0.65 or more, values are wrong by more than those.
const MOST_LIMITED: f64 = 0.1;

/// Least number of readings of which [`MOST_LIMITED`] is a share, as a part of a whole slide's: what throws a tip ends its slide,
/// and takes the torques to their limit for some ticks.
const LEAST_LIMITED_OF: f64 = 0.1;

/// Readings of one tick of a slide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Control tick; wraps. Ticks may be missing.
    pub tick: u32,
    /// Angles by the encoders of θ1 and of the elbow, from their configured zeros, without any correction, rad.
    pub encoders_rad: [f64; 2],
    /// Contact force along and off the belt, f_t and f_n, N.
    pub force_n: [f64; 2],
    /// Commanded torque of each joint, N·m.
    pub torque_nm: [f64; 2],
}

/// A slide of the tip along the belt, to and fro, in one posture.
#[derive(Clone, Debug)]
pub struct Slide {
    /// The posture, as the operator says.
    pub posture: Posture,
    /// Readings in order of time.
    pub readings: Vec<Reading>,
    /// Number of ticks without all readings.
    pub missing: usize,
    /// Number of ticks that a whole slide has: more than there are if it ended early.
    pub whole: usize,
}

impl Slide {
    /// Returns the readings with the tip on the belt.
    pub fn on_belt(&self, limits: &Limits) -> impl Iterator<Item = &Reading> {
        let readings = self.readings.iter();
        readings.filter(|it| it.force_n[1] >= limits.contact_n)
    }

    /// Returns the share of a whole slide's readings with the tip on the belt. What is missing is no reading.
    pub fn share_on_belt(&self, limits: &Limits) -> f64 {
        let whole = self.whole.saturating_sub(self.missing);
        self.on_belt(limits).count() as f64 / whole.max(self.readings.len()).max(1) as f64
    }

    /// Checks that torque was left in most readings of the slide with this index. A tip that lacks it is not where the drive
    /// wants it, and sticks to the belt instead of sliding.
    ///
    /// # Errors
    /// [`Refusal::TorqueLimit`] if it was not.
    pub fn check_torque(&self, index: usize, limits: &Limits) -> Result<(), Refusal> {
        let limit_nm = limits.torque_limit_nm;
        let is_limited =
            |it: &&Reading| it.torque_nm.iter().any(|nm| nm.abs() >= LIMITED * limit_nm);
        let limited = self.readings.iter().filter(is_limited).count();
        let least = LEAST_LIMITED_OF * self.whole as f64;
        let share = limited as f64 / least.max(self.readings.len() as f64).max(1.0);
        if share > MOST_LIMITED {
            return Err(Refusal::TorqueLimit {
                slide: index,
                percent: 100.0 * share,
                limit_nm,
            });
        }
        Ok(())
    }

    /// Checks that the tip was on the belt in most readings of the slide with this index.
    ///
    /// # Errors
    /// [`Refusal::NotOnBelt`] if it was not.
    pub fn check_on_belt(&self, index: usize, limits: &Limits) -> Result<(), Refusal> {
        let share = self.share_on_belt(limits);
        if share < ON_BELT {
            return Err(Refusal::NotOnBelt {
                slide: index,
                percent: 100.0 * share,
                contact_n: limits.contact_n,
            });
        }
        Ok(())
    }
}

/// Limits of an identification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// One count of the coarser encoder, rad.
    pub count_rad: f64,
    /// Least normal force of a tip on the belt, N.
    pub contact_n: f64,
    /// Largest standard deviation of the tip's position within [`FAR`](fit::FAR), m, apart from that by the measured length.
    pub tip_deviation_m: f64,
    /// Largest distance of the tip from a line, root mean square, m, apart from what rounding adds.
    pub off_line_m: f64,
    /// Speed of a tip along the belt, in its direction, from which the belt carries it, m/s.
    pub carried_m_s: f64,
    /// Largest torque that is commanded to a joint, N·m.
    pub torque_limit_nm: f64,
}

impl Limits {
    /// Returns the limits of a first look, whose slides need not determine anything yet.
    pub fn of_first_look(&self) -> Self {
        Self {
            tip_deviation_m: f64::INFINITY,
            ..*self
        }
    }
}

impl Default for Limits {
    /// For encoders of 14 bits, a tip that the belt never carries, and a drive that knows no limit.
    fn default() -> Self {
        Self {
            count_rad: core::f64::consts::TAU / 16384.0,
            contact_n: 0.5,
            tip_deviation_m: 0.5e-3,
            off_line_m: 0.15e-3,
            carried_m_s: f64::INFINITY,
            torque_limit_nm: f64::INFINITY,
        }
    }
}

/// An identified arm.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The parameters with their covariance.
    pub fit: Fit,
    /// Standard deviation of the tip's position relative to the edges, m: the largest in both postures.
    pub tip_deviation_m: f64,
    /// Standard deviation of the tip's position along the belt, m, if link 1 has its length: the largest in the postures that
    /// have been slid in, within [`FAR`](fit::FAR).
    pub place_deviation_m: f64,
    /// Distance of the tip from the line, root mean square, m: with the parameters known before, and with these.
    pub off_line_m: [f64; 2],
    /// The readings as means over short stretches.
    pub points: Points,
    /// Number of readings on the belt.
    pub readings: usize,
    /// The stretch that was slid along in each slide.
    pub ranges: Vec<Range>,
}

/// Identifies an arm.
///
/// # Errors
/// [`Refusal`] with the reason, if the readings do not determine the tip's position to the limit, or are not those of
/// a rigid arm with its tip on a straight line, or contradict what is known beforehand.
pub fn identify(slides: &[Slide], prior: &Prior, limits: &Limits) -> Result<Identified, Refusal> {
    let points = Points::of(slides, prior, limits)?;
    let fit = Fit::new(&points, prior);
    let before = points.off_line_m(&prior.parameters);
    let after = points.off_line_m(&fit.parameters);
    verdict::check_line(&points, prior, limits, &fit, after)?;
    verdict::check_prior(&fit, prior)?;
    let ranges = points.ranges(&fit.parameters);
    verdict::check_observed(&points, &ranges, &fit, prior, limits)?;
    let postures = ranges.iter().map(|range| range.posture);
    Ok(Identified {
        tip_deviation_m: fit.tip_deviation_m(),
        place_deviation_m: fit.place_deviation_m(postures, &fit.covariance),
        off_line_m: [before, after],
        readings: points.readings,
        points,
        ranges,
        fit,
    })
}
