//! The alias of the peripherals' registers, in which each bit has a word of its own (bit-band).

/// Returns the word and the bit for an address of the bit-band alias.
pub fn bit_band(address: u32) -> Option<(u32, u32)> {
    let bit = address.checked_sub(0x4200_0000)? / 4;
    (bit < 0x0200_0000 / 4).then_some((0x4000_0000 + bit / 32 * 4, bit % 32))
}
