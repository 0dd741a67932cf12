//! Cost of the plant: simulated seconds per CPU second.
//!
//! One element of the throughput is one simulated second.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use painleve_plant::Plant;
use painleve_plant::State;
use painleve_plant::mechanics::belt::BeltProfile;
use painleve_plant::mechanics::compliant::{CompliantArmOnBelt, ContactKind, TipContact};
use painleve_plant::mechanics::effects::Effects;
use painleve_plant::mechanics::{ArmOnBelt, PlantParameters};
use painleve_shared::JointTorque;

fn plant(theta1_deg: f64, theta2_deg: f64) -> ArmOnBelt {
    let parameters = PlantParameters {
        belt: BeltProfile::Constant { speed_m_s: -0.4 },
        ..Default::default()
    };
    let initial = State::new(theta1_deg.to_radians(), theta2_deg.to_radians(), 0.0, 0.0);
    ArmOnBelt::new(&parameters, initial).expect("the paper's arm is valid")
}

fn simulated_seconds(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("plant");
    group.throughput(Throughput::Elements(1));

    // The benchmark in the performance bar: bouncing at v_belt = −0.4 m/s,
    // relative tolerance 1e-9.
    let mut bouncing = plant(32.0, 18.27);
    bouncing.advance(20.0, &mut ()).expect("bounces");
    group.bench_function("open-loop bouncing, 1 s", |bencher| {
        bencher.iter(|| {
            let until_s = bouncing.time_s() + 1.0;
            bouncing.advance(black_box(until_s), &mut ())
        });
    });

    let mut sliding = plant(-11.4, -35.1);
    sliding.advance(20.0, &mut ()).expect("slides");
    group.bench_function("quiet sliding, 1 s", |bencher| {
        bencher.iter(|| {
            let until_s = sliding.time_s() + 1.0;
            sliding.advance(black_box(until_s), &mut ())
        });
    });

    let mut held = plant(-11.4, -35.1);
    group.bench_function("sliding with a torque every 1 ms, 1 s", |bencher| {
        bencher.iter(|| {
            let start_s = held.time_s();
            for tick in 1..=1000 {
                let torque = JointTorque::new(0.01 * f64::from(tick % 7), 0.0);
                held.command_torque(torque, 0.0);
                held.advance(start_s + f64::from(tick) * 1e-3, &mut ())
                    .expect("slides");
            }
        });
    });

    let contact = TipContact {
        kind: ContactKind::Compliant,
        ..Default::default()
    };
    let mut soft = CompliantArmOnBelt::new(
        &PlantParameters::default(),
        &contact,
        &Effects::default(),
        *sliding.state(),
    )
    .expect("the contact's defaults are valid");
    group.bench_function("on 1e5 N/m with a torque every 1 ms, 1 s", |bencher| {
        bencher.iter(|| {
            let start_s = Plant::time_s(&soft);
            for tick in 1..=1000 {
                let torque = JointTorque::new(0.001 * f64::from(tick % 7), 0.0);
                soft.command_torque(torque, 0.0);
                soft.advance(start_s + f64::from(tick) * 1e-3, &mut ())
                    .expect("slides");
            }
        });
    });
    group.finish();
}

criterion_group!(benches, simulated_seconds);
criterion_main!(benches);
