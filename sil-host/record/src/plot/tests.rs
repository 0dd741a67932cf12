//! The pictures of sample runs, as snapshots and properties.

use super::*;
use painleve_plant::Snapshot;
use proptest::prelude::*;

/// Creates a run whose tip follows its reference, then leaves the belt for one tick.
fn sample(tick: u32) -> Sample {
    let time_s = f64::from(tick) * 1e-3;
    Sample {
        plant: Snapshot {
            time_s,
            tip_t_m: 0.1 * time_s,
            normal_force_n: if tick == 500 { 480.0 } else { 10.0 },
            torque_nm: [1.0, 2.0],
            b_m_s2: -5.0,
            p_per_kg: 0.4,
            mode: if tick == 501 {
                ContactMode::Flight
            } else {
                ContactMode::SlidePositive
            },
            ..Snapshot::default()
        },
        reference_tip_t_m: 0.1 * time_s,
        ..Sample::default()
    }
}

fn plot(ticks: u32) -> RunPlot {
    let mut plot = RunPlot::new("hybrid <elbow> & down", "seed\u{7} 1");
    (0..ticks).for_each(|tick| plot.push(&sample(tick)));
    plot
}

/// Returns the texts of a figure in the order drawn.
fn texts(svg: &str) -> Vec<&str> {
    svg.split("<text ")
        .skip(1)
        .filter_map(|element| element.split_once('>')?.1.split_once("</text>"))
        .map(|(text, _)| text.trim())
        .collect()
}

/// Returns the filled rectangles of a colour; only lanes and shades are filled.
fn rectangles(svg: &str, colour: RGBColor) -> usize {
    let RGBColor(r, g, b) = colour;
    let fill = format!("fill=\"#{r:02X}{g:02X}{b:02X}\" stroke=\"none\"");
    svg.lines()
        .filter(|line| line.starts_with("<rect") && line.contains(&fill))
        .count()
}

#[test]
fn panels_are_titled_with_their_units() {
    let svg = plot(2000).svg().unwrap();
    let texts = texts(&svg);
    for expected in [
        "hybrid &lt;elbow&gt; &amp; down",
        "seed  1",
        "Tip position zₜ (m)",
        "tip zₜ",
        "reference zₜ*",
        "Normal force fₙ (N)",
        "off scale: up to 480 N",
        "Joint torques u₁, u₂ (N·m)",
        "u₁",
        "u₂",
        "Contact mode",
        "slide +",
        "slide −",
        "stick",
        "flight",
        "Free normal acceleration b (m/s²)",
        "Contact coefficient p (1/kg)",
        "Simulated time (s)",
        "2.0",
    ] {
        assert!(texts.contains(&expected), "{expected} not in {texts:?}");
    }
    assert!(svg.starts_with("<svg width=\"1000\""));
    assert!(svg.trim_end().ends_with("</svg>"));
}

#[test]
fn a_flight_of_one_tick_is_visible_in_its_lane_and_shades_all_panels_of_a_long_run() {
    let svg = plot(100_000).svg().unwrap();
    assert_eq!(rectangles(&svg, VERMILLION), 1 + 5);
    assert_eq!(rectangles(&svg, BLUE_INK), 1);
    assert_eq!(rectangles(&plot(500).svg().unwrap(), VERMILLION), 0);
}

#[test]
fn a_figure_does_not_grow_with_the_run() {
    let short = plot(2_000).svg().unwrap().len();
    let long = plot(300_000).svg().unwrap().len();
    assert!(long < 2 * short, "{short} {long}");
}

#[test]
fn runs_with_few_or_no_samples_are_drawn() {
    for ticks in 0..4 {
        let svg = plot(ticks).svg().unwrap();
        assert!(svg.trim_end().ends_with("</svg>"));
        assert!(!svg.contains("NaN"));
    }
    let svg = plot(0).svg().unwrap();
    assert!(texts(&svg).contains(&"Simulated time (s): no samples"));
}

#[test]
fn a_figure_is_written_completely_and_an_unwritable_path_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out/run.svg");
    let plot = plot(10);
    plot.write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), plot.svg().unwrap());
    let error = plot.write(path.join("run.svg")).unwrap_err().to_string();
    assert!(error.contains("run.svg/run.svg"), "{error}");
}

proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn any_numbers_give_a_figure_within_its_bounds(
            values in prop::collection::vec(
                (any::<f64>(), any::<f64>(), prop_oneof![Just(0.1), any::<f64>()]), 0..20,
            ),
        ) {
            let mut plot = RunPlot::new("", "");
            for (time_s, value, other) in values {
                plot.push(&Sample {
plant: Snapshot {
                    time_s,
                    tip_t_m: value,
                    normal_force_n: other,
                    torque_nm: [value, other],
                    b_m_s2: -value,
                    p_per_kg: other,
..Snapshot::default()
},

..Sample::default()
                });
            }
            let svg = plot.svg().unwrap();
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
            for line in svg.lines().filter_map(|line| line.split_once("points=\"")) {
                let (points, _) = line.1.split_once('"').unwrap();
                for (x, y) in points.split_whitespace().filter_map(|point| point.split_once(',')) {
                    let (x, y): (i32, i32) = (x.parse().unwrap(), y.parse().unwrap());
                    prop_assert!((0..=WIDTH).contains(&x) && (0..=HEIGHT).contains(&y));
                }
            }
        }
    }
