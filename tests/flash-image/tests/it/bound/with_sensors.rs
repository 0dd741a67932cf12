//! Searches for the longest tick with the board's own sensors, under the built-in settings and under valid ones.

use std::panic::{AssertUnwindSafe, catch_unwind};

use painleve_bound::profile::Profile;
use painleve_bound::report::Bound;
use painleve_flash_image::bench::{Bench, BoardBench, scenario};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_plant::scenario::Scenario;
use painleve_shared::frame::DigitalInputs;
use painleve_tests::printed::{self, LastFigure, thousands};

use super::random::{Random, mutated, with_random_settings};
use super::{BoundCheck, Found, Longest, OBJECTIVES, flashed, trace_ticks, tries};

/// The scenario with the settings under which a search (`worst_settings_with_sensors`) has found the longest tick.
fn worst_found() -> Scenario {
    let settings = include_str!("worst_settings.txt").lines();
    let settings: Vec<String> = settings.map(str::to_owned).collect();
    Scenario::load("pid-elbow-down", &settings).unwrap()
}

/// With the board's own sensors: worst found with the built-in settings and with valid ones.
#[test]
#[ignore = "a search for the worst tick"]
fn the_worst_readings_found_by_a_search_stay_below_the_bound() {
    let table = worst_ticks::<F405>();
    if std::env::var_os("PAINLEVE_TICKS").is_none() {
        printed::check("benchmarks.md", "worst ticks", &table, LastFigure::Measured);
    }
}

#[test]
#[ignore = "second chip"]
fn the_worst_readings_of_the_nucleo_stay_below_the_bound() {
    worst_ticks::<G474>();
}

/// Searches for the worst ticks, which are within the budget. Returns the table of them.
fn worst_ticks<C: BoardChip>() -> String {
    let image = flashed::<C>();
    let bound = Bound::of(&image).unwrap_or_else(|error| panic!("{error}"));
    let budget: serde_json::Value =
        serde_json::from_str(include_str!("../../../../budget.json")).unwrap();
    let of_image = &budget["images"][C::IMAGE];
    let built_in = ["hybrid-elbow-down", "pid-elbow-down", "capture"].map(scenario);
    let mut table = String::from(
        "| | control interrupt, instructions | cycles | update, instructions | cycles | both, instructions | cycles |\n\
         |---|---|---|---|---|---|---|\n",
    );
    let mut figures = [0; 6];
    for (label, scenarios, key, of_tick) in [
        (
            "built-in settings",
            &built_in[..],
            "instructions_of_control_interrupt",
            "built_in_settings",
        ),
        (
            "valid settings",
            &[worst_found()],
            "instructions_of_control_interrupt_with_valid_settings",
            "valid_settings",
        ),
    ] {
        let mut watch = BoundCheck::new(&image, &bound);
        let mut random = Random(4);
        for scenario in scenarios {
            for cycles_of in OBJECTIVES {
                let mut bench = Bench::<C>::new(scenario);
                trace_ticks(&mut bench.board);
                bench.drive();
                worst_readings(&mut watch, &mut bench, cycles_of, &mut random);
            }
        }
        let BoundCheck {
            control,
            starting,
            update,
            worst_tick,
            ..
        } = &watch;
        let of = |of: fn(&Longest) -> u32| of(control).max(of(starting));
        let found = [
            of(|it| it.most_instructions.instructions),
            of(|it| it.worst.cycles),
            update.most_instructions.instructions,
            update.worst.cycles,
            worst_tick.instructions,
            worst_tick.cycles,
        ];
        // Built-in settings are valid, too.
        figures = std::array::from_fn(|at| figures[at].max(found[at]));
        let row = figures.map(|it| thousands(it.into())).join(" | ");
        table += &format!("| {label} | {row} |\n");
        println!("{}", Profile::of(&image, &control.addresses).unwrap());
        println!("{}", Profile::of(&image, &update.addresses).unwrap());
        let [instructions, .., cycles] = figures.map(u64::from);
        let most = budget[key].as_u64().unwrap();
        assert!(instructions <= most, "{label}: {instructions} of {most}");
        let most = of_image["worst_tick_cycles"][of_tick].as_u64().unwrap();
        assert!(cycles <= most, "{label}: {cycles} of {most}");
        assert!(most < u64::from(bound.tick_cycles), "{label}: {most}");
    }
    println!("{table}");
    table
}

/// Ticks of the closed loop in whose worst one a search starts.
const LOOP: u32 = 50;

/// Hill climbing with the board's own sensors: starts in the state before the worst tick of a closed loop of a driven arm, and
/// searches for readings and positions of the switch that make one of the next ticks more expensive. Returns the most cycles.
fn worst_readings<C: BoardChip>(
    watch: &mut BoundCheck<'_>,
    bench: &mut Bench<C>,
    cycles_of: fn(Found) -> u32,
    random: &mut Random,
) -> u32 {
    watch.look(&mut bench.board);
    let mut start = (bench.snapshot(), 0);
    for _ in 0..LOOP {
        let before = bench.snapshot();
        bench.tick();
        let cycles = cycles_of(watch.look(&mut bench.board));
        if cycles > start.1 {
            start = (before, cycles);
        }
    }
    bench.restore(&start.0);
    // The readings of the next ticks; each attempt disturbs those of one.
    let mut best = [bench.frame; 6];
    let mut most = 0;
    for _ in 0..tries(60) / 3 {
        let mut tried = best;
        let place = random.below(tried.len() as u64) as usize;
        tried[place] = mutated(&tried[place], random);
        bench.restore(&start.0);
        let mut cycles = 0;
        for frame in tried {
            bench.show(frame);
            let is_closed = frame.inputs.contains(DigitalInputs::ENABLE);
            bench.board.enable(is_closed);
            bench.wait_for_tick();
            cycles = cycles.max(cycles_of(watch.look(&mut bench.board)));
        }
        if cycles >= most {
            (most, best) = (cycles, tried);
        }
    }
    most
}

/// Returns whether the arm is driven, and goes on in the closed loop of a search. Nothing is compared with the bound here: a
/// bound that is broken must end the search.
fn drives(bench: &mut BoardBench) -> bool {
    let driven = catch_unwind(AssertUnwindSafe(|| {
        bench.drive();
        let driven = bench.snapshot();
        (0..LOOP).for_each(|_| bench.tick());
        driven
    }));
    if let Ok(driven) = &driven {
        bench.restore(driven);
    }
    driven.is_ok()
}

/// Hill climbing on settings, and on the readings of the board's own sensors under each. Settings that do not drive the arm
/// are left out.
#[test]
#[ignore = "a search of minutes, for `worst_settings.txt`"]
fn worst_settings_with_sensors() {
    let threads = std::thread::available_parallelism().map_or(1, |it| it.get() as u64);
    let search = |thread: u64| {
        let image = flashed::<F405>();
        let bound = Bound::of(&image).unwrap_or_else(|error| panic!("{error}"));
        let mut watch = BoundCheck::new(&image, &bound);
        let mut random = Random(thread << 32 | 5);
        let mut worst = (worst_found(), String::new(), 0);
        for _ in 0..tries(600).div_ceil(20) {
            let (tried, changes) = with_random_settings(worst.0.clone(), &mut random);
            let mut bench = BoardBench::new(&tried);
            trace_ticks(&mut bench.board);
            if !drives(&mut bench) {
                continue;
            }
            let cycles = worst_readings(&mut watch, &mut bench, OBJECTIVES[1], &mut random);
            if cycles >= worst.2 {
                worst = (tried, worst.1 + &changes, cycles);
                let instructions = watch.control.most_instructions.instructions;
                println!(
                    "{cycles} cycles, control {instructions} instructions:{}",
                    worst.1
                );
            }
        }
    };
    std::thread::scope(|scope| {
        for thread in 0..threads {
            scope.spawn(move || search(thread));
        }
    });
}
