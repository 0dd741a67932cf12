//! Where the tip shall be: a queue of segments along the belt.
//!
//! Each segment starts where the one before ended; after the last one the reference
//! stands still. Time is counted in ticks, so that nothing drifts.

use heapless::{Deque, Vec};
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::settings;
use painleve_shared::settings::{Bounds, Refused, SettingValue, Shape, check_each};
use serde::{Deserialize, Serialize};

/// Most segments that fit into the queue.
pub const MAXIMUM_SEGMENTS: usize = 16;

settings! {
    /// One piece of the reference z_t*(t).
    #[derive(Copy)]
    pub enum Segment {
        /// Stand still.
        "hold" => Hold {
            /// How long to stand still.
            duration_s: f32, 0.0..=1e5, "s";
        },
        /// Jump to the target and stand there.
        "step" => Step {
            /// Target z_t; within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// How long to stand there.
            duration_s: f32, 0.0..=1e5, "s";
        },
        /// Move to the target at constant speed.
        "ramp" => Ramp {
            /// Target z_t; within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// How long the motion takes.
            duration_s: f32, 0.0..=1e5, "s";
        },
        /// Move with minimum jerk from rest to rest, 10 s³ − 15 s⁴ + 6 s⁵ (Flash and Hogan 1985).
        "minimum-jerk" => MinimumJerk {
            /// Target z_t; within the arm's reach on the belt.
            target_m: f32, -20.0..=20.0, "m";
            /// How long the motion takes.
            duration_s: f32, 0.0..=1e5, "s";
        },
    }
}

impl Segment {
    /// How long the segment lasts, s.
    pub fn duration_s(&self) -> f32 {
        match *self {
            Self::Hold { duration_s }
            | Self::Step { duration_s, .. }
            | Self::Ramp { duration_s, .. }
            | Self::MinimumJerk { duration_s, .. } => duration_s,
        }
    }

    /// Where the segment ends, m; `None` for where it started.
    pub fn target_m(&self) -> Option<f32> {
        match *self {
            Self::Hold { .. } => None,
            Self::Step { target_m, .. }
            | Self::Ramp { target_m, .. }
            | Self::MinimumJerk { target_m, .. } => Some(target_m),
        }
    }
}

/// The segments a controller starts with.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Program {
    /// In the order in which they are followed.
    pub segments: Vec<Segment, MAXIMUM_SEGMENTS>,
}

impl Program {
    /// The paper's limit elbow down, 0.148 m, in three seconds.
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
    /// [`OutOfRange`] naming the first target that is not.
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

/// The queue is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueFull;

/// Follows the queue of segments tick by tick.
#[derive(Clone, Debug)]
pub struct ReferenceGenerator {
    tick_hz: f32,
    queue: Deque<Segment, MAXIMUM_SEGMENTS>,
    /// Where the present segment started, m.
    start_m: f32,
    /// Ticks since then.
    elapsed_ticks: u32,
}

impl ReferenceGenerator {
    /// A generator that stands at `start_m` and then follows `program`.
    pub fn new(program: &Program, start_m: f32, tick_hz: f32) -> Self {
        let mut generator = Self {
            tick_hz,
            queue: Deque::new(),
            start_m,
            elapsed_ticks: 0,
        };
        generator.restart(program, start_m);
        generator
    }

    /// Stands at `start_m` and then follows `program`. Takes as long as the program has segments.
    pub fn restart(&mut self, program: &Program, start_m: f32) {
        self.start_m = start_m;
        self.elapsed_ticks = 0;
        self.queue.clear();
        for segment in &program.segments {
            // Cannot fail: the queue has the program's capacity.
            let _ = self.queue.push_back(*segment);
        }
    }

    /// Starts the present segment, which has not begun yet, from `start_m` (m).
    pub fn start_from(&mut self, start_m: f32) {
        self.start_m = start_m;
    }

    /// Appends a segment.
    ///
    /// # Errors
    /// [`QueueFull`] if [`MAXIMUM_SEGMENTS`] are waiting already.
    pub fn push(&mut self, segment: Segment) -> Result<(), QueueFull> {
        self.queue.push_back(segment).map_err(|_| QueueFull)
    }

    /// Where the present segment started, at rest: what to hold before following.
    pub fn start(&self) -> TipReference {
        TipReference {
            position_m: self.start_m,
            ..Default::default()
        }
    }

    /// Where the reference has got to, at rest: what to hold while time stands still.
    pub fn present(&self) -> TipReference {
        let position_m = self.queue.front().map_or(self.start_m, |segment| {
            at(segment, self.start_m, self.elapsed_ticks, self.tick_hz).position_m
        });
        TipReference {
            position_m,
            ..Default::default()
        }
    }

    /// Whether the last segment has ended.
    pub fn is_done(&self) -> bool {
        self.queue.is_empty()
    }

    /// The reference of this tick; then time goes on by one tick.
    pub fn next_tick(&mut self) -> TipReference {
        // A segment without duration ends at once, so that several may end in one tick.
        for _ in 0..MAXIMUM_SEGMENTS {
            let Some(segment) = self.queue.front() else {
                break;
            };
            let duration_ticks = segment.duration_s() * self.tick_hz;
            if (self.elapsed_ticks as f32) < duration_ticks - 0.5 {
                let reference = at(segment, self.start_m, self.elapsed_ticks, self.tick_hz);
                self.elapsed_ticks = self.elapsed_ticks.saturating_add(1);
                return reference;
            }
            self.start_m = segment.target_m().unwrap_or(self.start_m);
            self.elapsed_ticks = 0;
            self.queue.pop_front();
        }
        self.start()
    }
}

fn at(segment: &Segment, start_m: f32, elapsed_ticks: u32, tick_hz: f32) -> TipReference {
    let rest = |position_m| TipReference {
        position_m,
        ..Default::default()
    };
    match *segment {
        Segment::Hold { .. } => rest(start_m),
        Segment::Step { target_m, .. } => rest(target_m),
        Segment::Ramp {
            target_m,
            duration_s,
        } => {
            let distance = target_m - start_m;
            let s = elapsed_ticks as f32 / (duration_s * tick_hz);
            TipReference {
                position_m: start_m + distance * s,
                velocity_m_s: distance / duration_s,
                acceleration_m_s2: 0.0,
            }
        }
        Segment::MinimumJerk {
            target_m,
            duration_s,
        } => {
            let distance = target_m - start_m;
            let s = elapsed_ticks as f32 / (duration_s * tick_hz);
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
            0.0,
            1000.0,
        );
        let positions: std::vec::Vec<f32> =
            (0..8).map(|_| generator.next_tick().position_m).collect();
        let expected = [0.0, 0.0, 0.0, 0.025, 0.05, 0.075, -0.1, -0.1];
        for (ours, theirs) in positions.iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-7, "{positions:?}");
        }
        assert!(generator.is_done());
    }

    #[test]
    fn the_queue_is_bounded() {
        let mut generator = ReferenceGenerator::new(&Program::default(), 0.0, 1000.0);
        let hold = Segment::Hold { duration_s: 1.0 };
        for _ in 0..MAXIMUM_SEGMENTS {
            assert_eq!(generator.push(hold), Ok(()));
        }
        assert_eq!(generator.push(hold), Err(QueueFull));
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
            let mut generator = ReferenceGenerator::new(&program(&[segment]), start, 1000.0);
            let mut before = generator.next_tick();
            prop_assert_eq!(before.position_m, start);
            while !generator.is_done() {
                let now = generator.next_tick();
                let slope = (now.position_m - before.position_m) * 1000.0;
                let mean = 0.5 * (now.velocity_m_s + before.velocity_m_s);
                // The trapezoid's error, jerk · T²/12, and rounding of the positions.
                let jerk = 60.0 * (target - start).abs() / (duration * duration * duration);
                prop_assert!((slope - mean).abs() < jerk * 1e-6 / 12.0 * 1.1 + 1e-3);
                before = now;
            }
            prop_assert!((before.position_m - target).abs() < 1e-6);
            prop_assert!(before.velocity_m_s.abs() < 1e-6);
        }
    }
}
