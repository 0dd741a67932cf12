//! Joints, gears and masses of the arm, pushes on it, and errors of its model.

use super::COMPLIANT;
use crate::effects::effect::LevelOverrides::Computed;
use crate::effects::effect::{Drawn, RigEffect, effects, set};
use crate::robustness::LiftOffRule::Counted;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = effects! {
    ..COMPLIANT;

    "joint-friction": "effects.joints.coulomb_nm", "N·m", [0.02, 0.05, 0.1, 0.2, 0.4], typical 0.05;

    "joint-friction-known": "arm.coulomb_friction_nm", "N·m, known", [0.02, 0.05, 0.1, 0.2, 0.4], typical 0.05,
        overrides: Computed(|level, _| set!["arm.coulomb_friction_nm=[{level:?}, {level:?}]"]);

    "joint-damping": "effects.joints.viscous_nms_rad", "N·m·s/rad",
        [0.005, 0.01, 0.02, 0.05], typical 0.01;

    "rotor-inertia": "arm.rotor_inertia_kg_m2", "kg·m², known", [2e-4, 5e-4, 1e-3, 2e-3], typical 5e-4,
        compliant_only: false,
        overrides: Computed(|level, _| set!["arm.rotor_inertia_kg_m2=[{level:?}, {level:?}]"]);

    "gear-stiffness": "effects.gear.stiffness_nm_rad", "N·m/rad, encoder on the link",
        [2000.0, 1000.0, 500.0, 200.0, 100.0], typical 1000.0,
        overrides: Computed(|level, _| gear(level, 0.0, "link"));

    "gear-stiffness-motor-side": "effects.gear.stiffness_nm_rad", "N·m/rad, encoder on the motor",
        [10_000.0, 5000.0, 2000.0, 1000.0, 500.0], typical 2000.0,
        overrides: Computed(|level, _| gear(level, 0.0, "motor"));

    "gear-stiffness-motor-side-known": "effects.gear.stiffness_nm_rad", "N·m/rad, known",
        [5000.0, 2000.0, 1000.0, 500.0, 200.0], typical 2000.0,
        overrides: Computed(|level, _| {
            let compliance_rad_nm = 1.0 / level;
            let mut overrides = gear(level, 0.0, "motor");
            overrides.extend(set![
                "controller.estimator.gear_compliance_rad_nm=[{compliance_rad_nm:?}, {compliance_rad_nm:?}]"
            ]);
            overrides
        });

    "backlash": "effects.gear.backlash_deg", "° at 500 N·m/rad, encoder on the link",
        [0.05, 0.1, 0.2, 0.5], typical 0.1,
        overrides: Computed(|level, _| gear(500.0, level, "link"));

    "backlash-known": "effects.gear.backlash_deg", "° at 500 N·m/rad, encoder on the link, known",
        [0.05, 0.1, 0.2, 0.5], typical 0.1,
        overrides: Computed(|level, _| {
            // A radian of play counts as 1 m.
            let deviation_m = level.to_radians();
            let mut overrides = gear(500.0, level, "link");
            overrides.extend(set!["controller.estimator.tip_deviation_m={deviation_m:?}"]);
            overrides
        });

    "backlash-motor-side": "effects.gear.backlash_deg", "° at 5000 N·m/rad, encoder on the motor",
        [0.01, 0.02, 0.05, 0.1], typical 0.05,
        overrides: Computed(|level, _| gear(5000.0, level, "motor"));

    "push-along": "effects.push.impulse_ns", "N·s", [0.005, 0.01, 0.02, 0.05], typical 0.01,
        lift_offs: Counted,
        overrides: Computed(|level, drawn| {
            push([level.copysign(drawn.share - 0.5), 0.0], drawn)
        });

    "push-off": "effects.push.impulse_ns", "N·s, away from the belt",
        [0.005, 0.01, 0.02, 0.05], typical 0.01,
        lift_offs: Counted,
        overrides: Computed(|level, drawn| push([0.0, level], drawn));

    "payload": "effects.payload.mass_kg", "kg, unknown", [0.005, 0.01, 0.02, 0.05], typical 0.01,
        overrides: Computed(|level, drawn| {
            let at_s = drawn.at_s;
            set!["effects.payload={{ mass_kg = {level:?}, at_s = {at_s:?} }}"]
        });

    "mass-error": "arm_model.link_mass_kg", "of the mass, unknown", [0.05, 0.1, 0.2, 0.5], typical 0.05,
        compliant_only: false,
        overrides: Computed(|level, drawn| {
            let factor = 1.0 + level.copysign(drawn.share - 0.5);
            let mass_kg = drawn.arm.link_mass_kg.map(|mass_kg| mass_kg * factor);
            set!["arm_model.link_mass_kg={mass_kg:?}"]
        });

    "length-error": "arm_model.link_length_m", "of the length, unknown",
        [0.01, 0.02, 0.05, 0.1], typical 0.02,
        compliant_only: false,
        overrides: Computed(|level, drawn| {
            let factor = 1.0 + level.copysign(drawn.share - 0.5);
            let length_m = drawn.arm.link_length_m.map(|length_m| length_m * factor);
            set!["arm_model.link_length_m={length_m:?}"]
        });
};

/// Inertia of the motors' rotors behind elastic gears, kg·m². The controller knows it, as it knows that of rotors
/// behind stiff gears: it is in a motor's data sheet.
const ROTOR_INERTIA_KG_M2: f64 = 1e-4;

/// Stiffness (N·m/rad) and backlash (°) of the gears, and the side of the encoders.
fn gear(stiffness_nm_rad: f64, backlash_deg: f64, side: &str) -> Vec<String> {
    let rotor = ROTOR_INERTIA_KG_M2;
    set![
        "effects.gear.elastic=true",
        "effects.gear.rotor_inertia_kg_m2={rotor:?}",
        "arm_model.rotor_inertia_kg_m2=[{rotor:?}, {rotor:?}]",
        "effects.gear.stiffness_nm_rad={stiffness_nm_rad:?}",
        "effects.gear.backlash_deg={backlash_deg:?}",
        "effects.gear.encoder_side={side}"
    ]
}

/// A push at a random time, by an impulse along the belt and away from it, N·s.
fn push([along, off]: [f64; 2], drawn: &Drawn) -> Vec<String> {
    let at_s = drawn.at_s;
    set![
        "effects.push.impulse_ns=[{along:?}, {off:?}]",
        "effects.push.at_s={at_s:?}"
    ]
}
