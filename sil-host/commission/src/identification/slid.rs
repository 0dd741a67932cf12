//! What an arm has slid: its ticks, and what ends a slide at once.

use nalgebra::Vector2;
use painleve_identify::{Reading, Refusal};
use painleve_plant::converters::encoder::links_rad;
use painleve_plant::scenario::Scenario;
use painleve_shared::Pose;
use painleve_shared::counts::{EncoderScale, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, SensorFrame, StatusFlags};
use painleve_shared::status::SupervisorState;

/// Normal force that ends a slide, N: three times that of the last attempt.
const MOST_FORCE_N: f32 = 18.0;

/// Speed of the tip that ends a slide, m/s. Healthy arms reach 0.12 m/s, and one that a vibrating belt throws 0.26 m/s.
const MOST_SPEED_M_S: f64 = 0.4;

/// Time for which a surprise has to last, s: longer than the impact of a landing, and than a reading that is wrong. It is
/// also the time over which a speed is taken.
const LASTS_S: f64 = 0.01;

/// A tick of a slide.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlideTick {
    /// The readings.
    pub sensor: SensorFrame,
    /// The torques that answered them.
    pub torques: [TorqueCounts; 2],
}

/// What ends a slide at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surprise {
    /// The tip has pressed too hard.
    PressesTooHard {
        /// The force that is too much, N.
        most_n: f64,
    },
    /// The tip has moved too fast, on the belt or off it.
    MovesTooFast {
        /// The speed that is too much, m/s.
        most_m_s: f64,
    },
}

impl Surprise {
    /// Returns why the arm is refused.
    pub(crate) fn refusal(self, slide: usize) -> Refusal {
        match self {
            Self::PressesTooHard { most_n } => Refusal::PressedTooHard { slide, most_n },
            Self::MovesTooFast { most_m_s } => Refusal::MovedTooFast { slide, most_m_s },
        }
    }
}

/// What an arm has slid.
#[derive(Clone, Debug, Default)]
pub struct Slid {
    /// The ticks in which the drive was tracking or had lost the belt, in order of time.
    pub ticks: Vec<SlideTick>,
    /// Whether the reference has come to its end.
    pub is_complete: bool,
}

impl Slid {
    /// Keeps a tick if it belongs to the slide.
    pub fn push(&mut self, sensor: SensorFrame, answer: &ActuatorFrame) {
        let state = answer.supervisor_state();
        if !matches!(
            state,
            Some(SupervisorState::Tracking | SupervisorState::LiftOff)
        ) {
            return;
        }
        self.ticks.push(SlideTick {
            sensor,
            torques: answer.torques,
        });
        let is_done = answer.flags.contains(StatusFlags::REFERENCE_DONE);
        self.is_complete |= is_done && state == Some(SupervisorState::Tracking);
    }

    /// Returns what has happened last, and for so long, that the slide has to end. Ticks may be missing.
    pub fn surprise(&self, scenario: &Scenario) -> Option<Surprise> {
        let tick_hz = f64::from(scenario.run.tick_hz);
        let lasts = libm::ceil(LASTS_S * tick_hz).max(1.0) as u32;
        let newest = self.ticks.last()?.sensor.tick;
        let is_old = |it: &SlideTick| newest.wrapping_sub(it.sensor.tick) >= 2 * lasts;
        let oldest = self.ticks.iter().rposition(is_old).unwrap_or(0);
        let readings = readings(scenario, self.ticks[oldest..].iter().copied());
        let newest = readings.last()?.tick;
        let age = |it: &Reading| newest.wrapping_sub(it.tick);
        // There has to be a reading from about the beginning of the time.
        let beginning = lasts - 1..2 * lasts;
        readings.iter().rfind(|it| beginning.contains(&age(it)))?;
        let last = || readings.iter().rev().take_while(|it| age(it) < lasts);
        let most_n = most_force_n(scenario);
        if last().all(|it| it.force_n[1] >= most_n) {
            return Some(Surprise::PressesTooHard { most_n });
        }
        let most_m_s = MOST_SPEED_M_S;
        let is_fast = |now: &Reading| {
            let mut earlier = readings.iter().rev();
            let before = earlier.find(|it| age(it) >= age(now) + lasts);
            before.is_some_and(|before| {
                let time_s = f64::from(now.tick.wrapping_sub(before.tick)) / tick_hz;
                let [now_m, before_m] = [now, before].map(|it| tip_m(scenario, it.encoders_rad));
                (now_m - before_m).norm() > most_m_s * time_s
            })
        };
        last()
            .all(is_fast)
            .then_some(Surprise::MovesTooFast { most_m_s })
    }
}

/// Returns where the tip is by the encoders, m.
fn tip_m(scenario: &Scenario, encoders_rad: [f64; 2]) -> Vector2<f64> {
    let [length_1, length_2] = match &scenario.arm_model {
        Some(arm) => arm.link_length_m.map(f64::from),
        None => scenario.arm.link_length_m,
    };
    let encoders = &scenario.controller.estimator.encoders;
    let Pose { sine, cosine } = Pose::new(&links_rad(encoders, encoders_rad));
    Vector2::new(
        length_1 * sine.x + length_2 * sine.y,
        -length_1 * cosine.x - length_2 * cosine.y,
    )
}

/// Returns the normal force that ends a slide, N: at most the end of the force cell's range.
fn most_force_n(scenario: &Scenario) -> f64 {
    let scale = scenario.converters.scales().force;
    let (counts, _) = scale.counts(MOST_FORCE_N);
    f64::from(counts) * f64::from(scale.per_count())
}

/// Returns the readings of ticks, by the scenario's zeros and scales. Ticks without all readings, or with torques that no stage
/// gives, are left out. Encoders on the motors lead their joints by the twist of the gears under the torque of the tick before.
pub fn readings(scenario: &Scenario, ticks: impl IntoIterator<Item = SlideTick>) -> Vec<Reading> {
    let scales = scenario.converters.scales();
    let [scale_1, scale_2] = scales.encoders;
    let newtons = f64::from(scales.force.per_count());
    let newton_metres = f64::from(scales.torque.per_count());
    let is_whole = |frame: &SensorFrame| {
        scale_1.contains(frame.joints[0])
            && scale_2.contains(frame.joints[1])
            && scales.force.contains(frame.normal_force.0)
            && scales.force.contains(frame.tangential_force.0)
    };
    let soft_rad_nm = scenario.controller.estimator.gear_compliance_rad_nm;
    let rad = |scale: EncoderScale, reading| {
        f64::from(scale.counts_from_zero(reading)) * scale.rad_per_count::<f64>()
    };
    let mut before_nm = None;
    ticks
        .into_iter()
        .filter_map(|SlideTick { sensor, torques }| {
            if !torques.iter().all(|it| scales.torque.contains(it.0)) {
                before_nm = None;
                return None;
            }
            let torque_nm = torques.map(|torque| f64::from(torque.0) * newton_metres);
            let twisting_nm = before_nm.replace(torque_nm).unwrap_or(torque_nm);
            let twist_rad = |joint: usize| f64::from(soft_rad_nm[joint]) * twisting_nm[joint];
            is_whole(&sensor).then(|| Reading {
                tick: sensor.tick,
                encoders_rad: [
                    rad(scale_1, sensor.joints[0]) - twist_rad(0),
                    rad(scale_2, sensor.joints[1]) - twist_rad(1),
                ],
                force_n: [sensor.tangential_force, sensor.normal_force]
                    .map(|force| f64::from(force.0) * newtons),
                torque_nm,
            })
        })
        .collect()
}
