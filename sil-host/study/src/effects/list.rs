//! The effects of the study.

use super::effect::{Drawn, RigEffect, set};
use crate::robustness::LiftOffRule;

/// An effect that both plants have, with lift-offs as failures.
const BOTH: RigEffect = RigEffect {
    name: "none",
    key: "–",
    unit: "",
    levels: &[0.0],
    typical: 1.0,
    compliant_only: false,
    lift_offs: LiftOffRule::Fail,
    largest_friction: None,
    overrides: |_, _| Vec::new(),
};

/// An effect of the compliant plant alone.
const COMPLIANT: RigEffect = RigEffect {
    compliant_only: true,
    ..BOTH
};

/// Mass that the damping ratios of the contact refer to, kg.
const MASS_KG: f64 = 0.04;

/// Every effect; the first changes nothing.
pub static EFFECTS: &[RigEffect] = &[
    BOTH,
    RigEffect {
        name: "softer-contact",
        key: "contact.stiffness_n_m",
        unit: "N/m",
        levels: &[3e4, 1e4, 3e3],
        typical: 3e4,
        overrides: |level, _| contact(level, 0.6),
        ..COMPLIANT
    },
    RigEffect {
        name: "stiffer-contact",
        key: "contact.stiffness_n_m",
        unit: "N/m",
        levels: &[3e5, 1e6, 1e7],
        typical: 1e6,
        overrides: |level, _| contact(level, 0.6),
        ..COMPLIANT
    },
    RigEffect {
        name: "contact-damping",
        key: "contact.normal.kelvin-voigt.damping_ns_m",
        unit: "of critical",
        levels: &[0.3, 0.15, 0.05],
        typical: 0.3,
        overrides: |level, _| contact(1e5, level),
        ..COMPLIANT
    },
    RigEffect {
        name: "stiff-damped-contact",
        key: "contact.normal.kelvin-voigt.damping_ns_m",
        unit: "of critical at 1e6 N/m",
        levels: &[1.0, 2.0, 4.0],
        typical: 1.0,
        overrides: |level, _| contact(1e6, level),
        ..COMPLIANT
    },
    RigEffect {
        name: "static-friction",
        key: "contact.static_friction_ratio",
        unit: "on a belt of 0.05 … 0.2 m/s",
        levels: &[1.0, 1.2, 1.4, 1.8],
        typical: 1.2,
        overrides: |level, drawn| {
            let speed_m_s = (0.05 + 0.15 * drawn.share).copysign(drawn.speed_m_s);
            set![
                "contact.static_friction_ratio={level:?}",
                "belt.profile={{ kind = 'constant', speed_m_s = {speed_m_s:?} }}"
            ]
        },
        ..COMPLIANT
    },
    RigEffect {
        name: "friction-step",
        key: "effects.friction.change",
        levels: &[0.0, 0.05, 0.1, 0.2, 0.3],
        typical: 0.1,
        largest_friction: Some(|level, friction| friction + level),
        overrides: |level, drawn| {
            let at_s = drawn.at_s;
            set!["effects.friction={{ kind = 'step', change = {level:?}, at_s = {at_s:?} }}"]
        },
        ..COMPLIANT
    },
    RigEffect {
        name: "friction-sine",
        key: "effects.friction.amplitude",
        unit: "of μ, 0.5 … 5 Hz",
        levels: &[0.0, 0.05, 0.1, 0.2, 0.3],
        typical: 0.1,
        largest_friction: Some(|level, friction| friction * (1.0 + level)),
        overrides: |level, drawn| {
            let amplitude = level * drawn.friction;
            let frequency_hz = 0.5 * libm::pow(10.0, drawn.share);
            set![
                "effects.friction={{ kind = 'sine', amplitude = {amplitude:?}, frequency_hz = {frequency_hz:?} }}"
            ]
        },
        ..COMPLIANT
    },
    RigEffect {
        name: "friction-patches",
        key: "effects.friction.amplitude",
        unit: "patches of 5 cm",
        levels: &[0.0, 0.02, 0.05, 0.1, 0.2],
        typical: 0.05,
        largest_friction: Some(|level, friction| friction + level),
        overrides: |level, drawn| {
            let seed = drawn.seed;
            set![
                "effects.friction={{ kind = 'patches', amplitude = {level:?}, length_m = 0.05, seed = {seed} }}"
            ]
        },
        ..COMPLIANT
    },
    RigEffect {
        name: "waviness",
        key: "effects.surface.waviness_m",
        unit: "m",
        levels: &[1e-4, 3e-4, 1e-3],
        typical: 1e-4,
        overrides: |level, _| set!["effects.surface.waviness_m={level:?}"],
        ..COMPLIANT
    },
    RigEffect {
        name: "seam",
        key: "effects.surface.seam_height_m",
        unit: "m",
        levels: &[1e-4, 2e-4, 5e-4, 1e-3],
        typical: 2e-4,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, _| set!["effects.surface.seam_height_m={level:?}"],
        ..COMPLIANT
    },
    RigEffect {
        name: "vibration",
        key: "effects.surface.vibration_m",
        unit: "m at 50 Hz",
        levels: &[2e-5, 5e-5, 1e-4, 2e-4],
        typical: 5e-5,
        overrides: |level, _| set!["effects.surface.vibration_m={level:?}"],
        ..COMPLIANT
    },
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
        name: "force-noise",
        key: "converters.force.noise_n",
        unit: "N",
        levels: &[0.05, 0.1, 0.2, 0.5, 1.0],
        typical: 0.1,
        overrides: |level, _| set!["converters.force.noise_n={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "force-resolution",
        key: "converters.force.bits",
        unit: "bits",
        levels: &[10.0, 8.0, 6.0],
        typical: 10.0,
        overrides: |level, _| set!["converters.force.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-resolution",
        key: "converters.encoder.bits",
        unit: "bits",
        levels: &[13.0, 12.0, 11.0, 10.0],
        typical: 12.0,
        overrides: |level, _| set!["converters.encoder.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-noise",
        key: "converters.encoder.noise_rad",
        unit: "rad",
        levels: &[1e-4, 3e-4, 1e-3, 3e-3],
        typical: 3e-4,
        overrides: |level, _| set!["converters.encoder.noise_rad={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "encoder-latency",
        key: "converters.encoder.latency_ticks",
        unit: "ticks",
        levels: &[0.5, 1.0, 2.0, 3.0],
        typical: 0.5,
        overrides: |level, _| set!["converters.encoder.latency_ticks={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-bandwidth",
        key: "converters.torque.lag_s",
        unit: "s",
        levels: &[0.5e-3, 1e-3, 2e-3, 5e-3],
        typical: 1e-3,
        overrides: |level, _| set!["converters.torque.lag_s={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-delay",
        key: "converters.torque.delay_ticks",
        unit: "ticks",
        levels: &[1.5, 2.0, 3.0, 4.0],
        typical: 1.5,
        overrides: |level, _| set!["converters.torque.delay_ticks={level:?}"],
        ..BOTH
    },
    RigEffect {
        name: "torque-resolution",
        key: "converters.torque.bits",
        unit: "bits",
        levels: &[11.0, 10.0, 9.0, 8.0],
        typical: 10.0,
        overrides: |level, _| set!["converters.torque.bits={level}"],
        ..BOTH
    },
    RigEffect {
        name: "frame-loss",
        key: "converters.link.frame_loss",
        levels: &[0.005, 0.01, 0.05, 0.1],
        typical: 0.01,
        overrides: |level, _| set!["converters.link.frame_loss={level:?}"],
        ..BOTH
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

/// Stiffness (N/m) and damping ratio of the contact.
fn contact(stiffness_n_m: f64, ratio: f64) -> Vec<String> {
    let damping_ns_m = 2.0 * ratio * libm::sqrt(stiffness_n_m * MASS_KG);
    set![
        "contact.stiffness_n_m={stiffness_n_m:?}",
        "contact.normal={{ kelvin-voigt = {{ damping_ns_m = {damping_ns_m:?} }} }}"
    ]
}

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

/// Returns the effect with this name.
pub fn find(name: &str) -> Option<&'static RigEffect> {
    EFFECTS.iter().find(|effect| effect.name == name)
}
