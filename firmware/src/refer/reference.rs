//! The reference position of the tip: a sequence of segments along the belt.
//!
//! Each segment starts where the previous one ended; after the last one the reference stands still.
//! Time is counted in ticks, so it does not drift; a tick whose frame is lost does not count.

use heapless::Vec;
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::settings;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape, check_each};
use serde::{Deserialize, Serialize};

/// Largest number of segments in a program.
pub const MAXIMUM_SEGMENTS: usize = 16;

/// Largest number of segments that end in one tick: one that has lasted, and two without duration.
pub const MOST_ENDS: usize = 3;

settings! {
    /// One piece of the reference z_t*(t). The longest duration is still countable at the highest control rate.
    #[derive(Copy)]
    pub enum Segment {
        /// Stand still.
        "hold" => Hold {
            /// Duration of the pause.
            duration_s: f32, 0.0..=1e4, "s";
        },
        /// Jump to the target and stand there.
        "step" => Step {
            /// Target z_t; without the governor, within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// Duration of the pause at the target.
            duration_s: f32, 0.0..=1e4, "s";
        },
        /// Move to the target at constant speed.
        "ramp" => Ramp {
            /// Target z_t; without the governor, within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// Duration of the motion.
            duration_s: f32, 0.0..=1e4, "s";
        },
        /// Move with minimum jerk from rest to rest, 10 s³ − 15 s⁴ + 6 s⁵ (Flash and Hogan 1985).
        "minimum-jerk" => MinimumJerk {
            /// Target z_t; without the governor, within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// Duration of the motion.
            duration_s: f32, 0.0..=1e4, "s";
        },
    }
}

impl Segment {
    /// Returns the duration of the segment, s.
    pub fn duration_s(&self) -> f32 {
        match *self {
            Self::Hold { duration_s }
            | Self::Step { duration_s, .. }
            | Self::Ramp { duration_s, .. }
            | Self::MinimumJerk { duration_s, .. } => duration_s,
        }
    }

    /// Returns the end of the segment, m; `None` if it ends where it started.
    pub fn target_m(&self) -> Option<f32> {
        match *self {
            Self::Hold { .. } => None,
            Self::Step { target_m, .. }
            | Self::Ramp { target_m, .. }
            | Self::MinimumJerk { target_m, .. } => Some(target_m),
        }
    }
}

/// The segments of the reference, which start at every arming.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Program {
    /// Segments, in order.
    pub segments: Vec<Segment, MAXIMUM_SEGMENTS>,
}

impl Program {
    /// Returns a move to the paper's limit elbow down, 0.148 m, in three seconds.
    pub fn to_the_papers_limit() -> Self {
        let segment = Segment::MinimumJerk {
            target_m: 0.148,
            duration_s: 3.0,
        };
        Self {
            segments: [segment].into_iter().collect(),
        }
    }

    /// Checks that every target is within `reach_m` of the point of the belt under the first joint.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first target that is out of reach.
    pub fn check_reach(&self, reach_m: f32) -> Result<(), OutOfRange> {
        let reach = f64::from(reach_m);
        for (index, segment) in self.segments.iter().enumerate() {
            range::check("target_m", segment.target_m().unwrap_or(0.0), -reach, reach)
                .map_err(|error| error.inside(segment.name()).at(index))?;
        }
        Ok(())
    }
}

impl SettingValue for Program {
    const SHAPE: Shape = Shape::List {
        item: &Segment::SHAPE,
        maximum_length: MAXIMUM_SEGMENTS,
    };

    fn check(&self, bounds: &Bounds, error: &mut OutOfRange) -> Result<(), Refused> {
        check_each(&self.segments, bounds, error)
    }
}

/// The reference at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TipReference {
    /// z_t*, m.
    pub position_m: f32,
    /// ż_t*, m/s.
    pub velocity_m_s: f32,
    /// z̈_t*, m/s².
    pub acceleration_m_s2: f32,
}

impl TipReference {
    /// Stands still at `position_m`.
    pub fn at_rest(position_m: f32) -> Self {
        Self {
            position_m,
            ..Self::default()
        }
    }
}

/// Follows a program tick by tick; initially at the start of its program, at z_t = 0.
#[derive(Clone, Debug, Default)]
pub struct ReferenceGenerator {
    program: Program,
    tick_hz: f32,
    /// Present segment of the program.
    segment: usize,
    /// Position at the start of the segment, m.
    start_m: f32,
    /// Ticks since the start of the segment.
    elapsed_ticks: u32,
    /// Reference at that time, once [prepared](Self::prepare).
    pub(super) next: TipReference,
}

impl ReferenceGenerator {
    /// Makes a generator that follows `program` at `tick_hz` ticks a second.
    pub fn new(program: &Program, tick_hz: f32) -> Self {
        Self {
            program: program.clone(),
            tick_hz,
            ..Self::default()
        }
    }

    /// Starts the program from `start_m` (m).
    pub fn restart(&mut self, start_m: f32) {
        self.segment = 0;
        self.elapsed_ticks = 0;
        self.start_from(start_m);
    }

    /// Starts the present segment from `start_m` (m).
    pub fn start_from(&mut self, start_m: f32) {
        self.start_m = start_m;
        self.next = self.start();
    }

    /// Returns the start of the present segment, at rest: the position to hold before following.
    pub fn start(&self) -> TipReference {
        TipReference::at_rest(self.start_m)
    }

    /// Returns the prepared reference, and advances time by one tick.
    pub fn next_tick(&mut self) -> TipReference {
        self.elapsed_ticks = self.elapsed_ticks.saturating_add(1);
        self.next
    }

    /// Returns whether a tick of the program has passed.
    pub fn has_begun(&self) -> bool {
        self.elapsed_ticks > 0 || self.segment > 0
    }

    /// Returns whether the last segment has ended.
    pub fn is_done(&self) -> bool {
        self.segment >= self.program.segments.len()
    }

    /// Prepares the reference of the next tick. A segment without duration ends at once; of several in a row,
    /// `MOST_ENDS` end per tick.
    #[inline]
    pub fn prepare(&mut self) {
        for _ in 0..MOST_ENDS {
            let Some(segment) = self.program.segments.get(self.segment) else {
                break;
            };
            let duration_ticks = segment.duration_s() * self.tick_hz;
            if (self.elapsed_ticks as f32) < duration_ticks - 0.5 {
                self.next = at(segment, self.start_m, self.elapsed_ticks, self.tick_hz);
                return;
            }
            self.start_m = segment.target_m().unwrap_or(self.start_m);
            self.elapsed_ticks = 0;
            self.segment += 1;
        }
        self.next = self.start();
    }
}

fn at(segment: &Segment, start_m: f32, elapsed_ticks: u32, tick_hz: f32) -> TipReference {
    let (duration_s, target_m) = (segment.duration_s(), segment.target_m().unwrap_or(start_m));
    let distance = target_m - start_m;
    let s = elapsed_ticks as f32 / (duration_s * tick_hz);
    match segment {
        Segment::Hold { .. } | Segment::Step { .. } => TipReference::at_rest(target_m),
        Segment::Ramp { .. } => TipReference {
            position_m: start_m + distance * s,
            velocity_m_s: distance / duration_s,
            acceleration_m_s2: 0.0,
        },
        Segment::MinimumJerk { .. } => {
            let (rest_of_s, s2) = (1.0 - s, s * s);
            let speed = distance / duration_s;
            TipReference {
                position_m: start_m + distance * s2 * s * (10.0 - s * (15.0 - 6.0 * s)),
                velocity_m_s: speed * 30.0 * s2 * rest_of_s * rest_of_s,
                acceleration_m_s2: speed / duration_s * 60.0 * s * rest_of_s * (1.0 - 2.0 * s),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn next_tick(generator: &mut ReferenceGenerator) -> TipReference {
        generator.prepare();
        generator.next_tick()
    }

    fn program(segments: &[Segment]) -> Program {
        Program {
            segments: segments.iter().copied().collect(),
        }
    }

    #[test]
    fn segments_follow_each_other_and_the_last_one_holds() {
        let mut generator = ReferenceGenerator::new(
            &program(&[
                Segment::Hold { duration_s: 0.002 },
                Segment::Ramp {
                    target_m: 0.1,
                    duration_s: 0.004,
                },
                Segment::Step {
                    target_m: -0.1,
                    duration_s: 0.0,
                },
            ]),
            1000.0,
        );
        let positions: std::vec::Vec<f32> = (0..8)
            .map(|_| next_tick(&mut generator).position_m)
            .collect();
        let expected = [0.0, 0.0, 0.0, 0.025, 0.05, 0.075, -0.1, -0.1];
        for (ours, theirs) in positions.iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-7, "{positions:?}");
        }
        assert!(generator.is_done());
    }

    #[test]
    fn a_series_of_segments_without_duration_ends_three_at_a_tick() {
        let step = |target_m| Segment::Step {
            target_m,
            duration_s: 0.0,
        };
        let steps = [0.01, 0.02, 0.03, 0.04, 0.05].map(step);
        let mut generator = ReferenceGenerator::new(&program(&steps), 1000.0);
        let positions: [f32; 4] = core::array::from_fn(|_| next_tick(&mut generator).position_m);
        assert_eq!(positions, [0.03, 0.05, 0.05, 0.05]);
        assert!(generator.is_done());
    }

    #[test]
    fn targets_out_of_reach_are_refused() {
        let hold = Segment::Hold { duration_s: 1.0 };
        let step = Segment::Step {
            target_m: 0.19,
            duration_s: 1.0,
        };
        let program = program(&[hold, step]);
        assert_eq!(program.check_reach(0.19), Ok(()));
        let error = program.check_reach(0.184).unwrap_err();
        assert_eq!(error.key, "1.step.target_m");
    }

    proptest! {
        #[test]
        fn minimum_jerk_is_smooth_and_ends_at_its_target(
            start in -0.18_f32..0.18, target in -0.18_f32..0.18, duration in 0.1_f32..5.0,
        ) {
            let segment = Segment::MinimumJerk { target_m: target, duration_s: duration };
            let mut generator = ReferenceGenerator::new(&program(&[segment]), 1000.0);
            generator.restart(start);
            let mut before = next_tick(&mut generator);
            prop_assert_eq!(before.position_m, start);
            while !generator.is_done() {
                let now = next_tick(&mut generator);
                let slope = (now.position_m - before.position_m) * 1000.0;
                let mean = 0.5 * (now.velocity_m_s + before.velocity_m_s);
                // The tolerance covers the trapezoid's error, jerk · T²/12, and rounding of the
                // positions.
                let jerk = 60.0 * (target - start).abs() / (duration * duration * duration);
                prop_assert!((slope - mean).abs() < jerk * 1e-6 / 12.0 * 1.1 + 1e-3);
                before = now;
            }
            prop_assert!((before.position_m - target).abs() < 1e-6);
            prop_assert!(before.velocity_m_s.abs() < 1e-6);
        }
    }
}
