//! Decimation of runs of any length in bounded memory, for drawing.
//!
//! Each bin holds an equal number of samples. When all bins are used,
//! adjacent bins merge and new bins are twice as wide. A bin keeps the first, last,
//! smallest and largest value of each signal, so a spike of a single tick survives
//! a million ticks.

/// Largest number of bins; at least half of them stay in use once all have been filled.
pub const BINS: usize = 2000;

/// Range of one signal within a bin, including infinities but not NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// First value.
    pub first: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Last value.
    pub last: f64,
}

impl Extent {
    /// The extent without any value.
    pub const EMPTY: Self = Self {
        first: f64::NAN,
        min: f64::NAN,
        max: f64::NAN,
        last: f64::NAN,
    };

    /// Returns the extent of one value.
    pub fn of(value: f64) -> Self {
        Self {
            first: value,
            min: value,
            max: value,
            last: value,
        }
    }

    /// Whether all values were NaN.
    pub fn is_empty(&self) -> bool {
        self.min.is_nan()
    }

    /// Returns this extent extended by a later one.
    #[must_use]
    pub fn then(self, later: Self) -> Self {
        if self.is_empty() {
            return later;
        }
        if later.is_empty() {
            return self;
        }
        Self {
            first: self.first,
            min: self.min.min(later.min),
            max: self.max.max(later.max),
            last: later.last,
        }
    }
}

/// Consecutive samples combined into one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin<const SIGNALS: usize> {
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Time of the last sample, s.
    pub end_s: f64,
    /// Extent of each signal.
    pub extents: [Extent; SIGNALS],
    /// Union of the flags of all samples.
    pub flags: u16,
    samples: u64,
}

impl<const SIGNALS: usize> Bin<SIGNALS> {
    /// Number of samples in the bin.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    fn append(&mut self, later: &Self) {
        self.end_s = later.end_s;
        self.flags |= later.flags;
        self.samples += later.samples;
        for (extent, later) in self.extents.iter_mut().zip(&later.extents) {
            *extent = extent.then(*later);
        }
    }
}

/// Collects samples of `SIGNALS` signals and a set of flags.
#[derive(Clone, Debug)]
pub struct Decimator<const SIGNALS: usize> {
    bins: Vec<Bin<SIGNALS>>,
    samples_per_bin: u64,
}

impl<const SIGNALS: usize> Default for Decimator<SIGNALS> {
    fn default() -> Self {
        Self {
            bins: Vec::with_capacity(BINS),
            samples_per_bin: 1,
        }
    }
}

impl<const SIGNALS: usize> Decimator<SIGNALS> {
    /// Adds a sample without allocating. Discards a sample whose time is not finite,
    /// because it has no position in a figure.
    pub fn push(&mut self, time_s: f64, values: [f64; SIGNALS], flags: u16) {
        if !time_s.is_finite() {
            return;
        }
        let sample = Bin {
            start_s: time_s,
            end_s: time_s,
            extents: values.map(Extent::of),
            flags,
            samples: 1,
        };
        match self.bins.last_mut() {
            Some(bin) if bin.samples < self.samples_per_bin => bin.append(&sample),
            _ => {
                if self.bins.len() == BINS {
                    self.merge_neighbours();
                }
                self.bins.push(sample);
            }
        }
    }

    /// Returns the bins in order of time.
    pub fn bins(&self) -> &[Bin<SIGNALS>] {
        &self.bins
    }

    fn merge_neighbours(&mut self) {
        for pair in 0..BINS / 2 {
            let mut merged = self.bins[2 * pair];
            merged.append(&self.bins[2 * pair + 1]);
            self.bins[pair] = merged;
        }
        self.bins.truncate(BINS / 2);
        self.samples_per_bin *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bins_of(values: &[f64]) -> Vec<Bin<1>> {
        let mut decimator = Decimator::<1>::default();
        for (tick, &value) in values.iter().enumerate() {
            decimator.push(tick as f64, [value], 1 << (tick % 3));
        }
        decimator.bins().to_vec()
    }

    #[test]
    fn few_samples_are_kept_individually_and_times_must_be_finite() {
        assert!(bins_of(&[]).is_empty());
        let bins = bins_of(&[3.0, f64::NAN, 5.0]);
        assert_eq!(bins[0].extents, [Extent::of(3.0)]);
        assert!(bins[1].extents[0].is_empty());
        assert_eq!(bins[2].flags, 4);
        let mut decimator = Decimator::<0>::default();
        decimator.push(f64::NAN, [], 0);
        assert!(decimator.bins().is_empty());
    }

    #[test]
    fn memory_is_constant_over_a_million_samples() {
        let mut decimator = Decimator::<1>::default();
        let capacity = decimator.bins.capacity();
        for tick in 0..1_000_000 {
            decimator.push(f64::from(tick), [0.0], 0);
        }
        assert_eq!(decimator.bins.capacity(), capacity);
        assert!((BINS / 2..=BINS).contains(&decimator.bins().len()));
        let samples: u64 = decimator.bins().iter().map(|bin| bin.samples).sum();
        assert_eq!(samples, 1_000_000);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn every_bin_has_the_extremes_of_its_samples(
            values in prop::collection::vec(
                prop_oneof![9 => -1e3..1e3, 1 => Just(f64::INFINITY), 1 => Just(f64::NAN)],
                1..4 * BINS,
            ),
        ) {
            let bins = bins_of(&values);
            prop_assert!(bins.len() <= BINS);
            let mut expected_start = 0;
            for bin in &bins {
                let (start, end) = (bin.start_s as usize, bin.end_s as usize);
                prop_assert_eq!(start, expected_start);
                expected_start = end + 1;
                let numbers: Vec<f64> =
                    values[start..=end].iter().copied().filter(|value| !value.is_nan()).collect();
                let [extent] = bin.extents;
                prop_assert_eq!(extent.is_empty(), numbers.is_empty());
                if let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) {
                    prop_assert_eq!(extent.first, first);
                    prop_assert_eq!(extent.last, last);
                    prop_assert_eq!(extent.min, numbers.iter().copied().fold(first, f64::min));
                    prop_assert_eq!(extent.max, numbers.iter().copied().fold(first, f64::max));
                }
                let flags = (start..=end).fold(0, |flags, tick| flags | 1 << (tick % 3));
                prop_assert_eq!(bin.flags, flags);
            }
            prop_assert_eq!(expected_start, values.len());
        }
    }
}
