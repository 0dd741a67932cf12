//! Bit errors on a wire.

/// Flips bits at random but repeatably.
#[derive(Clone, Debug, Default)]
pub struct BitErrors {
    state: u64,
    /// Probability of a flip, in units of 2⁻³².
    threshold: u32,
    /// Number of bits flipped.
    pub count: u64,
}

impl BitErrors {
    /// Flips every bit with this probability; the random numbers start from
    /// `seed`.
    pub fn new(probability: f64, seed: u64) -> Self {
        Self {
            state: seed.wrapping_mul(2).wrapping_add(1),
            threshold: (probability * 4_294_967_296.0) as u32,
            count: 0,
        }
    }

    /// Returns the bit that arrives.
    pub fn pass(&mut self, bit: bool) -> bool {
        if self.threshold == 0 {
            return bit;
        }
        // Knuth's linear congruential generator; its upper half is used.
        self.state = self
            .state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let flips = ((self.state >> 32) as u32) < self.threshold;
        self.count += u64::from(flips);
        bit ^ flips
    }
}
