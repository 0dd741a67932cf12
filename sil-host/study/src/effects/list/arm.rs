//! Joints, gears and masses of the arm, pushes on it, and errors of its model.

use super::{BOTH, COMPLIANT};
use crate::effects::effect::{Drawn, RigEffect, set};
use crate::robustness::LiftOffRule;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = &[
    RigEffect {
        name: "joint-friction",
        key: "effects.joints.coulomb_nm",
        unit: "N·m",
        levels: &[0.02, 0.05, 0.1, 0.2, 0.4],
        typical: 0.05,
        overrides: |level, _| set!["effects.joints.coulomb_nm={level:?}"],
        ..COMPLIANT
    },
    RigEffect {
        name: "joint-damping",
        key: "effects.joints.viscous_nms_rad",
        unit: "N·m·s/rad",
        levels: &[0.005, 0.01, 0.02, 0.05],
        typical: 0.01,
        overrides: |level, _| set!["effects.joints.viscous_nms_rad={level:?}"],
        ..COMPLIANT
    },
    RigEffect {
        name: "rotor-inertia",
        key: "arm.rotor_inertia_kg_m2",
        unit: "kg·m², known",
        levels: &[2e-4, 5e-4, 1e-3, 2e-3],
        typical: 5e-4,
        overrides: |level, _| set!["arm.rotor_inertia_kg_m2=[{level:?}, {level:?}]"],
        ..BOTH
    },
    RigEffect {
        name: "gear-stiffness",
        key: "effects.gear.stiffness_nm_rad",
        unit: "N·m/rad, encoder on the link",
        levels: &[2000.0, 1000.0, 500.0, 200.0, 100.0],
        typical: 1000.0,
        overrides: |level, _| gear(level, 0.0, "link"),
        ..COMPLIANT
    },
    RigEffect {
        name: "gear-stiffness-motor-side",
        key: "effects.gear.stiffness_nm_rad",
        unit: "N·m/rad, encoder on the motor",
        levels: &[10_000.0, 5000.0, 2000.0, 1000.0, 500.0],
        typical: 2000.0,
        overrides: |level, _| gear(level, 0.0, "motor"),
        ..COMPLIANT
    },
    RigEffect {
        name: "backlash",
        key: "effects.gear.backlash_deg",
        unit: "° at 500 N·m/rad, encoder on the link",
        levels: &[0.05, 0.1, 0.2, 0.5],
        typical: 0.1,
        overrides: |level, _| gear(500.0, level, "link"),
        ..COMPLIANT
    },
    RigEffect {
        name: "backlash-motor-side",
        key: "effects.gear.backlash_deg",
        unit: "° at 5000 N·m/rad, encoder on the motor",
        levels: &[0.01, 0.02, 0.05, 0.1],
        typical: 0.05,
        overrides: |level, _| gear(5000.0, level, "motor"),
        ..COMPLIANT
    },
    RigEffect {
        name: "push-along",
        key: "effects.push.impulse_ns",
        unit: "N·s",
        levels: &[0.005, 0.01, 0.02, 0.05],
        typical: 0.01,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| push([level.copysign(drawn.share - 0.5), 0.0], drawn),
        ..COMPLIANT
    },
    RigEffect {
        name: "push-off",
        key: "effects.push.impulse_ns",
        unit: "N·s, away from the belt",
        levels: &[0.005, 0.01, 0.02, 0.05],
        typical: 0.01,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, drawn| push([0.0, level], drawn),
        ..COMPLIANT
    },
    RigEffect {
        name: "payload",
        key: "effects.payload.mass_kg",
        unit: "kg, unknown",
        levels: &[0.005, 0.01, 0.02, 0.05],
        typical: 0.01,
        overrides: |level, drawn| {
            let at_s = drawn.at_s;
            set!["effects.payload={{ mass_kg = {level:?}, at_s = {at_s:?} }}"]
        },
        ..COMPLIANT
    },
    RigEffect {
        name: "mass-error",
        key: "arm_model.link_mass_kg",
        unit: "of the mass, unknown",
        levels: &[0.05, 0.1, 0.2, 0.5],
        typical: 0.05,
        overrides: |level, drawn| {
            let mass = 0.12 * (1.0 + level.copysign(drawn.share - 0.5));
            set!["arm_model.link_mass_kg=[{mass:?}, {mass:?}]"]
        },
        ..BOTH
    },
    RigEffect {
        name: "length-error",
        key: "arm_model.link_length_m",
        unit: "of the length, unknown",
        levels: &[0.01, 0.02, 0.05, 0.1],
        typical: 0.02,
        overrides: |level, drawn| {
            let length = 0.21 * (1.0 + level.copysign(drawn.share - 0.5));
            set!["arm_model.link_length_m=[{length:?}, {length:?}]"]
        },
        ..BOTH
    },
];

/// Stiffness (N·m/rad) and backlash (°) of the gears, and the side of the encoders.
fn gear(stiffness_nm_rad: f64, backlash_deg: f64, side: &str) -> Vec<String> {
    set![
        "effects.gear.elastic=true",
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
