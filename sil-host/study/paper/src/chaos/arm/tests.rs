//! The deviation of the arm's motion, compared with neighbouring motions and with Liouville's theorem.

use nalgebra::Matrix4;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::impact::Restitution;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::mechanics::{ArmOnBelt, PlantParameters, SolverSettings};
use painleve_plant::statistics::Statistics;
use painleve_shared::{Arm, ArmParameters, Pose, Posture};

use super::*;

/// The deviation of a run, and the sequence of its modes.
struct TangentAndModes {
    tangent: ArmTangent,
    modes: Vec<ContactMode>,
}

impl ArmProbe for TangentAndModes {
    fn step(&mut self, step: &ArmStep<'_>) {
        self.tangent.step(step);
        if self.modes.last() != Some(&step.mode) {
            self.modes.push(step.mode);
        }
    }

    fn event(&mut self, time_s: f64, event: Event, state: &State) {
        self.tangent.event(time_s, event, state);
    }
}

fn accurate() -> PlantParameters {
    PlantParameters {
        solver: SolverSettings {
            relative_tolerance: 1e-12,
            absolute_tolerance: 1e-13,
            ..SolverSettings::default()
        },
        ..PlantParameters::default()
    }
}

/// Returns the final state of a run of `duration_s`, and its deviation.
fn run(
    parameters: &PlantParameters,
    start: State,
    direction: State,
    duration_s: f64,
) -> (State, State, Vec<ContactMode>) {
    let mut plant = ArmOnBelt::new(parameters, start).unwrap();
    let mut probe = TangentAndModes {
        tangent: ArmTangent::new(parameters.impact, Tangent::along(direction)),
        modes: Vec::new(),
    };
    plant.advance(duration_s, &mut probe).unwrap();
    let deviation = probe.tangent.tangent().deviation();
    (*plant.state(), deviation, probe.modes)
}

/// Checks that the deviation is the difference of neighbours that start at `start(±ε)`, over 2ε.
fn assert_as_neighbours(
    parameters: &PlantParameters,
    start: impl Fn(f64) -> State,
    duration_s: f64,
    tolerance: f64,
) -> Vec<ContactMode> {
    let epsilon = 1e-7;
    let direction = (start(1e-4) - start(-1e-4)) / 2e-4;
    let (_, deviation, modes) = run(parameters, start(0.0), direction, duration_s);
    let end = |offset: f64| run(parameters, start(offset), direction, duration_s).0;
    let expected = (end(epsilon) - end(-epsilon)) / (2.0 * epsilon);
    let error = (deviation - expected).norm() / expected.norm();
    assert!(
        error < tolerance,
        "{deviation} instead of {expected}, {modes:?}"
    );
    modes
}

/// Returns a state of the bouncing arm, in flight.
fn bouncing(parameters: &PlantParameters) -> State {
    let initial = State::new(32_f64.to_radians(), 18.27_f64.to_radians(), 0.0, 0.0);
    let mut plant = ArmOnBelt::new(parameters, initial).unwrap();
    plant.advance(1.0, &mut ()).unwrap();
    while plant.motion().gap_m(plant.state()) < 1e-3 {
        plant.advance(plant.time_s() + 1e-3, &mut ()).unwrap();
    }
    *plant.state()
}

#[test]
fn the_deviation_matches_neighbours_across_bounces() {
    for speed_m_s in [-0.4, -0.5] {
        let parameters = PlantParameters {
            belt: BeltProfile::Constant { speed_m_s },
            ..accurate()
        };
        let state = bouncing(&parameters);
        for direction in [
            State::new(1.0, -0.5, 3.0, 2.0),
            State::new(0.0, 1.0, 0.0, -4.0),
        ] {
            assert_as_neighbours(&parameters, |s| state + direction * s, 1.0, 1e-4);
        }
    }
}

/// Returns states with the tip sliding along the belt from `tip_t_m` at `tip_speed_m_s`.
fn on_belt(parameters: &PlantParameters, tip_t_m: f64, tip_speed_m_s: f64) -> State {
    let arm = Arm::new(parameters.arm).unwrap();
    let theta = arm.link_angles_on_belt_rad(tip_t_m, Posture::ElbowDown);
    let rates = arm.link_rates_on_belt_rad_s(tip_t_m, tip_speed_m_s, Posture::ElbowDown);
    let theta = theta.unwrap();
    State::new(theta.first(), theta.second(), rates.first(), rates.second())
}

/// Slip stops, the tip sticks to the belt until friction no longer holds it, and slides back.
#[test]
fn the_deviation_matches_neighbours_across_sticking() {
    let parameters = PlantParameters {
        belt: BeltProfile::Constant { speed_m_s: -0.02 },
        friction: 0.3,
        ..accurate()
    };
    let start = |s: f64| on_belt(&parameters, -0.1 + 0.3 * s, 0.1 + s);
    for (duration_s, expected) in [(0.3, ContactMode::Stick), (1.4, ContactMode::SlideNegative)] {
        let modes = assert_as_neighbours(&parameters, start, duration_s, 1e-4);
        assert!(modes.contains(&expected), "{modes:?}");
    }
}

/// Infinitely many impacts that end in sliding.
#[test]
fn the_deviation_matches_neighbours_across_chatter() {
    for restitution in [0.1, 0.5] {
        let mut parameters = accurate();
        parameters.friction = 0.2;
        parameters.impact = ImpactLaw {
            law: Restitution::Energetic,
            restitution,
        };
        let dropped = |s: f64| {
            let mut state = on_belt(&parameters, -0.15, 0.0);
            state[0] -= 0.05 + s;
            state[3] += 2.0 * s;
            state
        };
        let modes = assert_as_neighbours(&parameters, dropped, 1.0, 1e-3);
        assert_eq!(modes.first(), Some(&ContactMode::Flight));
        assert!(
            modes.len() > 1 && modes.last() != Some(&ContactMode::Flight),
            "{modes:?}"
        );
    }
}

/// Without friction, damping and loss the arm is a Hamiltonian system, impacts included: the
/// volume in angles and momenta is constant.
#[test]
fn a_conservative_arm_keeps_the_volume_of_deviations() {
    let parameters = PlantParameters {
        arm: ArmParameters {
            damping_nms_rad: [0.0; 2],
            ..ArmParameters::default()
        },
        friction: 0.0,
        impact: ImpactLaw {
            law: Restitution::Poisson,
            restitution: 1.0,
        },
        ..accurate()
    };
    let start = State::new(40_f64.to_radians(), 10_f64.to_radians(), 0.0, 0.0);
    let ends = [0, 1, 2, 3].map(|axis| {
        let direction = State::from_fn(|row, _| if row == axis { 1.0 } else { 0.0 });
        run(&parameters, start, direction, 2.0)
    });
    let arm = Arm::new(parameters.arm).unwrap();
    // Momenta are M θ̇: the determinant of M converts between rates and momenta.
    let inertia = |state: &State| arm.mass_matrix(&Pose::new(&theta(state))).determinant();
    let rates = Matrix4::from_columns(&ends.clone().map(|(_, deviation, _)| deviation));
    let volume = rates.determinant() * inertia(&ends[0].0) / inertia(&start);
    assert!((volume - 1.0).abs() < 1e-5, "{volume}");
    let mut plant = ArmOnBelt::new(&parameters, start).unwrap();
    let mut statistics = Statistics::new(0.0);
    plant.advance(2.0, &mut statistics).unwrap();
    assert!(statistics.impacts >= 2);
}
