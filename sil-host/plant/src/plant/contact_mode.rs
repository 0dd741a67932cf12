//! Contact modes of the tip.

use painleve_shared::Slip;
use serde::{Deserialize, Serialize};

/// Contact mode of the tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum ContactMode {
    /// The tip is off the belt.
    #[default]
    Flight = 0,
    /// The tip slides with ż_r > 0.
    SlidePositive = 1,
    /// The tip slides with ż_r < 0.
    SlideNegative = 2,
    /// The tip moves with the belt; the force is inside the friction cone.
    Stick = 3,
}

impl ContactMode {
    /// All modes in the order of their numbers.
    pub const ALL: [Self; 4] = [
        Self::Flight,
        Self::SlidePositive,
        Self::SlideNegative,
        Self::Stick,
    ];

    /// Returns the mode that slides in a direction.
    pub fn slide(slip: Slip) -> Self {
        match slip {
            Slip::Positive => Self::SlidePositive,
            Slip::Negative => Self::SlideNegative,
        }
    }

    /// Returns the direction of sliding; `None` if the tip does not slide.
    pub fn slip(self) -> Option<Slip> {
        match self {
            Self::SlidePositive => Some(Slip::Positive),
            Self::SlideNegative => Some(Slip::Negative),
            Self::Flight | Self::Stick => None,
        }
    }

    /// Returns whether the tip touches the belt.
    pub fn is_contact(self) -> bool {
        self != Self::Flight
    }

    /// Returns the name of the mode, as it is serialised.
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
