//! Contact, friction and surface of the belt.

use super::COMPLIANT;
use crate::effects::effect::{RigEffect, set};
use crate::robustness::LiftOffRule;

/// Mass that the damping ratios of the contact refer to, kg.
const MASS_KG: f64 = 0.04;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = &[
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
        name: "belt-step",
        key: "effects.surface.step_height_m",
        unit: "m",
        levels: &[1e-4, 2e-4, 5e-4, 1e-3],
        typical: 2e-4,
        lift_offs: LiftOffRule::Counted,
        overrides: |level, _| set!["effects.surface.step_height_m={level:?}"],
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
];

/// Stiffness (N/m) and damping ratio of the contact.
fn contact(stiffness_n_m: f64, ratio: f64) -> Vec<String> {
    let damping_ns_m = 2.0 * ratio * libm::sqrt(stiffness_n_m * MASS_KG);
    set![
        "contact.stiffness_n_m={stiffness_n_m:?}",
        "contact.normal={{ kelvin-voigt = {{ damping_ns_m = {damping_ns_m:?} }} }}"
    ]
}
