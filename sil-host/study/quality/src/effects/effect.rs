//! One effect of the study, and the settings of its levels.

use painleve_shared::ArmParameters;
use serde::Serialize;

use crate::robustness::LiftOffRule;

/// An effect and its levels.
pub struct RigEffect {
    /// Name on the command line and in rows.
    pub name: &'static str,
    /// The key that a level sets; computed levels may set further keys with it.
    pub key: &'static str,
    /// Unit of a level; empty for a ratio.
    pub unit: &'static str,
    /// Levels from harmless to harmful, with the typical one among them.
    pub levels: &'static [f64],
    /// Level of a typical rig.
    pub typical: f64,
    /// Whether only the compliant plant has the effect.
    pub compliant_only: bool,
    /// How lift-offs are judged.
    pub lift_offs: LiftOffRule,
    /// The largest friction coefficient in a run, from the level and the belt's μ, of effects that
    /// change it. Their targets are where p is at least a fifth of Q22 at that friction.
    pub largest_friction: Option<fn(f64, f64) -> f64>,
    /// How a level is set.
    pub overrides: LevelOverrides,
}

/// The overrides of a level.
pub enum LevelOverrides {
    /// None.
    None,
    /// The key is the level.
    Level,
    /// The key is two values, each the level with a random sign.
    RandomSigns,
    /// Computed from the level and the random values of the run.
    Computed(fn(f64, &Drawn) -> Vec<String>),
}

/// Random values of a run that effects use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ of the belt, 0.3 … 0.9.
    pub friction: f64,
    /// Speed of the belt, 0.1 … 1 m/s in either direction.
    pub speed_m_s: f64,
    /// A time while the tip moves, s.
    pub at_s: f64,
    /// A number from 0 to 1.
    pub share: f64,
    /// A phase, rad.
    pub phase_rad: f64,
    /// Seed of random properties along the belt.
    pub seed: u64,
}

impl Drawn {
    /// Returns a value twice, each with a random sign.
    pub fn signs(&self, value: f64) -> [f64; 2] {
        let one = self.share - 0.5;
        let other = self.phase_rad - core::f64::consts::PI;
        [value.copysign(one), value.copysign(other)]
    }

    /// Returns the name for joint 1 or for joint 2, at random.
    pub fn joint<'a>(&self, first: &'a str, second: &'a str) -> &'a str {
        if self.share < 0.5 { first } else { second }
    }
}

/// The contact of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Contact {
    /// Rigid bodies.
    Rigid,
    /// The compliant contact with its default stiffness and damping.
    Compliant,
}

impl RigEffect {
    /// Returns the overrides of a level in a run with these random values.
    pub fn overrides(&self, level: f64, drawn: &Drawn) -> Vec<String> {
        let key = self.key;
        match self.overrides {
            LevelOverrides::None => Vec::new(),
            LevelOverrides::Level => vec![format!("{key}={level}")],
            LevelOverrides::RandomSigns => {
                let [one, two] = drawn.signs(level);
                vec![format!("{key}=[{one}, {two}]")]
            }
            LevelOverrides::Computed(computed) => computed(level, drawn),
        }
    }

    /// Whether the plant with this contact has the effect.
    pub fn acts_on(&self, contact: Contact) -> bool {
        contact == Contact::Compliant || !self.compliant_only
    }

    /// Returns a level relative to the typical one, so that more is worse.
    pub fn severity(&self, level: f64) -> f64 {
        if self.unit == "bits" {
            libm::exp2(self.typical - level)
        } else if self.levels.last() < self.levels.first() {
            self.typical / level
        } else {
            level / self.typical
        }
    }
}

/// Returns the text of overrides: a key, an equals sign and a value each.
macro_rules! set {
    ($($text:literal),+ $(,)?) => { vec![$(format!($text)),+] };
}

/// Returns a table of effects from lines of `name: key, unit, levels, typical level`, followed by the
/// fields that differ from those of the given effect.
macro_rules! effects {
    (..$other:ident; $(
        $name:literal: $key:literal, $unit:literal, $levels:expr, typical $typical:literal
        $(, $field:ident: $value:expr)*;
    )*) => {
        &[$(RigEffect {
            name: $name,
            key: $key,
            unit: $unit,
            levels: &$levels,
            typical: $typical,
            $($field: $value,)*
            ..$other
        }),*]
    };
}
pub(super) use {effects, set};
