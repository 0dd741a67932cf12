//! What holds the tip.

use painleve_shared::Slip;
use serde::{Deserialize, Serialize};

/// What holds the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum ContactMode {
    /// The tip is off the belt.
    #[default]
    Flight = 0,
    /// It slides with ż_r > 0.
    SlidePositive = 1,
    /// It slides with ż_r < 0.
    SlideNegative = 2,
    /// It moves with the belt, the force inside the friction cone.
    Stick = 3,
}

impl ContactMode {
    /// All modes, by number.
    pub const ALL: [Self; 4] = [
        Self::Flight,
        Self::SlidePositive,
        Self::SlideNegative,
        Self::Stick,
    ];

    /// Sliding in one direction.
    pub fn slide(slip: Slip) -> Self {
        match slip {
            Slip::Positive => Self::SlidePositive,
            Slip::Negative => Self::SlideNegative,
        }
    }

    /// The direction of sliding.
    pub fn slip(self) -> Option<Slip> {
        match self {
            Self::SlidePositive => Some(Slip::Positive),
            Self::SlideNegative => Some(Slip::Negative),
            Self::Flight | Self::Stick => None,
        }
    }

    /// Whether the tip touches the belt.
    pub fn is_contact(self) -> bool {
        self != Self::Flight
    }

    /// The mode's name, as it is serialised.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flight => "flight",
            Self::SlidePositive => "slide-positive",
            Self::SlideNegative => "slide-negative",
            Self::Stick => "stick",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_modes_are_serialised_by_name_and_numbered_in_order() {
        for (number, mode) in ContactMode::ALL.into_iter().enumerate() {
            assert_eq!(mode as usize, number);
            assert_eq!(
                serde_json::to_value(mode).unwrap(),
                serde_json::json!(mode.name())
            );
        }
    }
}
