//! The effects of the study.

mod arm;
mod belt;
mod combined;
mod converters;

use std::sync::LazyLock;

use super::effect::{LevelOverrides, RigEffect};
use crate::robustness::LiftOffRule;

/// Every effect; the first changes nothing.
pub static EFFECTS: LazyLock<Vec<&'static RigEffect>> = LazyLock::new(|| {
    let groups = [
        &[NONE],
        belt::EFFECTS,
        arm::EFFECTS,
        converters::EFFECTS,
        combined::EFFECTS,
    ];
    groups.into_iter().flatten().collect()
});

/// No effect.
const NONE: RigEffect = RigEffect {
    name: "none",
    key: "–",
    unit: "",
    levels: &[0.0],
    typical: 1.0,
    compliant_only: false,
    lift_offs: LiftOffRule::Fail,
    largest_friction: None,
    overrides: LevelOverrides::None,
};

/// An effect that both plants have, with lift-offs as failures.
const BOTH: RigEffect = RigEffect {
    overrides: LevelOverrides::Level,
    ..NONE
};

/// An effect of the compliant plant alone.
const COMPLIANT: RigEffect = RigEffect {
    compliant_only: true,
    ..BOTH
};

/// Returns the effect with this name.
pub fn find(name: &str) -> Option<&'static RigEffect> {
    EFFECTS.iter().copied().find(|effect| effect.name == name)
}
