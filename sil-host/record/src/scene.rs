//! The arm on its belt as Foxglove's 3-D panel shows it: `foxglove.FrameTransforms` and
//! `foxglove.SceneUpdate` as JSON.
//!
//! Frames, each a child of the one before: `world` (z up), `belt` (x along the belt, z away from it,
//! below the first joint), `shoulder`, `link_1`, `link_2`, `tip`. A link lies on the negative z axis
//! of its frame.

use painleve_plant::scenario::Scenario;
use painleve_shared::ArmParameters;
use serde_json::{Value, json};

use crate::messages::nanoseconds;
use crate::recorder::RecordedTick;

/// Rate of the scene, Hz. Where there are fewer ticks, each has a picture.
const RATE_HZ: u64 = 60;
/// Stripes painted across the belt, which show that it moves.
const STRIPES: i32 = 12;
/// Length of the force arrow, m for 1 N.
const ARROW_M_PER_N: f64 = 0.01;
const LINK_DIAMETER_M: f64 = 0.016;
const BELT_WIDTH_M: f64 = 0.12;
const BELT_THICKNESS_M: f64 = 0.006;

/// Draws the scene at some of a run's ticks.
#[derive(Clone, Debug)]
pub struct Scene {
    arm: ArmParameters<f64>,
    tick_hz: u64,
    tick: u64,
    /// Distance that the belt has moved, m, and when it was last updated, s.
    travel_m: f64,
    last_s: Option<f64>,
}

/// One picture of the scene.
#[derive(Clone, Debug)]
pub struct Picture {
    /// A `foxglove.FrameTransforms` message.
    pub transforms: Value,
    /// A `foxglove.SceneUpdate` message.
    pub scene: Value,
}

impl Scene {
    /// Creates the scene of a scenario's arm.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            arm: scenario.arm,
            tick_hz: scenario.run.tick_hz.into(),
            tick: 0,
            travel_m: 0.0,
            last_s: None,
        }
    }

    /// Receives a tick; returns a picture 60 times a second on average.
    pub fn tick(&mut self, tick: &RecordedTick<'_>) -> Option<Picture> {
        self.advance(tick);
        let is_due = is_due(self.tick, self.tick_hz);
        self.tick += 1;
        is_due.then(|| self.picture(tick))
    }

    /// Moves the belt to a tick.
    pub fn advance(&mut self, tick: &RecordedTick<'_>) {
        let plant = &tick.sample.plant;
        let elapsed_s = plant.time_s - self.last_s.unwrap_or(plant.time_s);
        // Unknown on a real arm.
        if plant.belt_speed_m_s.is_finite() {
            self.travel_m += plant.belt_speed_m_s * elapsed_s;
        }
        self.last_s = Some(plant.time_s);
    }

    /// Draws the tick to which the belt was last [advanced](Self::advance).
    pub fn picture(&self, tick: &RecordedTick<'_>) -> Picture {
        let plant = &tick.sample.plant;
        let time = timestamp(plant.time_s);
        let [length_1, length_2] = self.arm.link_length_m;
        let [theta_1, theta_2] = plant.theta_rad.to_array();
        let transform = |parent: &str, child: &str, at: [f64; 3], about_y: f64| {
            json!({
                "timestamp": time,
                "parent_frame_id": parent,
                "child_frame_id": child,
                "translation": vector(at),
                "rotation": about_y_axis(about_y),
            })
        };
        let transforms = json!({ "transforms": [
            transform("world", "belt", [0.0; 3], -self.arm.belt_tilt_rad),
            transform("belt", "shoulder", [0.0, 0.0, self.arm.height_m], 0.0),
            transform("shoulder", "link_1", [0.0; 3], -theta_1),
            transform("link_1", "link_2", [0.0, 0.0, -length_1], theta_1 - theta_2),
            // Parallel to the belt again.
            transform("link_2", "tip", [0.0, 0.0, -length_2], theta_2),
        ]});
        let entities = [
            entity(&time, "link_1", "link_1", link(length_1)),
            entity(&time, "link_2", "link_2", link(length_2)),
            entity(&time, "belt", "belt", self.belt()),
            entity(&time, "force", "tip", force(plant)),
            entity(&time, "edges", "belt", edges(tick)),
        ];
        let scene = json!({ "deletions": [], "entities": entities });
        Picture { transforms, scene }
    }

    fn belt(&self) -> Primitives {
        let reach_m: f64 = self.arm.link_length_m.iter().sum();
        let (length_m, spacing_m) = (2.0 * reach_m, 2.0 * reach_m / f64::from(STRIPES));
        let mut cubes = vec![cube(
            [0.0, 0.0, -0.5 * BELT_THICKNESS_M],
            [length_m, BELT_WIDTH_M, BELT_THICKNESS_M],
            colour([0.25, 0.27, 0.30], 1.0),
        )];
        cubes.extend((0..STRIPES).map(|stripe| {
            let x = (f64::from(stripe) * spacing_m + self.travel_m).rem_euclid(length_m);
            cube(
                [x - 0.5 * length_m, 0.0, -0.5 * BELT_THICKNESS_M],
                [0.006, 1.001 * BELT_WIDTH_M, 1.1 * BELT_THICKNESS_M],
                colour([0.85, 0.75, 0.35], 1.0),
            )
        }));
        Primitives {
            cubes,
            ..Primitives::default()
        }
    }
}

/// Returns whether a tick is the first in a period of the scene.
fn is_due(tick: u64, tick_hz: u64) -> bool {
    tick * RATE_HZ % tick_hz < RATE_HZ
}

/// Primitives of one entity.
#[derive(Default)]
struct Primitives {
    arrows: Vec<Value>,
    cubes: Vec<Value>,
    spheres: Vec<Value>,
    cylinders: Vec<Value>,
    lines: Vec<Value>,
}

fn link(length_m: f64) -> Primitives {
    Primitives {
        cylinders: vec![json!({
            "pose": pose([0.0, 0.0, -0.5 * length_m], 0.0),
            "size": vector([LINK_DIAMETER_M, LINK_DIAMETER_M, length_m]),
            "bottom_scale": 1.0,
            "top_scale": 1.0,
            "color": colour([0.10, 0.44, 0.70], 1.0),
        })],
        spheres: vec![json!({
            "pose": pose([0.0; 3], 0.0),
            "size": vector([1.5 * LINK_DIAMETER_M; 3]),
            "color": colour([0.15, 0.15, 0.15], 1.0),
        })],
        ..Primitives::default()
    }
}

/// The belt's force on the tip, as an arrow that starts there.
fn force(plant: &painleve_plant::Snapshot) -> Primitives {
    let force_n = plant.tangential_force_n.hypot(plant.normal_force_n);
    // At an impact without collision the force is unbounded; the length of the arrow is limited.
    let length_m = (ARROW_M_PER_N * force_n).min(1.0);
    if !length_m.is_finite() || length_m <= 1e-6 {
        return Primitives::default();
    }
    // Arrows point along x; a turn about y by φ takes x to (cos φ, 0, −sin φ).
    let about_y = -plant.normal_force_n.atan2(plant.tangential_force_n);
    Primitives {
        arrows: vec![json!({
            "pose": pose([0.0; 3], about_y),
            "shaft_length": 0.8 * length_m,
            "shaft_diameter": 0.006,
            "head_length": 0.2 * length_m,
            "head_diameter": 0.014,
            "color": colour([0.84, 0.37, 0.0], 1.0),
        })],
        ..Primitives::default()
    }
}

/// Lines across the belt: the edges of the admissible stretch, and the reference.
fn edges(tick: &RecordedTick<'_>) -> Primitives {
    let edges_m = tick.estimates.map_or([f32::NAN; 2], |now| now.edges_m);
    let red = colour([0.80, 0.10, 0.10], 1.0);
    let orange = colour([0.90, 0.62, 0.0], 1.0);
    let [lower, upper] = edges_m.map(f64::from);
    let reference = tick.sample.reference_tip_t_m;
    Primitives {
        lines: [(lower, &red), (upper, &red), (reference, &orange)]
            .into_iter()
            .filter(|(x, _)| x.is_finite() && x.abs() < 100.0)
            .map(|(x, colour)| {
                let half = 0.5 * BELT_WIDTH_M;
                json!({
                    "type": 0,
                    "pose": pose([x, 0.0, 0.001], 0.0),
                    "thickness": 0.004,
                    "scale_invariant": false,
                    "points": [vector([0.0, -half, 0.0]), vector([0.0, half, 0.0])],
                    "color": colour,
                    "colors": [],
                    "indices": [],
                })
            })
            .collect(),
        ..Primitives::default()
    }
}

fn entity(time: &Value, id: &str, frame: &str, primitives: Primitives) -> Value {
    json!({
        "timestamp": time,
        "frame_id": frame,
        "id": id,
        "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": true,
        "metadata": [],
        "arrows": primitives.arrows,
        "cubes": primitives.cubes,
        "spheres": primitives.spheres,
        "cylinders": primitives.cylinders,
        "lines": primitives.lines,
        "triangles": [],
        "texts": [],
        "models": [],
    })
}

fn cube(at: [f64; 3], size: [f64; 3], colour: Value) -> Value {
    json!({ "pose": pose(at, 0.0), "size": vector(size), "color": colour })
}

fn timestamp(time_s: f64) -> Value {
    let time_ns = nanoseconds(time_s);
    json!({ "sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000 })
}

fn vector([x, y, z]: [f64; 3]) -> Value {
    json!({ "x": x, "y": y, "z": z })
}

fn about_y_axis(angle_rad: f64) -> Value {
    let (sine, cosine) = (0.5 * angle_rad).sin_cos();
    json!({ "x": 0.0, "y": sine, "z": 0.0, "w": cosine })
}

fn pose(at: [f64; 3], about_y: f64) -> Value {
    json!({ "position": vector(at), "orientation": about_y_axis(about_y) })
}

fn colour([r, g, b]: [f64; 3], a: f64) -> Value {
    json!({ "r": r, "g": g, "b": b, "a": a })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scene_has_its_rate_at_any_rate_of_ticks() {
        for tick_hz in [10, 59, 60, 61, 100, 1000, 1024, 100_000] {
            let ticks = 0..10 * tick_hz;
            let pictures = ticks.filter(|tick| is_due(*tick, tick_hz)).count();
            assert_eq!(pictures as u64, 10 * tick_hz.min(RATE_HZ), "{tick_hz} Hz");
            assert!(is_due(0, tick_hz));
        }
    }
}
