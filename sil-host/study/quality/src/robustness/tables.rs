//! Tables of runs made by hand, so that a change of the controller does not change the snapshots.

use crate::plain;
use painleve_shared::Posture;

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
        tolerance_m: 1e-3,
        to_edge_m: 0.05,
        p_ratio: 0.6,
        false_alarms: u32::from(ending == Ending::LiftOff),
        slid_s: if is_captured { 360.0 } else { 0.0 },
        torque_change_moving_nm: Some(0.01 * number),
        torque_change_holding_nm: Some(0.02 * number),
        force_ripple_n: is_captured.then_some(0.03),
        tip_t_m: 0.1,
        target_m: 0.1 + error_m,
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
        Arms::Paper,
        7,
        Criterion::InPlace,
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
