//! Lists of shards in the syntax of job arrays: `3,7,9-12`.

/// Formats ascending numbers as `3,7,9-12`; no numbers give an empty text.
pub fn syntax(numbers: &[usize]) -> String {
    let mut parts = Vec::new();
    for run in numbers.chunk_by(|one, next| one + 1 == *next) {
        match *run {
            [one] => parts.push(one.to_string()),
            [first, .., last] => parts.push(format!("{first}-{last}")),
            [] => {}
        }
    }
    parts.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_become_ranges() {
        assert_eq!(syntax(&[]), "");
        assert_eq!(syntax(&[0]), "0");
        assert_eq!(syntax(&[3, 7, 9, 10, 11, 12]), "3,7,9-12");
        assert_eq!(syntax(&[0, 1, 3, 4]), "0-1,3-4");
    }
}
