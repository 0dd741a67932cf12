//! One tick for the page: a time, numbers and single bytes, little-endian.

use painleve_record::RecordedTick;

/// Names of the numbers, in order; 4 bytes each. Unknown numbers are NaN.
pub const COLUMNS: [&str; 18] = [
    "theta1_rad",
    "theta2_rad",
    "tip_m",
    "reference_m",
    "gap_m",
    "belt_m_s",
    "travel_m",
    "fn_n",
    "ft_n",
    "u1_nm",
    "u2_nm",
    "b_m_s2",
    "p_per_kg",
    "friction",
    "friction_deviation",
    "lower_edge_m",
    "upper_edge_m",
    "confidence",
];

/// Names of the bytes, in their order: contact mode, supervisor state, fault, status flags.
pub const BYTE_COLUMNS: [&str; 4] = ["mode", "state", "fault", "flags"];

/// Bytes of a row.
pub const ROW_BYTES: usize = 8 + 4 * COLUMNS.len() + BYTE_COLUMNS.len();

/// Data of one tick for the page.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Simulated time, s.
    pub time_s: f64,
    /// Values of [`COLUMNS`].
    pub numbers: [f32; COLUMNS.len()],
    /// Values of [`BYTE_COLUMNS`].
    pub bytes: [u8; BYTE_COLUMNS.len()],
}

impl Row {
    /// Position of the normal force among the numbers.
    pub(crate) const NORMAL_FORCE: usize = 7;

    /// Creates the row of a tick; the belt has moved by `travel_m` since the start.
    pub fn new(tick: &RecordedTick<'_>, travel_m: f64) -> Self {
        let (plant, answer) = (&tick.sample.plant, &tick.sample.actuator);
        let estimates = |read: fn(&painleve_firmware::telemetry::Telemetry) -> f32| {
            tick.estimates.map_or(f32::NAN, read)
        };
        let [theta_1, theta_2] = plant.theta_rad.to_array();
        let [u_1, u_2] = plant.torque_nm.to_array();
        Self {
            time_s: plant.time_s,
            numbers: [
                theta_1 as f32,
                theta_2 as f32,
                plant.tip_t_m as f32,
                tick.sample.reference_tip_t_m as f32,
                plant.gap_m as f32,
                plant.belt_speed_m_s as f32,
                travel_m as f32,
                plant.normal_force_n as f32,
                plant.tangential_force_n as f32,
                u_1 as f32,
                u_2 as f32,
                plant.b_m_s2 as f32,
                plant.p_per_kg as f32,
                estimates(|now| now.friction),
                estimates(|now| now.friction_deviation),
                estimates(|now| now.edges_m[0]),
                estimates(|now| now.edges_m[1]),
                estimates(|now| now.contact_confidence),
            ],
            bytes: [
                plant.mode as u8,
                answer.state,
                answer.fault,
                // The lower eight flags; there are no others.
                answer.flags.0 as u8,
            ],
        }
    }

    /// Returns the normal force, N.
    pub fn normal_force_n(&self) -> f32 {
        self.numbers[Self::NORMAL_FORCE]
    }

    /// Appends the row's bytes.
    pub fn write(&self, to: &mut Vec<u8>) {
        to.extend(self.time_s.to_le_bytes());
        to.extend(self.numbers.iter().flat_map(|number| number.to_le_bytes()));
        to.extend(self.bytes);
    }
}
