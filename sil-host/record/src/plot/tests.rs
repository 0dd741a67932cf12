//! The pictures of sample runs: their texts, their panels and their bounds.

use super::*;
use painleve_plant::Snapshot;
use painleve_plant::sample::Sample;
use painleve_plant::telemetry::Telemetry;
use painleve_shared::frame::ActuatorFrame;
use painleve_shared::{Arm, JointTorque, LinkMotion, Pose, Slip};
use proptest::prelude::*;

/// Creates a run whose tip follows its reference, then leaves the belt for one tick.
fn sample(tick: u32) -> Sample {
    let time_s = f64::from(tick) * 1e-3;
    let theta_rad = LinkMotion::new(-0.2, -0.6);
    let arm = Arm::new(Scenario::default().arm).unwrap();
    let p_per_kg = arm.p_per_kg(&Pose::new(&theta_rad), 0.6, Slip::Positive);
    Sample {
        plant: Snapshot {
            time_s,
            tip_t_m: 0.1 * time_s,
            gap_m: if tick == 501 { 1e-3 } else { 0.0 },
            normal_force_n: if tick == 500 { 480.0 } else { 10.0 },
            torque_nm: JointTorque::new(1.0, 2.0),
            b_m_s2: -5.0,
            theta_rad,
            p_per_kg,
            mode: if tick == 501 {
                ContactMode::Flight
            } else {
                ContactMode::SlidePositive
            },
            ..Snapshot::default()
        },
        actuator: ActuatorFrame {
            state: SupervisorState::Tracking as u8,
            ..ActuatorFrame::default()
        },
        reference_tip_t_m: 0.1 * time_s,
        ..Sample::default()
    }
}

fn empty() -> RunPlot {
    RunPlot::new(&Scenario {
        name: "hybrid <elbow> & down".into(),
        ..Scenario::default()
    })
}

fn plot(ticks: u32) -> RunPlot {
    let mut plot = empty();
    let estimates = Telemetry {
        edges_m: [-0.1, 0.2],
        requested_m: 0.3,
        friction: 0.5,
        friction_deviation: 0.1,
        ..Telemetry::default()
    };
    for tick in 0..ticks {
        if tick == 501 {
            plot.event(&RunEvent {
                time_s: 0.501,
                kind: EventKind::Plant(Event::ModeChange {
                    from: ContactMode::SlidePositive,
                    to: ContactMode::Flight,
                }),
            });
            plot.event(&RunEvent {
                time_s: 0.5014,
                kind: EventKind::Plant(Event::Impact {
                    approach_m_s: -0.1,
                    impulse_ns: [0.0; 2],
                }),
            });
        }
        plot.tick(&RecordedTick {
            sample: &sample(tick),
            estimates: Some(&estimates),
        });
    }
    plot
}

/// Returns the texts of a figure in the order drawn.
fn texts(svg: &str) -> Vec<&str> {
    svg.split("<text ")
        .skip(1)
        .filter_map(|element| element.split_once('>')?.1.split_once("</text>"))
        .map(|(text, _)| text)
        .collect()
}

#[test]
fn panels_are_titled_with_their_units() {
    let svg = plot(2000).svg();
    let texts = texts(&svg);
    for expected in [
        "hybrid &lt;elbow&gt; &amp; down",
        "Lifts off at 0.501 s, 1 impact; ends 0.00 mm from its reference, which is held",
        "100.1 mm short of the request",
        "Arm and belt",
        "Tip position zₜ (m)",
        "tip",
        "reference",
        "requested",
        "edges",
        "Tracking error zₜ − zₜ* (mm)",
        "Gap (mm)",
        "impact",
        "Normal force fₙ (N)",
        "off scale: up to 480 N",
        "Joint torques (N·m)",
        "u₁",
        "u₂",
        "Friction coefficient μ",
        "± 1 standard deviation",
        "Contact mode",
        "slide +",
        "flight",
        "Controller",
        "tracking",
        "Free normal acceleration b (m/s²)",
        "Distance to the edge, p = 0 (mm)",
        "p/Q₂₂",
        "Simulated time (s)",
        "2.0",
    ] {
        assert!(texts.contains(&expected), "{expected} not in {texts:?}");
    }
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
}

#[test]
fn panels_without_content_are_left_out() {
    let mut plot = empty();
    for tick in 0..100 {
        let mut sample = sample(tick);
        sample.reference_tip_t_m = f64::NAN;
        sample.plant.torque_nm = JointTorque::zeros();
        sample.plant.normal_force_n = 0.0;
        plot.tick(&RecordedTick {
            sample: &sample,
            estimates: None,
        });
    }
    let svg = plot.svg();
    for absent in [
        "reference",
        "error",
        "Gap",
        "Normal force",
        "torques",
        "Friction",
        "stick",
    ] {
        assert!(!svg.contains(absent), "{absent}");
    }
    assert!(svg.contains("Tip position") && svg.contains("No lift-off"));
}

#[test]
fn a_flight_of_one_tick_is_visible_in_its_lane_and_shades_all_panels_of_a_long_run() {
    let shades = |plot: &RunPlot| plot.svg().matches("fill=\"#D55E00\" fill-opacity").count();
    let svg = plot(100_000).svg();
    // Tip, error, gap, force, torques, friction, b, distance and p/Q22.
    assert_eq!(shades(&plot(100_000)), 9);
    assert!(texts(&svg).contains(&"flight"));
    assert_eq!(shades(&plot(500)), 0);
}

#[test]
fn a_figure_does_not_grow_with_the_run() {
    let short = plot(2_000).svg().len();
    let long = plot(300_000).svg().len();
    assert!(long < 2 * short, "{short} {long}");
}

#[test]
fn runs_with_few_or_no_samples_are_drawn() {
    for ticks in 0..4 {
        let svg = plot(ticks).svg();
        assert!(svg.trim_end().ends_with("</svg>"));
        assert!(!svg.contains("NaN"));
    }
    let svg = plot(0).svg();
    assert!(texts(&svg).contains(&"Simulated time (s): no samples"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_numbers_give_a_figure_within_its_bounds(
        values in prop::collection::vec(
            (any::<f64>(), any::<f64>(), prop_oneof![Just(0.1), any::<f64>()]), 0..20,
        ),
    ) {
        let mut plot = empty();
        for (time_s, value, other) in values {
            let estimates = Telemetry {
                friction: value as f32,
                friction_deviation: other as f32,
                edges_m: [other as f32, value as f32],
                ..Telemetry::default()
            };
            plot.tick(&RecordedTick {
                sample: &Sample {
                    plant: Snapshot {
                        time_s,
                        theta_rad: LinkMotion::new(value, other),
                        tip_t_m: value,
                        gap_m: other,
                        normal_force_n: other,
                        torque_nm: JointTorque::new(value, other),
                        b_m_s2: -value,
                        p_per_kg: other,
                        ..Snapshot::default()
                    },
                    reference_tip_t_m: other,
                    ..Sample::default()
                },
                estimates: Some(&estimates),
            });
        }
        let svg = plot.svg();
        prop_assert!(!svg.contains("NaN") && !svg.contains("inf,"));
        let (_, size) = svg.split_once("viewBox=\"0 0 ").unwrap();
        let (size, _) = size.split_once('"').unwrap();
        let (width, height) = size.split_once(' ').unwrap();
        let (width, height): (i32, i32) = (width.parse().unwrap(), height.parse().unwrap());
        for line in svg.lines().filter_map(|line| line.split_once("points=\"")) {
            let (points, _) = line.1.split_once('"').unwrap();
            for (x, y) in points.split_whitespace().filter_map(|point| point.split_once(',')) {
                let (x, y): (i32, i32) = (x.parse().unwrap(), y.parse().unwrap());
                prop_assert!((0..=width).contains(&x) && (0..=height).contains(&y));
            }
        }
    }
}
