//! The built-in scenarios.

/// Name and text of every built-in scenario; the first is the default.
const SCENARIOS: [(&str, &str); 8] = [
    (
        "hybrid-elbow-down",
        include_str!("built_in/hybrid-elbow-down.toml"),
    ),
    (
        "hybrid-elbow-up",
        include_str!("built_in/hybrid-elbow-up.toml"),
    ),
    (
        "pid-elbow-down",
        include_str!("built_in/pid-elbow-down.toml"),
    ),
    ("pid-elbow-up", include_str!("built_in/pid-elbow-up.toml")),
    (
        "open-loop-bounce",
        include_str!("built_in/open-loop-bounce.toml"),
    ),
    ("paper-gains", include_str!("built_in/paper-gains.toml")),
    ("edge", include_str!("built_in/edge.toml")),
    ("capture", include_str!("built_in/capture.toml")),
];

/// Name of the default scenario.
pub const DEFAULT: &str = SCENARIOS[0].0;

/// Returns the names of all built-in scenarios.
pub fn names() -> impl Iterator<Item = &'static str> {
    SCENARIOS.iter().map(|(name, _)| *name)
}

/// Returns the TOML text of a built-in scenario.
pub fn text(name: &str) -> Option<&'static str> {
    SCENARIOS
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    #[test]
    fn every_built_in_scenario_is_valid_and_described() {
        for name in names() {
            let scenario = Scenario::load(name, &[]).unwrap();
            assert_eq!(scenario.name, name);
            assert!(!scenario.description.is_empty());
        }
    }
}
