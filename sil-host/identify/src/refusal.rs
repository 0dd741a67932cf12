//! Reasons to refuse a result, each in one sentence, and the motion that is missing.

use painleve_shared::{OutOfRange, Posture};

use crate::geometry::Range;
use crate::parameters::{JOINT_NAMES, Parameter};

/// Share of the readings up to which friction counts as always against the belt, %.
const ALWAYS_AGAINST: f64 = 10.0;

/// What makes an arm press too hard, or throws it. A count of the encoders of a long, heavy arm is a large force.
const OF_ARM: &str = "controller.torque_limit_nm, the masses and springs that the scenario gives for the arm, and converters.encoder.bits: the heavier an arm, the more its torques shake it with coarse encoders";

/// A motion that is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Missing {
    /// The slide that is missing.
    pub range: Range,
    /// Whether there has been none in this posture.
    pub is_new: bool,
}

impl core::fmt::Display for Missing {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Range {
            posture,
            from_m,
            to_m,
        } = self.range;
        let posture = name(posture);
        let verb = if self.is_new {
            "slide"
        } else {
            "slide farther"
        };
        write!(
            f,
            "{verb} with the {posture}, from {:.0} to {:.0} mm",
            1e3 * from_m,
            1e3 * to_m
        )
    }
}

fn advice(missing: Option<&Missing>, off_mm: f64) -> String {
    missing.map_or_else(
        || {
            format!(
                "they go far enough, but shake too much, {off_mm:.2} mm off a line, root mean square; check the belt's waves and vibration, its seam, play in the joints, and converters.encoder.bits"
            )
        },
        Missing::to_string,
    )
}

fn name(posture: Posture) -> &'static str {
    match posture {
        Posture::ElbowUp => "elbow up",
        Posture::ElbowDown => "elbow down",
    }
}

/// Returns which surface pushes a tip in the belt's direction in this share of the readings, %. A belt that stands still
/// cannot be told from its frame.
fn surface(percent: f64) -> &'static str {
    if percent < ALWAYS_AGAINST {
        "as if the belt ran in the other direction: let it run as instructed, and check the sign of f_t (converters.mounting.force_reversed)"
    } else {
        "as on a surface that stands still or is slower than the tip: set the tip down on the belt, not beside it, and let the belt run as instructed"
    }
}

/// Reason to refuse a result.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A reading is not a number.
    #[error("slide {}: the reading of tick {tick} is not a number", .slide + 1)]
    NotFinite {
        /// Index of the slide.
        slide: usize,
        /// Control tick of the reading.
        tick: u32,
    },
    /// There is no tick.
    #[error(
        "slide {}: the drive was never tracking; give the record of a slide, or see what prevented it, such as a tip that does not touch the belt",
        .slide + 1
    )]
    NeverTracked {
        /// Index of the slide.
        slide: usize,
    },
    /// The tip pressed too hard, and the slide was ended.
    #[error(
        "slide {}: the tip pressed on the belt with {most_n:.0} N or more, and the torque was taken off; see what it catches on, and check {OF_ARM}",
        .slide + 1
    )]
    PressedTooHard {
        /// Index of the slide.
        slide: usize,
        /// Force that ends a slide, N.
        most_n: f64,
    },
    /// The tip moved too fast, and the slide was ended.
    #[error(
        "slide {}: the tip moved faster than {most_m_s} m/s, and the torque was taken off; see whether the tip is on the belt and what throws it, and check {OF_ARM}",
        .slide + 1
    )]
    MovedTooFast {
        /// Index of the slide.
        slide: usize,
        /// Speed that ends a slide, m/s.
        most_m_s: f64,
    },
    /// Too many ticks have no reading of some sensor, or none that the scenario's sensors give.
    #[error(
        "slide {}: {percent:.0} % of the ticks lack a valid reading or torque; check the sensors' lines, and bits in converters.encoder, converters.force and converters.torque",
        .slide + 1
    )]
    MissingReadings {
        /// Index of the slide.
        slide: usize,
        /// Share of ticks, %.
        percent: f64,
    },
    /// The torque did not suffice.
    #[error(
        "slide {}: a torque was at its limit (controller.torque_limit_nm = {limit_nm}) in {percent:.0} % of the readings, so that the tip did not slide as it should; raise it to what the stages surely give, or take stronger stages",
        .slide + 1
    )]
    TorqueLimit {
        /// Index of the slide.
        slide: usize,
        /// Share of the readings with a torque at its limit, %.
        percent: f64,
        /// The limit, N·m.
        limit_nm: f64,
    },
    /// The tip was in the air.
    #[error(
        "slide {}: the tip was on the belt in only {percent:.0} % of the readings (f_n of {contact_n} N or more); see what holds or throws it, and check the force cell, {OF_ARM}",
        .slide + 1
    )]
    NotOnBelt {
        /// Index of the slide.
        slide: usize,
        /// Share of readings with the tip on the belt, %.
        percent: f64,
        /// Least normal force on the belt, N.
        contact_n: f64,
    },
    /// Friction does not push the tip in the direction in which the belt was to run.
    #[error(
        "slide {}: friction pushes the tip in the belt's direction in only {percent:.0} % of the readings, {}",
        .slide + 1,
        surface(*.percent)
    )]
    OtherFriction {
        /// Index of the slide.
        slide: usize,
        /// Share of the readings with friction in which it pushes so, %.
        percent: f64,
    },
    /// Too little motion.
    #[error(
        "the tip slid only {slid_mm:.0} mm, less than {least_mm:.0} mm: see what holds it, and check the masses and belt.friction, because of which the governor may stop it"
    )]
    TooShort {
        /// Distance, mm.
        slid_mm: f64,
        /// Least distance, mm.
        least_mm: f64,
    },
    /// The arm was in the other posture.
    #[error(
        "slide {}: the arm was in the posture {}, not as told; give the right posture, or turn the elbow",
        .slide + 1,
        name(*.found)
    )]
    OtherPosture {
        /// Index of the slide.
        slide: usize,
        /// The posture by the elbow's encoder.
        found: Posture,
    },
    /// The encoders are exchanged.
    #[error("encoders: exchanged; swap their select lines")]
    EncodersSwapped,
    /// An encoder counts backwards.
    #[error(
        "encoder of {}: counts in the other direction than the scenario says (converters.mounting.encoder_reversed)",
        JOINT_NAMES[*.joint]
    )]
    EncoderReversed {
        /// Index of the joint.
        joint: usize,
    },
    /// An encoder slipped on its shaft.
    #[error(
        "encoder of {}: slipped on its shaft by {slipped_deg:.2}° in slide {}; fasten its magnet, and slide again",
        JOINT_NAMES[*.joint],
        .slide + 1
    )]
    Slipped {
        /// Index of the joint.
        joint: usize,
        /// Index of the slide.
        slide: usize,
        /// Angle, degrees.
        slipped_deg: f64,
    },
    /// The tip is not on a line.
    #[error(
        "the tip does not stay on a straight line: {off_mm:.2} mm off, root mean square, where {most_mm:.2} mm are allowed; check for play in the joints, a loose magnet, an uneven belt, a tip that is not on it, slides of different arms, and too few converters.encoder.bits"
    )]
    NotALine {
        /// Distance, mm.
        off_mm: f64,
        /// Largest distance, mm.
        most_mm: f64,
    },
    /// The model does not explain the torques.
    #[error(
        "the arm's model leaves {left_mnm:.0} of {torque_mnm:.0} mN·m of torque unexplained (root mean square): check the lines of the force cell and of the torque stages, and the masses, centres of mass and springs that the scenario gives for the arm"
    )]
    OtherTorques {
        /// Torque that is left over, mN·m.
        left_mnm: f64,
        /// Torque of the slides, mN·m.
        torque_mnm: f64,
    },
    /// A result contradicts what is known.
    #[error(
        "{parameter}: {found:.4}{} by the slides, but {known:.4} ± {deviation:.4} is known beforehand: a link is bent or has another length than told (link_length_m, --link-1-m), the belt is elsewhere (height_m), or a zero has been taken wrongly (converters.encoder.offset_counts)",
        .parameter.unit_after_number()
    )]
    Contradicts {
        /// The parameter.
        parameter: Parameter,
        /// Its value by the slides.
        found: f64,
        /// Its value as known.
        known: f64,
        /// The standard deviation of that.
        deviation: f64,
    },
    /// The slides do not determine the tip's position.
    #[error(
        "the slides determine the tip's position only to {deviation_mm:.2} mm, but {limit_mm:.2} mm are needed: {}",
        advice(.missing.as_ref(), *.off_mm)
    )]
    NotObserved {
        /// Standard deviation, mm.
        deviation_mm: f64,
        /// Largest one, mm.
        limit_mm: f64,
        /// Distance of the tip from a straight line, root mean square, mm.
        off_mm: f64,
        /// The slide that would determine it; `None` if there has been each that could.
        missing: Option<Missing>,
    },
    /// A value by the slides is out of range.
    #[error("by the slides, {0}")]
    OutOfRange(#[from] OutOfRange),
}
