//! The arms of the campaign and their random distribution.

use core::ops::Range;

use painleve_plant::scenario::Scenario;
use painleve_shared::ArmParameters;
use serde::{Deserialize, Serialize};

/// The arms of the campaign.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Arms {
    /// The paper's arm, with errors of up to 5 % and 20 % that the controller does not know.
    #[default]
    Paper,
    /// Arms with unequal links, a tip mass and a tilted belt, known to the controller.
    General,
}

/// Farthest target of the paper's arm, within the reach of the controller's model, m.
const FARTHEST_OF_PAPER_M: f64 = 0.183;
/// Farthest target of a known arm, as a fraction of its reach.
const FARTHEST: f64 = 0.994;

impl Arms {
    /// Draws the arm of a scenario, and the model that the controller has of it.
    pub(super) fn draw(self, scenario: &mut Scenario, draw: &mut impl FnMut(Range<f64>) -> f64) {
        let nominal = ArmParameters::<f64>::default();
        match self {
            Self::Paper => {
                scenario.arm_model = Some(nominal.cast());
                let mut scaled = |values: [f64; 2], by| {
                    let factor = draw(by);
                    values.map(|value| value * factor)
                };
                scenario.arm = ArmParameters {
                    link_mass_kg: scaled(nominal.link_mass_kg, 0.95..1.05),
                    link_length_m: scaled(nominal.link_length_m, 0.95..1.05),
                    stiffness_nm_rad: scaled(nominal.stiffness_nm_rad, 0.8..1.2),
                    damping_nms_rad: scaled(nominal.damping_nms_rad, 0.8..1.2),
                    ..nominal
                };
            }
            Self::General => {
                let mut each = |by: Range<f64>| [draw(by.clone()), draw(by)];
                let lengths = each(0.6..1.4).map(|factor| 0.21 * factor);
                let centres = each(0.3..0.7);
                let inertias = each(0.5..1.5);
                let stiffness = each(0.8..1.2);
                let damping = each(0.8..1.2);
                let rotors = each(0.0..2e-4);
                // Symmetric about equal masses.
                let ratio = libm::exp(draw(libm::log(0.3)..libm::log(3.0)));
                let masses = [0.24 / (1.0 + ratio), 0.24 * ratio / (1.0 + ratio)];
                let both = |value: fn(f64, f64) -> f64, one: [f64; 2], other: [f64; 2]| {
                    [value(one[0], other[0]), value(one[1], other[1])]
                };
                let product = |one, other| both(|one, other| one * other, one, other);
                let rods = both(
                    |mass, length| mass * length * length / 12.0,
                    masses,
                    lengths,
                );
                scenario.arm_model = None;
                scenario.arm = ArmParameters {
                    link_length_m: lengths,
                    link_mass_kg: masses,
                    link_centre_of_mass_m: Some(product(centres, lengths)),
                    link_inertia_kg_m2: Some(product(inertias, rods)),
                    tip_mass_kg: draw(0.0..0.05),
                    stiffness_nm_rad: product(stiffness, nominal.stiffness_nm_rad),
                    damping_nms_rad: product(damping, nominal.damping_nms_rad),
                    rotor_inertia_kg_m2: rotors,
                    height_m: (lengths[0] + lengths[1]) * draw(0.75..0.95),
                    belt_tilt_rad: draw(-10.0..10.0_f64).to_radians(),
                    ..nominal
                };
            }
        }
    }

    /// Returns the farthest target of an arm that reaches `reach_m` along the belt, m.
    pub(super) fn farthest_m(self, reach_m: f64) -> f64 {
        match self {
            Self::Paper => FARTHEST_OF_PAPER_M,
            Self::General => FARTHEST * reach_m,
        }
    }
}
