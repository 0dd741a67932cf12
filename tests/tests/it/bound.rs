//! The cycle bounds of the control interrupt and of the update after it, computed from the machine code of the flashed
//! image, exist, are within the budget, and are those of the documentation.

use painleve_bound::image::Image;
use painleve_bound::report::{Bound, CORE_HZ};
use painleve_tests::image;
use painleve_tests::printed::{self, LastFigure, thousands};

#[test]
fn a_tick_has_bounds_within_the_budget() {
    let budget: serde_json::Value =
        serde_json::from_str(include_str!("../../budget.json")).unwrap();
    let elf = std::fs::read(image()).unwrap();
    let image = Image::of(image(), &elf).unwrap_or_else(|error| panic!("{error}"));
    let bound = Bound::of(&image).unwrap_or_else(|error| panic!("{error}"));
    for (cycles, key) in [
        (bound.control.cycles, "bound_cycles_of_control_interrupt"),
        (bound.update.cycles, "bound_cycles_of_update"),
        (bound.tick_cycles, "bound_cycles_of_tick"),
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
    // The worst tick returns the tip to the belt or follows a law; the worst update searches for the edges.
    for (handler, parts) in [
        (&bound.control, ["estimate::", "refer::", "drive::"]),
        (&bound.update, ["estimate::", "governor::", "drive::"]),
    ] {
        let sum: u32 = handler.path.iter().map(|stretch| stretch.cycles).sum();
        assert!(
            handler.cycles.abs_diff(sum) < 200,
            "the path explains {sum} cycles"
        );
        let functions = handler.path.iter().map(|stretch| &*stretch.function);
        let functions: Vec<&str> = functions.collect();
        for part in parts {
            assert!(
                functions.iter().any(|name| name.contains(part)),
                "{functions:?}"
            );
        }
    }
    let part = |cycles: u32| {
        let microseconds = f64::from(cycles) / CORE_HZ * 1e6;
        format!("{} | {microseconds:.0}", thousands(cycles.into()))
    };
    let tick = bound.tick_cycles;
    let expected = format!(
        "| part | cycles | µs at 168 MHz |\n|---|---|---|\n\
         | the control interrupt: the sensors' counts of the last tick, the answer, the stages | {} |\n\
         | the update after it: slow estimates, edges, the preparation of the next tick, checks, queues | {} |\n\
         | both in a tick | {} |\n\
         | the interrupts that read the sensors for the next tick, two on each channel: every reading disturbed, \
         each read again as often as its driver allows | {} |\n\
         | all: proves up to {} Hz | {} |\n\
         | the sensors' interrupts with one sensor on each channel (`converters.mounting.sensors`) | {} |\n\
         | all with these: proves up to {} Hz | {} |\n",
        part(bound.control.cycles),
        part(bound.update.cycles),
        part(tick),
        part(bound.sensor_cycles_of_both),
        thousands(bound.proves_hz_with_both.into()),
        part(tick + bound.sensor_cycles_of_both),
        part(bound.sensor_cycles),
        thousands(bound.proves_hz.into()),
        part(tick + bound.sensor_cycles),
    );
    printed::check("benchmarks.md", "bound", &expected, LastFigure::Measured);
}
