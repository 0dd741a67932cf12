//! The paper's Figs. 4 and 5 on a coarse grid: where and how the arm bounces.

use painleve_plant::mechanics::PlantParameters;
use painleve_study_core::initial::Initial;
use painleve_study_core::{Study, rows};
use painleve_study_paper::bifurcation::{Bifurcation, BifurcationDiagram};
use painleve_study_paper::cells::{Cells, RELATIVE_TOLERANCE};
use painleve_study_paper::chaos::Regime;
use painleve_study_paper::poincare::Poincare;

fn cells(mu: &[f64], v_belt_m_s: &[f64], initial: &[Initial]) -> Cells {
    let cells = Cells {
        plant: PlantParameters::default(),
        relative_tolerance: RELATIVE_TOLERANCE,
        mu: mu.to_vec(),
        v_belt_m_s: v_belt_m_s.to_vec(),
        initial: initial.to_vec(),
        seed: 1,
        transient_s: 250.0,
        record_s: 50.0,
    };
    cells.check().expect("the paper's settings are valid");
    cells
}

fn diagram(cells: Cells) -> BifurcationDiagram {
    let study = Bifurcation { cells };
    let rows = rows(&study, || ()).expect("every cell can be computed");
    BifurcationDiagram::new(&study, rows)
}

const FRICTIONS: [f64; 7] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

/// The paper's window is −0.575 … −0.3 for every μ from 0.4 on: bouncing 0.01 inside it, quiet
/// 0.01 outside.
#[test]
#[ignore = "a sweep"]
fn the_window_is_the_papers_for_every_friction_from_04_on() {
    let speeds = [-0.8, -0.6, -0.586, -0.565, -0.45, -0.31, -0.289, -0.2];
    let diagram = diagram(cells(&FRICTIONS, &speeds, &[Initial::A]));
    for window in &diagram.windows {
        assert_eq!(window.v_belt_m_s, [[-0.565, -0.31]], "μ = {}", window.mu);
        assert_eq!((window.bouncing, window.cells), (3, speeds.len()));
        assert_eq!(window.paper_m_s, Some([-0.575, -0.3]));
    }
    for row in &diagram.rows {
        // The paper's measure agrees.
        assert_eq!(row.bouncing, row.max_theta1_dot_rad_s > 1e-6, "{row:?}");
        assert_eq!(row.bouncing, row.contact_fraction < 1.0);
        assert_eq!(row.bouncing, row.impacts_per_s > 0.0 && row.apex_m > 1e-3);
    }
}

#[test]
fn nothing_bounces_below_the_critical_friction_or_from_x0_d() {
    let speeds = [-1.0, -0.55, -0.45, -0.35, -0.1];
    let smooth = diagram(cells(&[0.1, 0.2, 0.3], &speeds, &[Initial::A, Initial::D]));
    assert!(smooth.rows.iter().all(|row| !row.bouncing));
    let elbow_down = diagram(cells(&[0.6, 1.0], &speeds, &[Initial::D]));
    assert!(elbow_down.rows.iter().all(|row| !row.bouncing));
    assert!(
        elbow_down
            .windows
            .iter()
            .all(|window| window.paper_m_s.is_none())
    );
}

/// Periodic and chaotic motion far from all bifurcations; the periods double towards −0.49.
#[test]
fn periodic_and_chaotic_bouncing_are_distinguished() {
    let expected = [
        (-0.56, Regime::Chaotic, None),
        (-0.51, Regime::Periodic, Some(3)),
        (-0.487, Regime::Periodic, Some(4)),
        (-0.475, Regime::Periodic, Some(2)),
        (-0.4, Regime::Chaotic, None),
        (-0.2, Regime::Quiet, None),
    ];
    let speeds = expected.map(|(v_belt, ..)| v_belt);
    let study = Poincare {
        cells: cells(&[0.6], &speeds, &[Initial::A]),
    };
    for (index, (v_belt, regime, period)) in expected.into_iter().enumerate() {
        let row = study.row(index).expect("the row is computed");
        let judged = (row.v_belt_m_s, row.regime, row.period);
        assert_eq!(judged, (v_belt, regime, period), "{:?}", row.exponent_per_s);
        assert_eq!(row.theta1_rad.is_empty(), regime == Regime::Quiet);
    }
}
