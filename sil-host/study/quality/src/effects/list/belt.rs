//! Contact, friction and surface of the belt.

use super::COMPLIANT;
use crate::effects::effect::LevelOverrides::Computed;
use crate::effects::effect::{RigEffect, effects, set};
use crate::robustness::LiftOffRule::Counted;

/// Mass that the damping ratios of the contact refer to, kg.
const MASS_KG: f64 = 0.04;

/// The effects.
pub(super) const EFFECTS: &[RigEffect] = effects! {
    ..COMPLIANT;

    "softer-contact": "contact.stiffness_n_m", "N/m", [3e4, 1e4, 3e3], typical 3e4,
        overrides: Computed(|level, _| contact(level, 0.6));

    "stiffer-contact": "contact.stiffness_n_m", "N/m", [3e5, 1e6, 1e7], typical 1e6,
        overrides: Computed(|level, _| contact(level, 0.6));

    "contact-damping": "contact.normal.kelvin-voigt.damping_ns_m", "of critical",
        [0.3, 0.15, 0.05], typical 0.3,
        overrides: Computed(|level, _| contact(1e5, level));

    "stiff-damped-contact": "contact.normal.kelvin-voigt.damping_ns_m", "of critical at 1e6 N/m",
        [1.0, 2.0, 4.0], typical 1.0,
        overrides: Computed(|level, _| contact(1e6, level));

    "hanging-belt": "effects.hanging_belt.stiffness_n_m", "N/m, 20 g, 0.15 of critical damping",
        [5e4, 2e4, 1e4], typical 2e4,
        overrides: Computed(|level, _| {
            let (mass_kg, ratio) = (0.02, 0.15);
            let damping_ns_m = damping_ns_m(ratio, level, mass_kg);
            set![
                "effects.hanging_belt={{ mass_kg = {mass_kg:?}, stiffness_n_m = {level:?}, damping_ns_m = {damping_ns_m:?} }}"
            ]
        });

    "static-friction": "contact.static_friction_ratio", "on a belt of 0.05 … 0.2 m/s",
        [1.0, 1.2, 1.4, 1.8], typical 1.2,
        overrides: Computed(|level, drawn| {
            let speed_m_s = (0.05 + 0.15 * drawn.share).copysign(drawn.speed_m_s);
            set![
                "contact.static_friction_ratio={level:?}",
                "belt.profile={{ kind = 'constant', speed_m_s = {speed_m_s:?} }}"
            ]
        });

    "friction-step": "effects.friction.change", "", [0.0, 0.05, 0.1, 0.2, 0.3], typical 0.1,
        largest_friction: Some(|level, friction| friction + level),
        overrides: Computed(|level, drawn| {
            let at_s = drawn.at_s;
            set!["effects.friction={{ kind = 'step', change = {level:?}, at_s = {at_s:?} }}"]
        });

    "friction-sine": "effects.friction.amplitude", "of μ, 0.5 … 5 Hz",
        [0.0, 0.05, 0.1, 0.2, 0.3], typical 0.1,
        largest_friction: Some(|level, friction| friction * (1.0 + level)),
        overrides: Computed(|level, drawn| {
            let amplitude = level * drawn.friction;
            let frequency_hz = 0.5 * libm::pow(10.0, drawn.share);
            set![
                "effects.friction={{ kind = 'sine', amplitude = {amplitude:?}, frequency_hz = {frequency_hz:?} }}"
            ]
        });

    "friction-patches": "effects.friction.amplitude", "patches of 5 cm",
        [0.0, 0.02, 0.05, 0.1, 0.2], typical 0.05,
        largest_friction: Some(|level, friction| friction + level),
        overrides: Computed(|level, drawn| {
            let seed = drawn.seed;
            set![
                "effects.friction={{ kind = 'patches', amplitude = {level:?}, length_m = 0.05, seed = {seed} }}"
            ]
        });

    "waviness": "effects.surface.waviness_m", "m", [1e-4, 3e-4, 1e-3], typical 1e-4;

    "seam": "effects.surface.seam_height_m", "m", [1e-4, 2e-4, 5e-4, 1e-3], typical 2e-4,
        lift_offs: Counted;

    "belt-step": "effects.surface.step_height_m", "m", [1e-4, 2e-4, 5e-4, 1e-3], typical 2e-4,
        lift_offs: Counted;

    "vibration": "effects.surface.vibration_m", "m at 50 Hz", [2e-5, 5e-5, 1e-4, 2e-4], typical 5e-5;
};

/// Damping of a mass (kg) on a spring (N/m), N·s/m.
fn damping_ns_m(ratio: f64, stiffness_n_m: f64, mass_kg: f64) -> f64 {
    2.0 * ratio * libm::sqrt(stiffness_n_m * mass_kg)
}

/// Stiffness (N/m) and damping ratio of the contact.
fn contact(stiffness_n_m: f64, ratio: f64) -> Vec<String> {
    let damping_ns_m = damping_ns_m(ratio, stiffness_n_m, MASS_KG);
    set![
        "contact.stiffness_n_m={stiffness_n_m:?}",
        "contact.normal={{ kelvin-voigt = {{ damping_ns_m = {damping_ns_m:?} }} }}"
    ]
}
