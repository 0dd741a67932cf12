//! A campaign's options, read as if they stood on the command line of its study.

use std::collections::BTreeMap;

use clap::{ArgAction, Command, FromArgMatches, Subcommand};
use painleve_plant::scenario::Scenario;
use painleve_study::sweep::campaign::{Campaign, Understood};
use painleve_study::tabular::Table;
use painleve_study::{StudyError, tabular::Tabular};

use super::StudyCommand;

/// Studies whose rows can be computed apart.
const STUDIES: [&str; 7] = [
    "bifurcation",
    "poincare",
    "closed-loop-bifurcation",
    "sliding-range",
    "robustness",
    "capture",
    "lift-off",
];

/// Options that say where an outcome goes and who computes it, which a sweep says itself.
const NOT_OF_A_CAMPAIGN: [&str; 5] = ["json", "csv", "svg", "threads", "help"];

/// The study of a campaign.
///
/// # Errors
/// What is wrong with it and what is allowed, in one sentence.
pub fn understand(campaign: &Campaign) -> Result<Understood, String> {
    let name = campaign.study.as_str();
    if !STUDIES.contains(&name) {
        let all = STUDIES.join(", ");
        return Err(format!(
            "study = \"{name}\" is no study with rows to deal out; there are: {all}"
        ));
    }
    let arguments = arguments(campaign)?;
    let matches = all_studies().try_get_matches_from(arguments);
    let study = matches.and_then(|matches| StudyCommand::from_arg_matches(&matches));
    match study.map_err(|error| first_sentence(&error))? {
        StudyCommand::Bifurcation(study) => understood(study.study(), study.scenarios()),
        StudyCommand::Poincare(study) => understood(study.study(), study.scenarios()),
        StudyCommand::ClosedLoopBifurcation(study) => understood(study.study(), study.scenarios()),
        StudyCommand::SlidingRange(study) => understood(study.study(), study.scenarios()),
        StudyCommand::Robustness(study) => understood(study.study(), Vec::new()),
        StudyCommand::Capture(study) => understood(study.study(), Vec::new()),
        StudyCommand::LiftOff(study) => understood(study.study(), Vec::new()),
        // Not among the names above.
        StudyCommand::Admissible(_) | StudyCommand::Regions(_) | StudyCommand::Ablation(_) => {
            Err(format!("{name} has no rows to deal out"))
        }
    }
}

fn all_studies() -> Command {
    StudyCommand::augment_subcommands(Command::new("study").no_binary_name(true))
}

/// The command line, the study first.
fn arguments(campaign: &Campaign) -> Result<Vec<String>, String> {
    let mut studies = all_studies();
    studies.build();
    let study = studies.find_subcommand(&campaign.study);
    let options: BTreeMap<&str, &clap::Arg> = study
        .into_iter()
        .flat_map(Command::get_arguments)
        .filter_map(|option| Some((option.get_long()?, option)))
        .filter(|(name, _)| !NOT_OF_A_CAMPAIGN.contains(name))
        .collect();
    let mut line = vec![campaign.study.clone()];
    for (key, values) in &campaign.options {
        let Some(option) = options.get(key.as_str()) else {
            let known: Vec<&str> = options.keys().copied().collect();
            return Err(format!(
                "there is no '{key}' in a campaign of the study {}, only: {}",
                campaign.study,
                known.join(", ")
            ));
        };
        // `--set a --set b`, but `--mu a,b`.
        let is_repeated = matches!(option.get_action(), ArgAction::Append)
            && option.get_value_delimiter().is_none();
        if is_repeated {
            line.extend(values.iter().map(|value| format!("--{key}={value}")));
        } else {
            line.push(format!("--{key}={}", values.join(",")));
        }
    }
    Ok(line)
}

/// What clap says, without its hints for the command line.
fn first_sentence(error: &clap::Error) -> String {
    let text = error.to_string();
    let sentence = text.lines().next().unwrap_or_default();
    sentence.trim_start_matches("error: ").to_owned()
}

fn understood<S: Tabular + 'static>(
    study: Result<S, StudyError>,
    scenarios: Vec<&str>,
) -> Result<Understood, String> {
    let table: Box<dyn Table> = Box::new(study.map_err(|error| error.to_string())?);
    let text = |name: &str| {
        let scenario = Scenario::load_unplaced(name, &[]).map_err(|error| error.to_string())?;
        let text = toml::to_string(&scenario).map_err(|error| error.to_string())?;
        Ok((name.to_owned(), text))
    };
    let scenarios = scenarios.into_iter().map(text);
    Ok(Understood {
        table,
        scenarios: scenarios.collect::<Result<_, String>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(study: &str, options: &[(&str, &[&str])]) -> Campaign {
        let owned = |values: &[&str]| values.iter().map(ToString::to_string).collect();
        Campaign {
            study: study.into(),
            options: options
                .iter()
                .map(|(key, values)| (key.to_string(), owned(values)))
                .collect(),
        }
    }

    #[test]
    fn every_study_with_rows_can_be_a_campaign() {
        for (study, rows) in [
            ("bifurcation", 1810),
            ("poincare", 321),
            ("closed-loop-bifurcation", 181),
            ("sliding-range", 16),
            ("robustness", 10_000),
            ("capture", 1000),
            ("lift-off", 2400),
        ] {
            let understood = understand(&campaign(study, &[])).unwrap();
            assert_eq!(understood.table.len(), rows, "{study}");
            assert!(!understood.table.seeds().unwrap().is_empty());
        }
    }

    #[test]
    fn options_are_those_of_the_command_line() {
        let options: [(&str, &[&str]); 4] = [
            ("mu", &["0.4", "0.6"]),
            ("v-belt", &["-1:-0.1:0.1"]),
            ("initial", &["a", "d", "random:2"]),
            (
                "set",
                &["arm.damping_nms_rad=[0.006, 0.006]", "impact.law=energetic"],
            ),
        ];
        let understood = understand(&campaign("bifurcation", &options)).unwrap();
        assert_eq!(understood.table.len(), 2 * 10 * 4);
        let options: [(&str, &[&str]); 1] = [("controller", &["pid", "hybrid"])];
        let understood = understand(&campaign("sliding-range", &options)).unwrap();
        assert_eq!(understood.table.len(), 8);
    }

    #[test]
    fn mistakes_are_told_in_one_line() {
        let seed: (&str, &[&str]) = ("seed", &["-1"]);
        for (campaign, part) in [
            (campaign("regions", &[]), "no study with rows"),
            (campaign("x", &[]), "bifurcation, poincare"),
            (campaign("bifurcation", &[("v_belt", &["1"])]), "'v_belt'"),
            (campaign("bifurcation", &[("json", &["1"])]), "'json'"),
            (
                campaign("bifurcation", &[("csv", &["x"])]),
                "only: initial, mu",
            ),
            (campaign("bifurcation", &[seed]), "--seed"),
            (campaign("bifurcation", &[("mu", &["0:1:0"])]), "step 0"),
            (campaign("bifurcation", &[("mu", &["-1"])]), "--mu = -1"),
            (
                campaign("bifurcation", &[("scenario", &["no.toml"])]),
                "no.toml",
            ),
            (
                campaign("sliding-range", &[("controller", &["no"])]),
                "'no'",
            ),
        ] {
            let message = understand(&campaign).err().unwrap();
            assert!(message.contains(part), "{message}");
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}
