//! Deviations from the scenario, and mistakes that no setting can describe, each in one sentence.

use painleve_identify::parameters::JOINT_NAMES;

/// A deviation from the scenario that the measured settings correct.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Deviation {
    /// An encoder counts in the other direction.
    #[error(
        "encoder of {}: counts in the other direction than the scenario says (converters.mounting.encoder_reversed)",
        JOINT_NAMES[*.joint]
    )]
    EncoderDirection {
        /// Index of the joint.
        joint: usize,
    },
    /// An encoder's zero is elsewhere.
    #[error(
        "encoder of {}: its zero is {error_deg:.1}° off (converters.encoder.offset_counts)",
        JOINT_NAMES[*.joint]
    )]
    EncoderZero {
        /// Index of the joint.
        joint: usize,
        /// Measured angle minus the scenario's, degrees.
        error_deg: f64,
    },
    /// The force cell's zero is elsewhere.
    #[error(
        "force cell: without a load, {} reads {error_n:.2} N beyond the scenario's tare (converters.mounting.force_tare)",
        ["f_t", "f_n"][*.axis]
    )]
    ForceTare {
        /// 0 for f_t, 1 for f_n.
        axis: usize,
        /// Measured tare minus the scenario's, N.
        error_n: f64,
    },
    /// An axis of the force cell has the other sign.
    #[error(
        "force cell: {} has the other sign than the scenario says (converters.mounting.force_reversed)",
        ["f_t", "f_n"][*.axis]
    )]
    ForceDirection {
        /// 0 for f_t, 1 for f_n.
        axis: usize,
    },
    /// A second encoder counts in the other direction.
    #[error(
        "second encoder of {}: counts in the other direction than the scenario says (converters.mounting.second_encoder_reversed)",
        JOINT_NAMES[*.joint]
    )]
    SecondEncoderDirection {
        /// Index of the joint.
        joint: usize,
    },
    /// An axis of the second force cell has the other sign.
    #[error(
        "second force cell: {} has the other sign than the scenario says (converters.mounting.second_force_reversed)",
        ["f_t", "f_n"][*.axis]
    )]
    SecondForceDirection {
        /// 0 for f_t, 1 for f_n.
        axis: usize,
    },
    /// The belt is higher or lower.
    #[error("belt: it is {:.1} mm {} by the encoders than the scenario says (arm.height_m)", 1e3 * .error_m.abs(), if *.error_m < 0.0 { "higher" } else { "lower" })]
    BeltHeight {
        /// Measured distance of the first joint from the belt minus the scenario's, m.
        error_m: f64,
    },
    /// A torque stage turns its joint in the other direction.
    #[error(
        "torque stage of {}: turns its joint in the other direction than the scenario says (converters.mounting.stage_reversed)",
        JOINT_NAMES[*.joint]
    )]
    StageDirection {
        /// Index of the joint.
        joint: usize,
    },
}

/// A mistake that no setting can describe: it has to be mended first.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Mistake {
    /// An encoder gives no readings.
    #[error("encoder of {}: no readings; check its supply, its select line and its magnet", JOINT_NAMES[*.joint])]
    EncoderSilent {
        /// Index of the joint.
        joint: usize,
    },
    /// An encoder does not change.
    #[error(
        "encoder of {}: its reading did not change while the joint turned by 90°; check its line and its magnet",
        JOINT_NAMES[*.joint]
    )]
    EncoderDead {
        /// Index of the joint.
        joint: usize,
    },
    /// The encoders are exchanged.
    #[error(
        "encoders: exchanged; swap their select lines (PB6 and PB7, or PB10 and PB11 of second encoders)"
    )]
    EncodersSwapped,
    /// An encoder turns by another angle than its joint.
    #[error(
        "encoder of {}: turned by {turned_deg:.0}° while its joint turned by 90°; check the magnet's seat, the gear, and converters.encoder.bits",
        JOINT_NAMES[*.joint]
    )]
    EncoderScale {
        /// Index of the joint.
        joint: usize,
        /// Angle by which the encoder turned, degrees.
        turned_deg: f64,
    },
    /// The operator has held the arm otherwise than told.
    #[error(
        "encoder of {}: its angles are not those of the three poses; hold both links in the directions that each task names",
        JOINT_NAMES[*.joint]
    )]
    HeldOtherwise {
        /// Index of the joint.
        joint: usize,
    },
    /// The torque limit is too low for the force cell.
    #[error(
        "torque stage of {}: within the torque limit, the force changes by only {change_n:.3} N, too little for the force cell; raise --torque-limit-nm",
        JOINT_NAMES[*.joint]
    )]
    TorqueTooSmall {
        /// Index of the joint.
        joint: usize,
        /// Expected change of the force, N.
        change_n: f64,
    },
    /// The force cell gives no readings, or codes that no force gives.
    #[error(
        "force cell: no readings between the codes converters.mounting.force_lowest_code and force_highest_code; check its supply, its wires and its select line"
    )]
    ForceSilent,
    /// The force cell's zero leaves too little of its range.
    #[error(
        "force cell: {} reads {offset_n:.1} N without a load, more than a quarter of its range; balance its bridge amplifier",
        ["f_t", "f_n"][*.axis]
    )]
    ForceOffset {
        /// 0 for f_t, 1 for f_n.
        axis: usize,
        /// Reading without a load, N.
        offset_n: f64,
    },
    /// The force cell does not notice the arm's weight.
    #[error(
        "force cell: f_n did not change when the tip was set down with {expected_n:.1} N; check its lines and the amplifier"
    )]
    ForceDead {
        /// Force expected from the weight, N.
        expected_n: f64,
    },
    /// The force cell is at its limit.
    #[error(
        "force cell: at its limit, although the arm's weight should press with {expected_n:.1} N; check converters.force.range_n and the amplifier"
    )]
    ForceLimit {
        /// Force expected from the weight, N.
        expected_n: f64,
    },
    /// The force cell's axes are exchanged.
    #[error(
        "force cell: f_t and f_n are exchanged; swap the converter's pairs of channels (0-1, 2-3)"
    )]
    ForceAxesSwapped,
    /// The force cell has another scale.
    #[error(
        "force cell: reads {ratio:.2} times the arm's weight; check converters.force.range_n and the arm's masses"
    )]
    ForceScale {
        /// Reading divided by the expected force.
        ratio: f64,
    },
    /// The model cannot press on the belt.
    #[error(
        "arm: according to the scenario, its weight presses on the belt below joint 1 with only {expected_n:.2} N, too little to measure; check link_mass_kg, the springs, belt_tilt_rad and converters.force.range_n"
    )]
    TooLight {
        /// Force expected from the weight, N.
        expected_n: f64,
    },
    /// The model presses harder than the force cell measures.
    #[error(
        "arm: according to the scenario, its weight presses on the belt below joint 1 with {expected_n:.1} N, more than the force cell measures (converters.force.range_n = {range_n}, of which the codes in converters.mounting leave {most_n:.1} N); check link_mass_kg and the springs, or take another cell"
    )]
    TooHeavy {
        /// Force expected from the weight, N.
        expected_n: f64,
        /// Range of the force cell, N.
        range_n: f64,
        /// Largest force that it measures, N.
        most_n: f64,
    },
    /// The tip is not at the requested position.
    #[error(
        "arm: its tip rests {tip_mm:.0} mm from the point below joint 1 and {gap_mm:.0} mm from the belt of the scenario; set it down below joint 1, and check arm.link_length_m"
    )]
    NotSetDown {
        /// Position along the belt, mm.
        tip_mm: f64,
        /// Height over the belt of the scenario, mm.
        gap_mm: f64,
    },
    /// The arm moved during a test at rest.
    #[error(
        "arm: moved by {moved_mm:.1} mm under a small torque; set the tip down again on a clean, standing belt"
    )]
    Moved {
        /// Distance of the tip, mm.
        moved_mm: f64,
    },
    /// A torque stage has no effect.
    #[error("torque stage of {}: no effect; check its supply, its enable line and its input", JOINT_NAMES[*.joint])]
    StageDead {
        /// Index of the joint.
        joint: usize,
    },
    /// No measurable torque leaves the force within the cell's range.
    #[error(
        "torque stage of {}: under a small torque of either sign the force cell is at its limit (converters.force.range_n = {range_n}); check the stage, and that the cell measures more than the arm's weight",
        JOINT_NAMES[*.joint]
    )]
    StageAtForceLimit {
        /// Index of the joint.
        joint: usize,
        /// Range of the force cell, N.
        range_n: f64,
    },
    /// The torque stages are exchanged.
    #[error("torque stages: exchanged; swap their inputs (PA4, PA5)")]
    StagesSwapped,
    /// A torque stage has another scale.
    #[error(
        "torque stage of {}: gives {ratio:.2} times the commanded torque, as if converters.stages.gear_ratio were {gear_ratio:.2}; check it, gear_efficiency and motor_range_nm",
        JOINT_NAMES[*.joint]
    )]
    StageScale {
        /// Index of the joint.
        joint: usize,
        /// Torque at the joint divided by the commanded torque.
        ratio: f64,
        /// Gear ratio that would explain it.
        gear_ratio: f64,
    },
    /// The scenario of second sensors has not been commissioned with the first ones.
    #[error(
        "torque stage of {}: turns its joint in the other direction than the scenario says; commission the first sensors first, and give the file that this writes",
        JOINT_NAMES[*.joint]
    )]
    NotCommissioned {
        /// Index of the joint.
        joint: usize,
    },
    /// The forces of a torque are not those of the model.
    #[error(
        "torque stage of {}: its torque changes f_t and f_n in a ratio that no exchange or change of sign explains; check the arm's parameters and the force cell",
        JOINT_NAMES[*.joint]
    )]
    Unexplained {
        /// Index of the joint.
        joint: usize,
    },
}
