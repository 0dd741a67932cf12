//! One tick for the page: a time, numbers and single bytes, little-endian.

use painleve_plant::scenario::Scenario;
use painleve_record::RecordedTick;
use painleve_record::paradox::{Distance, ParadoxDistance};
use painleve_shared::LinkMotion;

/// Names of the numbers, in order; 4 bytes each. Unknown numbers are NaN.
pub const COLUMNS: [&str; 20] = [
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
    "p_ratio",
    "edge_m",
];

/// Names of the bytes, in their order: contact mode, supervisor state, fault, status flags.
pub const BYTE_COLUMNS: [&str; 4] = ["mode", "state", "fault", "flags"];

/// Bytes of a row.
pub const ROW_BYTES: usize = 8 + 4 * COLUMNS.len() + BYTE_COLUMNS.len();

/// What follows from more than one tick, or from the arm.
#[derive(Clone, Copy, Debug)]
pub struct Followed {
    /// The distance that the belt has moved, m.
    pub travel_m: f64,
    /// The distance to the paradox.
    pub paradox: Distance,
}

/// Follows the ticks of a run.
#[derive(Clone, Debug)]
pub struct Follower {
    paradox: Option<ParadoxDistance>,
    travel_m: f64,
    last_s: Option<f64>,
}

impl Follower {
    /// Starts at the beginning of a run of this scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            paradox: ParadoxDistance::new(scenario).ok(),
            travel_m: 0.0,
            last_s: None,
        }
    }

    /// Goes on to a time (s), with the belt's speed (m/s), the link angles (rad) and p (1/kg) there.
    pub fn advance(
        &mut self,
        time_s: f64,
        belt_m_s: f64,
        theta_rad: &LinkMotion<f64>,
        p_per_kg: f64,
    ) -> Followed {
        let elapsed_s = time_s - self.last_s.unwrap_or(time_s);
        // Unknown on a real arm.
        if belt_m_s.is_finite() {
            self.travel_m += belt_m_s * elapsed_s;
        }
        self.last_s = Some(time_s);
        let unknown = Distance {
            p_ratio: f64::NAN,
            edge_m: f64::NAN,
        };
        let paradox = self.paradox.as_mut();
        Followed {
            travel_m: self.travel_m,
            paradox: paradox.map_or(unknown, |paradox| {
                paradox.measure(time_s, theta_rad, p_per_kg)
            }),
        }
    }

    /// Goes on to a tick.
    pub fn tick(&mut self, tick: &RecordedTick<'_>) -> Followed {
        let plant = &tick.sample.plant;
        self.advance(
            plant.time_s,
            plant.belt_speed_m_s,
            &plant.theta_rad,
            plant.p_per_kg,
        )
    }
}

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

    /// Creates the row of a tick.
    pub fn new(tick: &RecordedTick<'_>, followed: Followed) -> Self {
        let (plant, answer) = (&tick.sample.plant, &tick.sample.actuator);
        let estimates = |read: fn(&painleve_plant::telemetry::Telemetry) -> f32| {
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
                followed.travel_m as f32,
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
                followed.paradox.p_ratio as f32,
                followed.paradox.edge_m as f32,
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

    /// Creates a row from the columns of a recorded run. `known` returns the value of the first of two columns, or
    /// else of the second.
    pub fn of_columns(time_s: f64, known: impl Fn([&str; 2]) -> f64, followed: Followed) -> Self {
        let number = |[plant, estimate]: [&str; 2]| known([plant, estimate]) as f32;
        let estimate = |name: &str| known([name; 2]) as f32;
        let byte = |name: &str| known([name; 2]) as u8;
        Self {
            time_s,
            numbers: [
                number(["plant.theta1_rad", "estimates.theta1_rad"]),
                number(["plant.theta2_rad", "estimates.theta2_rad"]),
                number(["plant.tip_t_m", "estimates.tip_t_m"]),
                number(["plant.reference_tip_t_m", "estimates.reference_m"]),
                estimate("plant.gap_m"),
                estimate("plant.belt_speed_m_s"),
                followed.travel_m as f32,
                number(["plant.normal_force_n", "estimates.normal_force_n"]),
                number(["plant.tangential_force_n", "estimates.tangential_force_n"]),
                number(["plant.u1_nm", "estimates.u1_nm"]),
                number(["plant.u2_nm", "estimates.u2_nm"]),
                estimate("plant.b_m_s2"),
                estimate("plant.p_per_kg"),
                estimate("estimates.friction"),
                estimate("estimates.friction_deviation"),
                estimate("estimates.lower_edge_m"),
                estimate("estimates.upper_edge_m"),
                estimate("estimates.contact_confidence"),
                followed.paradox.p_ratio as f32,
                followed.paradox.edge_m as f32,
            ],
            bytes: [
                byte("plant.mode_number"),
                byte("actuator.state_number"),
                byte("actuator.fault_number"),
                byte("actuator.flags"),
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
