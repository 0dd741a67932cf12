//! Values with unequal spacing, laid out on the equal cells of a map.

/// Largest number of cells along an axis: more would be thinner than a pixel.
const MOST_PLACES: usize = 1800;

/// Equal cells along an axis, each with the value nearest to its middle.
pub struct Places {
    /// Middle of the first cell.
    pub first: f64,
    /// Spacing of the cells.
    pub step: f64,
    /// Index of the value that each cell shows.
    pub nearest: Vec<usize>,
}

impl Places {
    /// Creates cells as wide as the smallest spacing of the values.
    pub fn of(values: &[f64]) -> Self {
        let mut rising: Vec<f64> = values.to_vec();
        rising.sort_by(f64::total_cmp);
        rising.dedup();
        let (first, last) = (rising[0], rising[rising.len() - 1]);
        let narrowest = rising.windows(2).map(|two| two[1] - two[0]);
        let narrowest = narrowest.fold(f64::INFINITY, f64::min);
        if rising.len() < 2 {
            return Self {
                first,
                step: 0.1,
                nearest: vec![0],
            };
        }
        let count = ((last - first) / narrowest).round().min(MOST_PLACES as f64) as usize + 1;
        let step = (last - first) / (count - 1) as f64;
        let nearest = (0..count).map(|place| {
            let middle = first + step * place as f64;
            let distance = |index: &usize| (values[*index] - middle).abs();
            let nearest =
                (0..values.len()).min_by(|one, other| distance(one).total_cmp(&distance(other)));
            nearest.unwrap_or(0)
        });
        Self {
            first,
            step,
            nearest: nearest.collect(),
        }
    }

    /// Returns the outer edges of the first and the last cell.
    pub fn ends(&self) -> core::ops::Range<f64> {
        let start = self.first - 0.5 * self.step;
        start..start + self.step * self.nearest.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equally_spaced_values_have_one_cell_each_and_others_several() {
        let equal = Places::of(&[0.3, 0.1, 0.2]);
        assert_eq!(equal.nearest, [1, 2, 0]);
        assert!(
            (equal.ends().start - 0.05).abs() < 1e-12 && (equal.ends().end - 0.35).abs() < 1e-12
        );
        assert_eq!(Places::of(&[0.0, 1.0, 4.0]).nearest, [0, 1, 1, 2, 2]);
        assert_eq!(Places::of(&[0.6, 0.6]).nearest, [0]);
        assert_eq!(Places::of(&[0.0, 1e-9, 1.0]).nearest.len(), MOST_PLACES + 1);
    }
}
