//! One axis of a force cell as wired by the page on wiring: strain-gauge bridge, amplifier, and the wires to a
//! pair of the converter's channels.

use strum::VariantArray;

/// Voltage without a force, counts of 1/4096 of the converter's reference.
const LIVE_ZERO: i32 = 2048;

/// The converter's reference and supply.
const SUPPLY: i32 = 4096;

/// Voltage of an amplifier that is driven against its lower rail: 25 mV.
const LOWER_RAIL: i32 = 20;

/// A single failure between the strain gauges and the converter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub enum BridgeFailure {
    /// The amplifier has no supply.
    SupplyLost,
    /// The bridge has no excitation: its live zero, made by a shunt resistor, goes with it.
    ExcitationLost,
    /// A wire from the bridge to the amplifier is open; resistors pull the amplifier's inputs apart.
    BridgeOpen,
    /// The wire to the converter's positive input is open; a resistor pulls the input to ground.
    SignalOpen,
    /// That wire is shorted to ground.
    SignalGrounded,
    /// That wire is shorted to 5 V.
    SignalAtSupply,
    /// The wire to the converter's negative input is open; a resistor pulls the input to 5 V.
    ReturnOpen,
}

impl BridgeFailure {
    /// All failures.
    pub const ALL: &[Self] = Self::VARIANTS;
}

/// One axis of a force cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct BridgeAmplifier {
    /// What has failed.
    pub failure: Option<BridgeFailure>,
}

impl BridgeAmplifier {
    /// Returns the voltages of the converter's pair of channels, positive and negative, under a force in counts
    /// of 1/4096 of its reference.
    pub fn channels(self, force: i32) -> [i32; 2] {
        let output = (LIVE_ZERO + force).clamp(0, SUPPLY - 1);
        match self.failure {
            None => [output, 0],
            Some(BridgeFailure::BridgeOpen) => [LOWER_RAIL, 0],
            Some(
                BridgeFailure::SupplyLost
                | BridgeFailure::ExcitationLost
                | BridgeFailure::SignalOpen
                | BridgeFailure::SignalGrounded,
            ) => [0, 0],
            Some(BridgeFailure::SignalAtSupply) => [SUPPLY, 0],
            Some(BridgeFailure::ReturnOpen) => [output, SUPPLY],
        }
    }
}
