//! Wrong models are refused, each with its reason.

use painleve_identify::verdict::{check_friction, misread};
use painleve_identify::{Parameter, Refusal, Slide, identify};
use painleve_shared::Posture;

use crate::arms::{Rig, limits};

const SEEDS: core::ops::Range<u64> = 35_000..35_005;

/// Changes the slides of some arms and returns what is not refused as it should be.
fn missed(
    change: impl Fn(&mut Rig, &mut Vec<Slide>),
    is_named: impl Fn(&Refusal) -> bool,
) -> Vec<String> {
    SEEDS
        .filter_map(|seed| {
            let mut rig = Rig::new(seed);
            let mut slides = rig.slides();
            change(&mut rig, &mut slides);
            match identify(&slides, &rig.prior, &limits()) {
                Err(refusal) if is_named(&refusal) => None,
                Err(refusal) => Some(format!("{seed}: {refusal}")),
                Ok(found) => Some(format!("{seed}: {:?}", found.fit.parameters)),
            }
        })
        .collect()
}

#[test]
fn exchanged_encoders_are_named() {
    let missed = missed(
        |_, slides| {
            for reading in slides.iter_mut().flat_map(|slide| &mut slide.readings) {
                reading.encoders_rad.swap(0, 1);
            }
        },
        |refusal| *refusal == Refusal::EncodersSwapped,
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

/// The tip presses too hard before it has slid: only where it touches the belt is known.
#[test]
fn encoders_are_named_by_where_the_tip_is_set_down() {
    type Change = fn(&mut [f64; 2]);
    let changes: [(Change, Option<Refusal>); 4] = [
        (|_| {}, None),
        (|both| both.swap(0, 1), Some(Refusal::EncodersSwapped)),
        (
            |[one, _]| *one = -*one,
            Some(Refusal::EncoderReversed { joint: 0 }),
        ),
        (
            |[_, two]| *two = -*two,
            Some(Refusal::EncoderReversed { joint: 1 }),
        ),
    ];
    for seed in SEEDS {
        for posture in [Posture::ElbowDown, Posture::ElbowUp] {
            for (change, expected) in &changes {
                let mut rig = Rig::new(seed);
                let mut reading = rig.reading(posture, 0.02, 0.0);
                change(&mut reading.encoders_rad);
                let slide = Slide {
                    posture,
                    readings: vec![reading],
                    missing: 0,
                    whole: 9000,
                };
                assert_eq!(
                    misread(0, &slide, &rig.prior, &limits()),
                    *expected,
                    "{seed}"
                );
            }
        }
    }
}

#[test]
fn friction_tells_the_running_belt_from_its_frame_and_from_the_other_direction() {
    let of = |friction: f64, belt_m_s: f64, turns_over: bool| {
        let mut slide = Rig::new(35_000).slide(Posture::ElbowDown, -0.9, 0.9);
        let half = slide.readings.len() / 2;
        for (index, reading) in slide.readings.iter_mut().enumerate() {
            let sign = if turns_over && index < half {
                -1.0
            } else {
                1.0
            };
            reading.force_n[0] = sign * friction * reading.force_n[1];
        }
        check_friction(3, &slide, belt_m_s, &limits()).map_err(|refusal| refusal.to_string())
    };
    for sign in [1.0, -1.0] {
        assert_eq!(of(0.6 * sign, 0.15 * sign, false), Ok(()));
        let stands = of(0.6 * sign, 0.15 * sign, true).unwrap_err();
        assert!(stands.starts_with("slide 4: ") && stands.contains(" 50 % "));
        assert!(stands.contains("stands still"), "{stands}");
        let reversed = of(0.6 * sign, -0.15 * sign, false).unwrap_err();
        assert!(reversed.contains("in the other direction"), "{reversed}");
        // Too little to tell.
        assert_eq!(of(0.05 * sign, -0.15 * sign, false), Ok(()));
    }
}

fn is_named_if_slipping(joint: usize) {
    let missed = missed(
        |_, slides| {
            let readings = &mut slides[1].readings;
            let from = readings.len() / 3;
            for reading in &mut readings[from..] {
                reading.encoders_rad[joint] += 0.01;
            }
        },
        |refusal| matches!(refusal, Refusal::Slipped { .. }),
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
#[ignore = "as that of the elbow"]
fn a_slipping_coupling_of_joint_1_is_named() {
    is_named_if_slipping(0);
}

#[test]
fn a_slipping_coupling_of_the_elbow_is_named() {
    is_named_if_slipping(1);
}

#[test]
fn a_bent_link_and_a_wrong_length_contradict_the_drawing() {
    // Bent by 50°, the line from joint to joint is 9 % shorter, and turned.
    let missed = missed(
        |rig, slides| {
            let ratio = rig.actual.get(Parameter::Ratio);
            rig.actual.set(Parameter::Ratio, 0.91 * ratio);
            let zero = rig.actual.get(Parameter::Zero(1));
            rig.actual.set(Parameter::Zero(1), zero + 0.1);
            let height = rig.actual.get(Parameter::Height);
            let [one, two] = rig.actual.link_length_m();
            rig.actual
                .set(Parameter::Height, height.min(0.93 * (one + two)));
            *slides = rig.slides();
        },
        |refusal| matches!(refusal, Refusal::Contradicts { .. }),
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_tip_that_is_not_on_the_belt_is_refused() {
    let missed = missed(
        |rig, slides| {
            // Held above the belt, which a force cell with the wrong tare does not notice.
            let readings = &mut slides[0].readings;
            let count = readings.len();
            for (index, reading) in readings.iter_mut().enumerate() {
                let raised = 0.003 * (3.1 * index as f64 / count as f64).sin();
                let share = (index as f64 / count as f64 - 0.5).abs();
                *reading = rig.reading(Posture::ElbowDown, 0.1 - 0.4 * (0.5 - share), raised);
            }
        },
        // The encoders' errors explain it, so that only a farther slide would show it.
        |refusal| {
            matches!(
                refusal,
                Refusal::NotALine { .. } | Refusal::Slipped { .. } | Refusal::NotObserved { .. }
            )
        },
    );
    assert!(missed.is_empty(), "{missed:#?}");
    let missed = self::missed(
        |_, slides| {
            for reading in &mut slides[0].readings {
                reading.force_n[1] = 0.1;
            }
        },
        |refusal| matches!(refusal, Refusal::NotOnBelt { slide: 0, .. }),
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_posture_that_is_not_as_told_is_named() {
    let missed = missed(
        |_, slides| slides[0].posture = Posture::ElbowUp,
        |refusal| {
            matches!(
                refusal,
                Refusal::OtherPosture {
                    slide: 0,
                    found: Posture::ElbowDown
                }
            )
        },
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_length_that_is_not_as_told_contradicts_the_height() {
    let missed = missed(
        |rig, _| {
            let length = rig.prior.parameters.get(Parameter::Length);
            rig.prior.parameters.set(Parameter::Length, 1.1 * length);
            rig.prior.deviations[Parameter::Length.index()] *= 1.1;
        },
        |refusal| {
            let message = refusal.to_string();
            let keys = ["link_length_m", "height_m", "offset_counts"];
            matches!(refusal, Refusal::Contradicts { .. })
                && keys.iter().all(|key| message.contains(key))
        },
    );
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_slide_without_ticks_or_readings_does_not_blame_the_force_cell() {
    let missed = missed(
        |_, slides| slides[1].readings.clear(),
        |refusal| *refusal == Refusal::NeverTracked { slide: 1 },
    );
    assert!(missed.is_empty(), "{missed:#?}");
    let missed = self::missed(
        |_, slides| {
            let Slide {
                readings, missing, ..
            } = &mut slides[0];
            *missing = readings.len() / 4 + 1;
            readings.truncate(readings.len() - *missing);
        },
        |refusal| matches!(refusal, Refusal::MissingReadings { slide: 0, percent } if *percent > 24.9),
    );
    assert!(missed.is_empty(), "{missed:#?}");
}
