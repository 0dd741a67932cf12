//! Tables of runs made by hand, so that a change of the controller does not change the snapshots.

use crate::plain;
use painleve_shared::Posture;
use painleve_study_core::catalogue::StudyOptions;
use painleve_study_core::tabular::Table;

use super::tests::campaign;
use super::*;

pub(super) fn row(index: usize, ending: Ending, error_m: f64) -> Row {
    let number = index as f64;
    let is_captured = ending != Ending::NotCaptured;
    Row {
        index,
        ending,
        fault: (ending == Ending::Fault).then_some(12),
        capture_s: is_captured.then_some(0.01),
        lift_offs: u64::from(ending == Ending::LiftOff),
        first_lift_off_s: (ending == Ending::LiftOff).then_some(1.5),
        error_m,
        resting_error_m: Some(error_m),
        tolerance_m: 1e-3,
        to_edge_m: (ending == Ending::AtEdge).then_some(0.05),
        p_ratio: 0.6,
        false_alarms: u32::from(ending == Ending::LiftOff),
        slid_s: if is_captured { 360.0 } else { 0.0 },
        torque_change_moving_nm: Some(0.01 * number),
        torque_change_holding_nm: Some(0.02 * number),
        torque_reversals: is_captured.then_some(0.2),
        force_ripple_n: is_captured.then_some(0.03),
        tip_t_m: 0.1,
        target_m: Some(0.1 + error_m),
        posture: Posture::ElbowDown,
        mu: 0.2 + 0.05 * number,
        v_belt_m_s: 0.125 * number - 0.5,
        tick_hz: 500 + 100 * index as u32,
        encoder_bits: 16,
        torque_bits: 12,
        torque_lag_s: 0.0,
        delay_ticks: 1.0,
        force_noise_n: 0.1,
        frame_loss: 0.0,
        link_length_m: 0.21,
        link_2_length_m: 0.21,
        link_mass_kg: 0.2,
        link_2_mass_kg: 0.2,
        stiffness_nm_rad: 0.5,
        height_m: 0.3775,
        belt_tilt_rad: 0.0,
    }
}

pub(crate) fn rows(endings: &[(Ending, f64)]) -> Vec<Row> {
    let rows = endings.iter().enumerate();
    rows.map(|(index, &(ending, error_m))| row(index, ending, error_m))
        .collect()
}

#[test]
fn every_ending_is_counted_and_the_most_severe_come_first() {
    let found = RobustnessOutcome::new(
        &campaign(1),
        rows(&[
            (Ending::Reached, 1e-4),
            (Ending::LiftOff, 0.02),
            (Ending::AtEdge, 2e-4),
            (Ending::NotReached, 0.004),
            (Ending::LiftOff, 0.03),
            (Ending::Fault, 0.1),
            (Ending::NotCaptured, 0.05),
            (Ending::Reached, 1e-4),
            (Ending::StoppedEarly, 3e-4),
            (Ending::Unsolved, 0.0),
        ]),
    );
    insta::assert_snapshot!(plain(&found));
}

#[test]
fn a_tip_that_no_edge_holds_is_left_out_of_the_distances_before_the_edge() {
    let mut rows = rows(&[(Ending::AtEdge, 1e-4), (Ending::AtEdge, 1e-4)]);
    rows[1].to_edge_m = None;
    let found = RobustnessOutcome::new(&campaign(2), rows);
    assert_eq!(found.success.successes, 2);
    assert_eq!(found.place.to_edge_m.map(|values| values.count), Some(1));
    let table = plain(&found);
    assert!(table.contains("2, 1 of them before p = 0"), "{table}");
}

#[test]
fn the_command_that_repeats_a_run_has_the_changes_of_the_study() {
    let study = Robustness {
        arms: Arms::General,
        overrides: vec!["controller.reference=[]".into(), "name=it's".into()],
        ..campaign(1)
    };
    let rows = rows(&[(Ending::Fault, 0.1)]);
    let table = plain(&Options::outcome(&study, rows));
    let command = "painleve run --replay 1:INDEX --arms general --set 'controller.reference=[]' --set 'name=it'\\''s'";
    assert!(table.contains(command), "{table}");
}

#[test]
fn no_runs_slide_for_no_time() {
    let found = plain(&Options::outcome(&campaign(1), Vec::new()));
    assert!(found.contains("0 in 0.00 h"), "{found}");
}

#[test]
fn a_run_without_a_target_has_an_empty_cell() {
    let study = Robustness {
        overrides: vec!["controller.reference=[]".into()],
        ..campaign(1)
    };
    let found = Table::records(&study, 0).unwrap();
    let place = found.header.iter().position(|name| name == b"target_m");
    assert_eq!(&found.lines[0][place.unwrap()], b"");
}
