//! The alias of the peripherals' registers, in which each bit has a word of its own (bit-band).

/// A bit that has a word of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AliasedBit {
    /// Address of the register.
    pub word: u32,
    /// Number of the bit in it.
    pub bit: u32,
}

/// Returns the bit for an address of the bit-band alias.
pub fn bit_band(address: u32) -> Option<AliasedBit> {
    let bit = address.checked_sub(0x4200_0000)? / 4;
    (bit < 0x0200_0000 / 4).then_some(AliasedBit {
        word: 0x4000_0000 + bit / 32 * 4,
        bit: bit % 32,
    })
}
