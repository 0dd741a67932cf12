//! How smooth a controller's torque and contact force are: a rough torque heats windings and wears gears.

use painleve_shared::counts::Micrometres;
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::status::SupervisorState;

use crate::converters::ConverterSettings;

/// Velocity from which a reference counts as moving, m/s. One that an edge holds back creeps with the estimated edge.
const MOVING_M_S: f64 = 5e-3;

/// Time over which that velocity is taken, s: the reference is in whole micrometres.
const VELOCITY_S: f64 = 1e-3;

/// Time after which a reference that has come to rest counts as standing, s. Landing and the end of a motion are neither:
/// the force then rises to its desired value.
const SETTLING_S: f64 = 0.5;

/// Smoothness while the controller tracks a moving reference, and one that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// While the reference moves.
    pub moving: Roughness,
    /// While it stands.
    pub holding: Roughness,
    tick_hz: f64,
    /// Whether the reference moves.
    moves: bool,
    /// Where it was when its velocity was last taken, and the ticks since; absent unless the controller tracks.
    way: Option<(Micrometres, u32)>,
    /// Ticks since the reference moved, or since tracking began.
    rest_ticks: u64,
    /// The answer before, if the controller tracked, and the changes of torque that it brought, counts.
    last: Option<(ActuatorFrame, [i64; 2])>,
}

/// Sums over ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roughness {
    ticks: u64,
    /// Sum over ticks and joints of the squared changes of torque, counts².
    squares: f64,
    /// Changes of a joint's torque against the change before.
    reversals: u64,
    mean_force_n: f64,
    /// Sum of the squared deviations from that mean, N².
    force_squares_n2: f64,
}

impl Roughness {
    /// Returns the change of torque from tick to tick through these converters, N·m: root mean square over ticks and
    /// joints; `None` without ticks.
    pub fn torque_change_nm(&self, converters: &ConverterSettings) -> Option<f64> {
        let count_nm = f64::from(converters.scales().torque.per_count());
        Some(self.torque_change_counts()? * count_nm)
    }

    fn torque_change_counts(&self) -> Option<f64> {
        let changes = 2.0 * self.ticks as f64;
        (self.ticks > 0).then(|| (self.squares / changes).sqrt())
    }

    /// Returns the share of changes of torque, 0 … 1, that reverse the one before; `None` without ticks.
    pub fn reversals(&self) -> Option<f64> {
        let changes = 2.0 * self.ticks as f64;
        (self.ticks > 0).then(|| self.reversals as f64 / changes)
    }

    /// Returns the standard deviation of the normal force at the ends of ticks, N; `None` without ticks.
    pub fn force_ripple_n(&self) -> Option<f64> {
        (self.ticks > 0).then(|| (self.force_squares_n2 / self.ticks as f64).sqrt())
    }

    fn add(&mut self, changes: [i64; 2], before: [i64; 2], normal_force_n: f64) {
        self.ticks += 1;
        for (change, before) in changes.into_iter().zip(before) {
            self.squares += (change * change) as f64;
            self.reversals += u64::from(change * before < 0);
        }
        let deviation_n = normal_force_n - self.mean_force_n;
        self.mean_force_n += deviation_n / self.ticks as f64;
        self.force_squares_n2 += deviation_n * (normal_force_n - self.mean_force_n);
    }
}

impl Smoothness {
    /// Starts for a controller of this rate, Hz.
    pub fn new(tick_hz: f64) -> Self {
        Self {
            moving: Roughness::default(),
            holding: Roughness::default(),
            tick_hz,
            moves: false,
            way: None,
            rest_ticks: 0,
            last: None,
        }
    }

    /// Adds a tick with the controller's answer, if it arrived, and the normal force at its end, N.
    #[inline]
    pub fn add(&mut self, answer: Option<&ActuatorFrame>, normal_force_n: f64) {
        let Some(answer) = answer else {
            // A reference that stands does not move because a frame is lost.
            self.last = None;
            if let Some((_, ticks)) = &mut self.way {
                *ticks += 1;
            }
            return;
        };
        if answer.supervisor_state() != Some(SupervisorState::Tracking) {
            self.last = None;
            self.rest_ticks = 0;
            self.moves = false;
            self.way = None;
            return;
        }
        let here = answer.reference_tip;
        let (from, ticks) = self
            .way
            .map_or((here, 0), |(from, ticks)| (from, ticks + 1));
        let time_s = f64::from(ticks) / self.tick_hz;
        self.way = Some((from, ticks));
        if time_s >= VELOCITY_S {
            self.moves = (here.to_metres() - from.to_metres()).abs() > MOVING_M_S * time_s;
            self.way = Some((here, 0));
        }
        let mut changes = [0; 2];
        if let Some((last, before)) = &self.last {
            for (joint, change) in changes.iter_mut().enumerate() {
                *change = i64::from(answer.torques[joint].0) - i64::from(last.torques[joint].0);
            }
            if self.moves {
                self.rest_ticks = 0;
                self.moving.add(changes, *before, normal_force_n);
            } else {
                self.rest_ticks += 1;
                if self.rest_ticks as f64 > SETTLING_S * self.tick_hz {
                    self.holding.add(changes, *before, normal_force_n);
                }
            }
        }
        self.last = Some((*answer, changes));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_shared::counts::TorqueCounts;

    fn answer(torques: [i32; 2], reference_um: i32) -> ActuatorFrame {
        ActuatorFrame {
            torques: torques.map(TorqueCounts),
            reference_tip: Micrometres(reference_um),
            state: SupervisorState::Tracking as u8,
            ..Default::default()
        }
    }

    /// One micrometre in one tick at 10 kHz is 10 mm/s.
    #[test]
    fn a_reference_that_creeps_stands_at_every_rate() {
        for ticks_per_ms in [1, 2, 5, 10] {
            let mut smoothness = Smoothness::new(1000.0 * f64::from(ticks_per_ms));
            for tick in 0..2000 * ticks_per_ms {
                let creep_um = tick / (4 * ticks_per_ms);
                smoothness.add(Some(&answer([tick % 2, 0], creep_um)), 10.0);
            }
            assert_eq!(smoothness.moving.torque_change_counts(), None);
            assert!(smoothness.holding.reversals().is_some(), "{ticks_per_ms}");
        }
    }

    #[test]
    fn a_torque_that_alternates_reverses_at_every_change() {
        let mut smoothness = Smoothness::new(1000.0);
        for tick in 0..2001 {
            let torque = if tick % 2 == 0 { 3 } else { -1 };
            // The force that rises after landing is no ripple.
            let landing_n = if tick < 400 { -5.0 } else { 0.0 };
            let normal_force_n = 10.0 + f64::from(torque - 1) + landing_n;
            smoothness.add(Some(&answer([torque, 7], 0)), normal_force_n);
        }
        let Smoothness {
            moving, holding, ..
        } = smoothness;
        assert_eq!(moving.torque_change_counts(), None);
        assert!((holding.torque_change_counts().unwrap() - 8.0_f64.sqrt()).abs() < 1e-9);
        assert!((holding.reversals().unwrap() - 0.5).abs() < 1e-3);
        assert!((holding.force_ripple_n().unwrap() - 2.0).abs() < 1e-9);
    }

    #[test]
    fn a_reference_stands_across_lost_frames_and_not_across_another_state() {
        let held = |last_state| {
            let mut smoothness = Smoothness::new(1000.0);
            for tick in 0..2000 {
                let frame = answer([tick % 2, 0], 0);
                smoothness.add((tick % 100 != 50).then_some(&frame), 10.0);
            }
            let before = smoothness.holding.ticks;
            let frame = answer([0; 2], 0);
            smoothness.add(last_state, 10.0);
            for _ in 0..300 {
                smoothness.add(Some(&frame), 10.0);
            }
            (before, smoothness.holding.ticks - before)
        };
        let mut retreating = answer([0; 2], 0);
        retreating.state = SupervisorState::LiftOff as u8;
        // Without the first tick, the 20 that are lost and the 20 after them; the reference settles for 500.
        let standing = 2000 - 1 - 40 - 500;
        assert_eq!(held(None), (standing, 299));
        assert_eq!(held(Some(&retreating)), (standing, 0));
    }

    #[test]
    fn a_ramp_moves_and_ticks_without_an_answer_count_nowhere() {
        let mut smoothness = Smoothness::new(1000.0);
        for tick in 0..100 {
            let frame = answer([tick, -tick], 10 * tick);
            smoothness.add((tick != 50).then_some(&frame), 10.0);
        }
        let Smoothness {
            moving, holding, ..
        } = smoothness;
        assert_eq!(moving.ticks, 97);
        assert_eq!(holding.ticks, 0);
        assert_eq!(moving.torque_change_counts(), Some(1.0));
        assert_eq!(
            (moving.reversals(), moving.force_ripple_n()),
            (Some(0.0), Some(0.0))
        );
    }
}
