//! How long a sensor that is stuck at a plausible reading keeps the arm driven, as docs/flashing.md prints it.

use painleve_flash_image::board::F405;
use painleve_flash_image::harm::Harm;
use painleve_tests::printed::{self, LastFigure};

use crate::dead_force_cell;
use crate::hazards::{second_sensors, sensors};

/// The other board runs the same controller in the same ticks.
#[test]
fn a_stuck_sensor_does_what_the_page_says() {
    let rows = [
        (
            "force cell stuck at 0 N",
            dead_force_cell::takes_the_torque_off::<F405>(true),
            second_sensors::stuck::<F405>(true),
        ),
        (
            "force cell stuck at a force",
            dead_force_cell::takes_the_torque_off::<F405>(false),
            second_sensors::stuck::<F405>(false),
        ),
        (
            "encoder of joint 1 frozen",
            sensors::frozen::<F405>(0),
            second_sensors::frozen::<F405>(0),
        ),
        (
            "encoder of the elbow frozen",
            sensors::frozen::<F405>(1),
            second_sensors::frozen::<F405>(1),
        ),
    ];
    let mut table = String::from(
        "| | ticks | tip, mm | turn of a link, ° | normal force, N |\n|---|---|---|---|---|\n",
    );
    for (failure, one, two) in rows {
        table += &row(failure, &one);
        table += &row("the same, two sensors", &two);
    }
    printed::check("flashing.md", "stuck sensors", &table, LastFigure::Measured);
}

fn row(label: &str, harm: &Harm) -> String {
    let Harm {
        ticks,
        turned_deg,
        tip_mm,
        normal_force_n,
        ..
    } = harm;
    format!("| {label} | {ticks} | {tip_mm:.2} | {turned_deg:.2} | {normal_force_n:.1} |\n")
}
