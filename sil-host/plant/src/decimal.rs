//! Settings of the controller in double precision.

/// Returns the number in double precision that has the same decimals as a setting in single precision: 0.163, where
/// the same bits are 0.16300000250339508.
pub fn as_written(setting: f32) -> f64 {
    setting
        .to_string()
        .parse()
        .unwrap_or_else(|_| f64::from(setting))
}

#[cfg(test)]
mod tests {
    use super::as_written;

    #[test]
    fn decimals_are_kept() {
        for (single, double) in [(0.163, 0.163), (-1e-9, -1e-9), (3e38, 3e38), (0.0, 0.0)] {
            assert_eq!(as_written(single), double);
        }
        assert!(as_written(f32::NAN).is_nan());
        assert_eq!(as_written(f32::INFINITY), f64::INFINITY);
    }
}
