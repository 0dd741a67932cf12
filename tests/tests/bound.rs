//! The cycle bound of the control interrupt, computed from the machine code of the flashed image,
//! exists, is within the budget, and is that of the documentation.

use painleve_bound::report::{Bound, CORE_HZ};
use painleve_tests::flash_image;
use painleve_tests::printed::{self, LastFigure, thousands};

#[test]
fn the_control_interrupt_has_a_bound_within_the_budget() {
    let budget: serde_json::Value = serde_json::from_str(include_str!("../budget.json")).unwrap();
    let bound = Bound::of(flash_image()).unwrap_or_else(|error| panic!("{error}"));
    for (cycles, key) in [
        (bound.cycles, "bound_cycles_of_control_interrupt"),
        (bound.sensor_cycles, "bound_cycles_of_sensor_interrupts"),
        (
            bound.sensor_cycles_of_both,
            "bound_cycles_of_interrupts_of_two_sensors",
        ),
    ] {
        let most = budget[key].as_u64().unwrap();
        assert!(
            u64::from(cycles) <= most,
            "{cycles} cycles are more than the {most} of budget.json:\n{}",
            bound.text(),
        );
    }
    let sum: u32 = bound.path.iter().map(|stretch| stretch.cycles).sum();
    assert!(
        bound.cycles.abs_diff(sum) < 200,
        "the path explains {sum} cycles"
    );
    let functions: Vec<&str> = bound
        .path
        .iter()
        .map(|stretch| &*stretch.function)
        .collect();
    // The worst tick returns the tip to the belt or follows a law.
    for part in ["estimate::", "refer::", "drive::"] {
        assert!(
            functions.iter().any(|name| name.contains(part)),
            "{functions:?}"
        );
    }
    let part = |cycles: u32| {
        let microseconds = f64::from(cycles) / CORE_HZ * 1e6;
        format!("{} | {microseconds:.0}", thousands(cycles.into()))
    };
    let expected = format!(
        "| part | cycles | µs at 168 MHz |\n|---|---|---|\n\
         | the control interrupt: the sensors' counts of the last tick, the controller, the stages | {} |\n\
         | the interrupts that read the sensors for the next tick, two on each channel: every reading disturbed, \
         each read again as often as its driver allows | {} |\n\
         | both: proves up to {} Hz | {} |\n\
         | the sensors' interrupts with one sensor on each channel (`converters.mounting.sensors`) | {} |\n\
         | these and the control interrupt: proves up to {} Hz | {} |\n",
        part(bound.cycles),
        part(bound.sensor_cycles_of_both),
        thousands(bound.proves_hz_with_both.into()),
        part(bound.cycles + bound.sensor_cycles_of_both),
        part(bound.sensor_cycles),
        thousands(bound.proves_hz.into()),
        part(bound.cycles + bound.sensor_cycles),
    );
    printed::check("benchmarks.md", "bound", &expected, LastFigure::Measured);
}
