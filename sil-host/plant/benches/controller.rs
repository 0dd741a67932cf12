//! Cost of a controller tick on this machine, in the loop with its plant.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use painleve_plant::Controller;
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;

fn ticks(criterion: &mut Criterion) {
    for name in built_in::names() {
        let scenario = Scenario::load(name, &[]).expect("built in");
        let configuration = scenario.controller_configuration();

        // Frames of a real run, played forwards and backwards with running counters, so that no
        // joint jumps.
        let mut simulation = Simulation::new(&scenario).expect("built in");
        let mut controller = Controller::new(&configuration).expect("built in");
        let mut frames = Vec::new();
        for _ in 0..2000 {
            let frame = simulation.sample(&mut ()).expect("runs");
            let answer = controller.tick(&frame);
            simulation.advance(Some(&answer), &mut ()).expect("runs");
            frames.push(frame);
        }
        let mut sequence = 2000_u32;
        criterion.bench_function(&format!("tick/{name}"), |bencher| {
            bencher.iter(|| {
                let place = sequence as usize % 2000;
                let mut frame = frames[if place < 1000 { 1999 - place } else { place }];
                frame.sequence = sequence;
                sequence = sequence.wrapping_add(1);
                controller.tick(black_box(&frame))
            });
        });
    }

    let scenario = Scenario::load(built_in::DEFAULT, &[]).expect("built in");
    criterion.bench_function("closed loop in one process, 1 s", |bencher| {
        bencher.iter(|| {
            let simulation = Simulation::new(&scenario).expect("built in");
            let host = InProcess::new(&scenario.controller_configuration()).expect("built in");
            let mut closed_loop = ClosedLoop::new(simulation, host);
            for _ in 0..1000 {
                closed_loop.tick(&mut ()).expect("runs");
            }
            closed_loop.finish().0.log_hash
        });
    });
}

criterion_group!(benches, ticks);
criterion_main!(benches);
