//! Comparison of the paper's Fig. 4 at μ = 0.6 with an independent
//! implementation: from x0,a the arm keeps bouncing at exactly the reference's
//! belt speeds, and from x0,d at none.

use painleve_plant::Event;
use painleve_plant::State;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::{ArmOnBelt, ArmProbe, ArmStep, PlantParameters};

const SECTION: &str = include_str!("../data/open_loop_section_mu06.csv");

/// Largest observed θ̇1, rad/s.
struct Fastest(f64);

impl ArmProbe for Fastest {
    fn step(&mut self, step: &ArmStep<'_>) {
        self.0 = self.0.max(step.end[2]);
    }

    fn event(&mut self, _: f64, _: Event, state: &State) {
        self.0 = self.0.max(state[2]);
    }
}

/// Returns the largest θ̇1 in the last 50 s of 300 s.
fn fastest(speed_m_s: f64, theta1_deg: f64, theta2_deg: f64) -> f64 {
    let parameters = PlantParameters {
        belt: BeltProfile::Constant { speed_m_s },
        ..Default::default()
    };
    let initial = State::new(theta1_deg.to_radians(), theta2_deg.to_radians(), 0.0, 0.0);
    let mut plant = ArmOnBelt::new(&parameters, initial).expect("the paper's arm is valid");
    plant.advance(250.0, &mut ()).expect("the plant continues");
    let mut fastest = Fastest(f64::NEG_INFINITY);
    plant
        .advance(300.0, &mut fastest)
        .expect("the plant continues");
    fastest.0
}

#[test]
fn bouncing_persists_exactly_at_the_reference_speeds() {
    let mut rows = 0;
    for line in SECTION.lines().skip(1) {
        let row: Vec<f64> = line
            .split(',')
            .map(|value| value.parse().unwrap())
            .collect();
        let [speed, from_a, from_d] = row[..] else {
            panic!("bad row {line}");
        };
        // On quiet attractors θ̇1 is zero, on bouncing ones several rad/s.
        let bounces = |theta_dot: f64| theta_dot > 0.1;
        let ours = fastest(speed, 32.0, 18.27);
        assert_eq!(
            bounces(ours),
            bounces(from_a),
            "v_belt = {speed}: {ours} rad/s"
        );
        assert!(!bounces(from_d));
        assert!(
            !bounces(fastest(speed, -11.4, -35.1)),
            "v_belt = {speed} from x0,d"
        );
        rows += 1;
    }
    assert_eq!(rows, 37);
}
