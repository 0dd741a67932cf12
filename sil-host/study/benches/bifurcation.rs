//! Cost of a cell of the bifurcation diagram, with a quarter, half and all of the cells:
//! the cost is linear if the throughput is the same.
//!
//! One element is one cell. The durations are shortened (5 s of transient, 1 s recorded instead of
//! 250 s and 50 s).

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use painleve_plant::mechanics::PlantParameters;
use painleve_study_core::initial::Initial;
use painleve_study_core::{Grid, Study, rows};
use painleve_study_paper::bifurcation::Bifurcation;
use painleve_study_paper::cells::{Cells, RELATIVE_TOLERANCE};

fn study(v_belt: &str) -> Bifurcation {
    let values = |text: &str| {
        let grid: Grid = text.parse().expect("a grid");
        grid.values().to_vec()
    };
    let cells = Cells {
        plant: PlantParameters::default(),
        relative_tolerance: RELATIVE_TOLERANCE,
        mu: values("0.1:1:0.1"),
        v_belt_m_s: values(v_belt),
        initial: vec![Initial::A],
        seed: 1,
        transient_s: 5.0,
        record_s: 1.0,
    };
    Bifurcation { cells }
}

fn diagram(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bifurcation");
    group.sample_size(10);
    for v_belt in ["-1:-0.1:0.02", "-1:-0.1:0.01", "-1:-0.1:0.005"] {
        let study = study(v_belt);
        group.throughput(Throughput::Elements(study.len() as u64));
        let cells = format!("{} cells", study.len());
        group.bench_function(BenchmarkId::from_parameter(cells), |bencher| {
            bencher.iter(|| rows(&study, || ()).expect("every cell can be computed"));
        });
    }
    group.finish();
}

criterion_group!(benches, diagram);
criterion_main!(benches);
