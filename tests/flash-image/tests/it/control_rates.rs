//! Which control rates a board accepts with its own sensors, as docs/flashing.md prints it.

use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_tests::printed::{self, LastFigure};

use crate::hazards::watchdogs::refusal;

/// Each board has one gap. The rates beside the edges are found by trial.
#[test]
fn a_board_accepts_the_control_rates_that_the_page_names() {
    let mut table = String::from("| board | accepts, Hz |\n|---|---|\n");
    table += &row::<F405>("STM32F405", [5000, 5300, 6600, 8000]);
    table += &row::<G474>("NUCLEO-G474RE", [15_000, 17_000, 19_000, 25_000]);
    printed::check("flashing.md", "control rates", &table, LastFigure::Measured);
}

/// `known`: rates of which the second and the last are refused.
fn row<C: BoardChip>(label: &str, known: [u32; 4]) -> String {
    let [below, gap, above, high] = known;
    let edges = [(below, gap), (above, gap), (above, high)];
    let [end, begin, highest] = edges.map(|(accepted, refused)| {
        let hz = last_accepted::<C>(accepted, refused);
        printed::thousands(hz.into())
    });
    format!("| {label} | up to {end}, and {begin} to {highest} |\n")
}

/// Returns the accepted rate, to 0.2 %, next to the edge between an accepted and a refused one.
fn last_accepted<C: BoardChip>(mut accepted: u32, mut refused: u32) -> u32 {
    assert_eq!(refusal::<C>(accepted), None, "{accepted} Hz");
    while accepted.abs_diff(refused) > accepted / 500 {
        let middle = u32::midpoint(accepted, refused);
        let is_accepted = refusal::<C>(middle).is_none();
        *(if is_accepted {
            &mut accepted
        } else {
            &mut refused
        }) = middle;
    }
    accepted
}
