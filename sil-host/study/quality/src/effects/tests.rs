//! Small studies of effects, and their table from rows made by hand.

use crate::plain;
use painleve_plant::belt_line::BeltLine;
use painleve_plant::mechanics::motion::theta;
use painleve_shared::{Arm, Posture};
use painleve_study_core::outcome::Figure;
use painleve_study_core::rows;

use super::outcome::Fall;
use super::*;

fn study(effects: &[&'static str], runs: usize) -> EffectsStudy {
    EffectsStudy {
        controllers: vec![ControllerChoice::Hybrid],
        contacts: vec![Contact::Rigid, Contact::Compliant],
        effects: effects.to_vec(),
        levels: Vec::new(),
        seed: 1,
        criterion: Criterion::InPlace,
        runs,
        overrides: Vec::new(),
    }
}

#[test]
#[ignore = "draws a thousand scenarios"]
fn every_effect_at_every_level_is_a_valid_scenario_of_its_own() {
    let all: Vec<_> = EFFECTS.iter().map(|effect| effect.name).collect();
    let study = study(&all, 1);
    study.check().unwrap();
    let unnamed = |place| painleve_plant::scenario::Scenario {
        name: String::new(),
        ..study.scenario(place, 0).unwrap()
    };
    for places in study.cells().chunk_by(|one, other| {
        std::ptr::eq(one.controller, other.controller) && one.contact == other.contact
    }) {
        let without = unnamed(EffectCell {
            effect: EFFECTS[0],
            level: 0.0,
            ..places[0]
        });
        for place in places {
            let is_none = place.level == 0.0 || place.level == 1.0;
            let with = unnamed(*place);
            assert!(
                is_none || with != without,
                "{} {}",
                place.effect.name,
                place.level
            );
        }
    }
}

#[test]
fn names_are_unique_and_levels_go_from_harmless_to_harmful() {
    for (index, effect) in EFFECTS.iter().enumerate() {
        assert!(
            EFFECTS[..index]
                .iter()
                .all(|other| other.name != effect.name)
        );
        if index > 0 {
            assert!(effect.levels.contains(&effect.typical), "{}", effect.name);
        }
        let severities: Vec<f64> = effect
            .levels
            .iter()
            .map(|&level| effect.severity(level))
            .collect();
        assert!(severities.is_sorted(), "{}", effect.name);
    }
}

#[test]
fn chosen_levels_take_the_place_of_an_effects_own() {
    let study = EffectsStudy {
        levels: vec![3e3, 2e4],
        ..study(&["none", "softer-contact"], 1)
    };
    study.check().unwrap();
    let cells = study.cells();
    let levels: Vec<_> = cells
        .iter()
        .map(|place| (place.effect.name, place.level))
        .collect();
    assert_eq!(
        levels,
        [
            ("none", 0.0),
            ("none", 0.0),
            ("softer-contact", 2e4),
            ("softer-contact", 3e3)
        ]
    );
}

/// With the rotors behind its gears, and at the largest friction of its patches.
#[test]
fn everything_together_has_targets_away_from_the_edge_of_the_arm_that_moves() {
    let study = study(&["everything"], 20);
    let everything = find("everything").unwrap();
    for run in 0..study.runs {
        for share in [0.25, 2.0] {
            let place = EffectCell {
                controller: &study.controllers[0],
                contact: Contact::Compliant,
                effect: everything,
                level: share,
            };
            let scenario = study.scenario(place, run).unwrap();
            let arm = Arm::new(scenario.moving_arm()).unwrap();
            let posture = Posture::of(&theta(&scenario.initial.state(&scenario.arm).unwrap()));
            let slip = scenario.slip_at_rest();
            let friction = everything.largest_friction.unwrap()(share, scenario.belt.friction);
            let line = BeltLine::new(&arm, posture);
            let tau = line.tau(scenario.target_m().unwrap()).unwrap();
            let p_ratio = line.p_ratio(tau, friction, slip);
            assert!(p_ratio > 0.199, "{share}, run {run}: {p_ratio}");
        }
    }
}

#[test]
fn every_run_of_every_cell_has_a_row_and_without_effects_all_succeed() {
    let study = study(&["none", "force-noise"], 2);
    let found = rows(&study, || ()).unwrap();
    assert_eq!(found.len(), study.cells().len() * 2);
    let outcome = EffectsOutcome::new(&study, found);
    let rigid = &outcome.effects[0];
    assert_eq!(
        (rigid.effect, rigid.cells[0].success.successes),
        ("none", 2)
    );
}

/// On a belt of 1e4 N/m, into which 10 N press the tip by 1 mm, the arm's posture is not that on the undeformed belt.
#[test]
fn on_compliant_contact_the_tip_stands_near_the_edge() {
    for (effect, level) in [("none", 0.0), ("softer-contact", 1e4)] {
        let study = EffectsStudy {
            contacts: vec![Contact::Compliant],
            levels: vec![level],
            ..study(&[effect], 40)
        };
        let found = rows(&study, || ()).unwrap();
        let stopped = |row: &&Row| row.ending == Ending::AtEdge && row.tip_t_m.abs() < 0.179;
        let mut at_edge: Vec<f64> = found
            .iter()
            .filter(stopped)
            .map(|row| row.p_ratio)
            .collect();
        assert!(at_edge.len() >= 3, "{effect}: {at_edge:?}");
        at_edge.sort_by(f64::total_cmp);
        assert!(at_edge[0] > 0.06, "{effect}: {at_edge:?}");
        // Coarse encoders and slow ticks keep some farther away.
        let median = at_edge[at_edge.len() / 2];
        assert!((0.08..0.14).contains(&median), "{effect}: {at_edge:?}");
    }
}

/// Rows made by hand, so that a change of the controller does not change the snapshots.
#[test]
fn the_table_interpolates_between_levels() {
    let study = study(&["none", "joint-friction", "gear-stiffness"], 4);
    let success = |place: &EffectCell<'_>, run: usize| match place.effect.name {
        "joint-friction" => place.level * (run + 1) as f64 <= 0.2,
        "gear-stiffness" => place.level >= 1000.0 || run < 2,
        _ => true,
    };
    let mut rows = Vec::new();
    for place in study.cells() {
        rows.extend((0..4).map(|run| Row {
            controller: place.controller.to_string(),
            contact: place.contact,
            effect: place.effect.name,
            level: place.level,
            run,
            ending: if success(&place, run) {
                Ending::Reached
            } else {
                Ending::LiftOff
            },
            fault: None,
            lift_offs: 0,
            error_m: 1e-4 * (run + 1) as f64,
            to_edge_m: None,
            p_ratio: 0.5,
            tip_t_m: 0.1,
            target_m: Some(0.1),
            posture: Posture::ElbowUp,
            mu: 0.6,
            v_belt_m_s: 0.4,
        }));
    }
    let outcome = EffectsOutcome::new(&study, rows);
    insta::assert_snapshot!(plain(&outcome));
    let gear = outcome.effects.last().unwrap();
    let [most, some, half] = gear.falls_below;
    assert!(matches!(most, Fall::At(level) if (500.0..1000.0).contains(&level)));
    assert!(matches!(some, Fall::At(level) if (500.0..900.0).contains(&level)));
    assert_eq!(half, Fall::Beyond);
    assert!(outcome.svg().contains("gear-stiffness"));
}
