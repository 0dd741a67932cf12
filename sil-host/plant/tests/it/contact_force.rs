//! Checks that in every built-in scenario the belt never pulls at the tip and friction stays in its
//! cone.

use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_plant::{Event, Plant, Probe, Snapshot, State, Step};
use painleve_shared::frame::SensorFrame;

/// Rounding error of forces of some tens of newtons at the limits of contact, N.
const ROUNDING_N: f64 = 1e-6;

/// Checks the contact force at both ends of every step.
struct InCone {
    friction: f64,
    steps: u64,
}

impl InCone {
    fn check(&self, at: &Snapshot) {
        let (normal, tangential) = (at.normal_force_n, at.tangential_force_n);
        assert!(normal >= -ROUNDING_N, "{at:?}");
        let most = self.friction * normal.max(0.0) + ROUNDING_N;
        assert!(tangential.abs() <= most, "{at:?}");
    }
}

impl Probe for InCone {
    fn step(&mut self, step: &dyn Step) {
        self.steps += 1;
        self.check(&step.start());
        self.check(&step.end());
    }

    fn event(&mut self, _: f64, _: Event, _: &State) {}
}

#[test]
fn the_contact_force_never_pulls_and_stays_in_the_friction_cone() {
    for name in built_in::names() {
        let scenario = Scenario::load(name, &["run.duration_s=3".into()]).unwrap();
        let mut probe = InCone {
            friction: scenario.belt.friction,
            steps: 0,
        };
        let mut simulation = Simulation::new(&scenario).unwrap();
        let mut controller =
            painleve_firmware::Controller::new(&scenario.controller_configuration()).unwrap();
        for _ in 0..scenario.run.ticks() {
            let sensor: SensorFrame = simulation.sample(&mut probe).unwrap();
            let answer = controller.tick(&sensor);
            simulation.advance(Some(&answer), &mut probe).unwrap();
        }
        assert!(probe.steps >= scenario.run.ticks(), "{name}");
        assert!(simulation.plant().snapshot().time_s > 2.9, "{name}");
    }
}
