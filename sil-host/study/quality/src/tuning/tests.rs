//! The search finds what is known to be good, whatever the threads, and goes on where it ended.

use super::*;

fn tuning() -> Tuning {
    let overrides = [
        "run.duration_s=1.6",
        "controller.law.hybrid.velocity_gain_per_s=40",
        "controller.law.hybrid.position_gain_per_s2=1900",
    ];
    Tuning {
        scenario: Scenario::load("hybrid-elbow-down", &overrides.map(str::to_owned)).unwrap(),
        ranges: [
            "controller.law.hybrid.velocity_gain_per_s=20:300",
            "controller.law.hybrid.position_gain_per_s2=1000:15000",
        ]
        .map(|range| range.parse().unwrap())
        .to_vec(),
        cases: 2,
        seed: 7,
        interrupt: Interrupt::default(),
    }
}

fn search(tuning: &Tuning, all: usize, mut trials: Vec<Trial>) -> Vec<Trial> {
    let given = tuning
        .score(&tuning.scenario, tuning.cases, tuning.seed)
        .unwrap();
    assert_eq!(given.kept, 1.0);
    while trials.len() < all {
        trials.extend(tuning.next_trials(&trials, all, &given).unwrap());
    }
    trials
}

#[test]
fn a_search_improves_gains_that_are_off_and_does_not_depend_on_threads_or_pauses() {
    let tuning = tuning();
    tuning.check().unwrap();
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    };
    let trials = pool(2).install(|| search(&tuning, 32, Vec::new()));
    let costs = || trials.iter().map(|trial| trial.cost);
    assert!(costs().fold(f64::INFINITY, f64::min) < 0.98, "{trials:?}");
    assert!(trials.iter().all(|trial| {
        trial
            .values
            .iter()
            .zip(&tuning.ranges)
            .all(|(value, range)| (range.from..=range.to).contains(value))
    }));
    // Nor on how many trials were asked for first.
    let begun = search(&tuning, 20, Vec::new());
    let resumed = pool(1).install(|| search(&tuning, 32, begun));
    assert_eq!(resumed, trials);
}

#[test]
#[ignore = "a tuning"]
fn from_gains_off_by_three_the_objective_of_the_built_in_ones_is_found() {
    is_found_from([3.0, 1.0 / 3.0, 3.0]);
}

#[test]
#[ignore = "a second start"]
fn from_gains_off_by_a_third_the_objective_of_the_built_in_ones_is_found() {
    is_found_from([1.0 / 3.0, 3.0, 1.0 / 3.0]);
}

/// Asserts that a search finds the objective of the built-in gains from these multiples of them.
fn is_found_from(factors: [f64; 3]) {
    let keys = [
        ("position_gain_per_s2", 5800.0),
        ("velocity_gain_per_s", 128.0),
        ("position_integral_gain_per_s3", 10_000.0),
    ];
    let built_in = Scenario::load("hybrid-elbow-down", &[]).unwrap();
    let law = "controller.law.hybrid";
    let off = keys.iter().zip(factors);
    let off = off.map(|((key, gain), factor)| format!("{law}.{key}={}", gain * factor));
    let range = |(key, gain)| format!("{law}.{key}={}:{}", gain / 10.0, gain * 10.0);
    let tuning = Tuning {
        scenario: Scenario::load("hybrid-elbow-down", &off.collect::<Vec<_>>()).unwrap(),
        ranges: keys.map(|key| range(key).parse().unwrap()).to_vec(),
        cases: 4,
        seed: 9,
        interrupt: Interrupt::default(),
    };
    let trials = search(&tuning, 120, Vec::new());
    let best = trials.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let tuned = tuning.with(&best.unwrap().values).unwrap();
    // In cases that the search has not seen, by the cost that it makes small: beside the gains from which it starts.
    let [tuned, known, start] =
        [&tuned, &built_in, &tuning.scenario].map(|it| tuning.score(it, 4, 10).unwrap());
    let [tuned, known] = [tuned, known].map(|it| it.cost(&start));
    // Six trials reach 0.61 and 0.65.
    assert!(tuned < known.min(0.6), "{tuned} {known}");
}

#[test]
fn the_front_has_the_trials_that_no_other_beats() {
    let trial = |kept, error_mm, torque_change_nm| Trial {
        values: Vec::new(),
        score: Score {
            kept,
            error_mm,
            ripple_n: 0.0,
            torque_change_nm,
        },
        cost: 1.0,
    };
    let trials = [
        trial(1.0, 2.0, 1.0),
        trial(1.0, 1.0, 3.0),
        trial(1.0, 1.5, 3.5),
        trial(0.5, 0.1, 0.1),
    ];
    let front = figure::front(&trials);
    assert_eq!(front, [trials[1].score, trials[0].score]);
}

#[test]
fn a_range_that_is_none_is_refused() {
    for text in [
        "", "a", "a=1", "a=1:", "a=2:1", "a=0:1", "a=-1:1", "=1:2", "a=1:inf", "a=x:2",
    ] {
        let error = text.parse::<Range>().unwrap_err().to_string();
        assert!(error.contains(text) && error.contains("FROM:TO"), "{error}");
    }
    let refusal = |range: &str| {
        let ranges = vec![range.parse().unwrap()];
        let wrong = Tuning { ranges, ..tuning() };
        wrong.check().unwrap_err().to_string()
    };
    let (unknown, whole) = (
        refusal("belt.frction=0.1:1"),
        refusal("run.tick_hz=500:2000"),
    );
    assert!(unknown.contains("did you mean 'friction'?"), "{unknown}");
    assert!(!unknown.contains("fractional"), "{unknown}");
    let fractional = "not 500.0; only keys with fractional values can be searched";
    assert!(whole.ends_with(fractional), "{whole}");
}

/// On a compliant belt, a tip set down without pressing bounces once before it is captured.
#[test]
fn a_tip_that_bounces_before_it_is_captured_is_kept() {
    let overrides = ["run.duration_s=1.6", "contact.kind=compliant"];
    let scenario = Scenario::load("edge", &overrides.map(str::to_owned)).unwrap();
    let score = tuning().score(&scenario, 2, 7).unwrap();
    assert_eq!(score.kept, 1.0);
}
