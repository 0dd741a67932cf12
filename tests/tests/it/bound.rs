//! The cycle bounds of the control interrupt and of the update after it, computed from the machine code of the flashed
//! images, exist, are within the budget, and are those of the documentation.

use painleve_bound::image::Image;
use painleve_bound::report::Bound;
use painleve_tests::image;
use painleve_tests::printed::{self, LastFigure, thousands};

/// Returns the bounds of a board's image, which are within the budget.
fn within_the_budget(name: &str) -> Bound {
    let budget = serde_json::from_str(include_str!("../../budget.json"));
    let budget: serde_json::Value = budget.unwrap_or_else(|error| panic!("{error}"));
    let path = image().with_file_name(name);
    let elf = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let image = Image::of(&path, &elf).unwrap_or_else(|error| panic!("{error}"));
    let bound = Bound::of(&image).unwrap_or_else(|error| panic!("{error}"));
    for (cycles, key) in [
        (bound.control.cycles, "control_interrupt"),
        (bound.update.cycles, "update"),
        (bound.tick_cycles, "tick"),
        (bound.sensor_cycles, "sensor_interrupts"),
        (bound.sensor_cycles_of_both, "interrupts_of_two_sensors"),
        (bound.release_cycles(), "release"),
    ] {
        let most = budget["images"][name]["bound_cycles"][key].as_u64();
        let most = most.unwrap_or_else(|| panic!("{name}: no limit of {key}"));
        assert!(
            u64::from(cycles) <= most,
            "{name}, {key}: {cycles} cycles are more than the {most} of budget.json:\n{}",
            bound.text(),
        );
    }
    // The worst tick returns the tip to the belt or follows a law; the worst update learns in contact.
    for (handler, parts) in [
        (&bound.control, ["estimate::", "refer::", "drive::"]),
        (&bound.update, ["Estimators::learn", "refer::", "drive::"]),
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
    bound
}

#[test]
fn a_tick_has_bounds_within_the_budget() {
    let bounds = ["painleve-f405", "painleve-g474"].map(within_the_budget);
    let row = |label: &str, of: fn(&Bound) -> u32| {
        let figures = bounds.each_ref().map(|bound| {
            let cycles = of(bound);
            let microseconds = bound.chip.microseconds(cycles);
            format!("{} | {microseconds:.0}", thousands(cycles.into()))
        });
        format!("| {label} | {} |\n", figures.join(" | "))
    };
    let heads = bounds.each_ref().map(|bound| {
        let mhz = bound.chip.core_hz / 1e6;
        format!("{}, cycles | µs at {mhz} MHz", bound.chip.name)
    });
    let proves = |of: fn(&Bound) -> u32| {
        let hz = bounds.each_ref().map(|bound| thousands(of(bound).into()));
        format!(
            "with tick and longest section they fit periods up to {} Hz",
            hz.join(" and ")
        )
    };
    let expected = [
        format!("| part | {} |\n|---|---|---|---|---|\n", heads.join(" | ")),
        row(
            "the control interrupt: the last tick's counts, the answer, the stages",
            |it| it.control.cycles,
        ),
        row(
            "the update after it: slow estimates, edges, preparation, checks, queues",
            |it| it.update.cycles,
        ),
        row("both in a tick", |it| it.tick_cycles),
        row(
            &format!(
                "the sensors' interrupts, one on each channel: {}",
                proves(|it| it.proves_hz)
            ),
            |it| it.sensor_cycles,
        ),
        row(
            &format!(
                "two on each channel: {}",
                proves(|it| it.proves_hz_with_both)
            ),
            |it| it.sensor_cycles_of_both,
        ),
        row(
            "the longest section that masks the control interrupt",
            |it| it.sections.last().map_or(0, |it| it.cycles),
        ),
    ];
    printed::check(
        "benchmarks.md",
        "bound",
        &expected.concat(),
        LastFigure::Measured,
    );
}
