//! Reads the options of a campaign as if they were on the command line of its study.

use std::collections::BTreeMap;

use clap::{ArgAction, Command};
use painleve_files::input_file;
use painleve_study::STUDIES;
use painleve_study_core::tabular::Table;
use painleve_study_sweep::campaign::{Campaign, CampaignError, Understood};

/// Returns the study of a campaign, and the files that it is made of.
///
/// # Errors
/// [`CampaignError`] with the allowed values.
pub fn understand(campaign: &Campaign) -> Result<Understood, CampaignError> {
    let (table, files) = input_file::with_contents(|| table(campaign));
    Ok(Understood {
        table: table?,
        files,
    })
}

fn table(campaign: &Campaign) -> Result<Box<dyn Table>, CampaignError> {
    let name = campaign.study.as_str();
    let not_shardable = || {
        let all = STUDIES.iter().filter(|entry| entry.has_shards);
        CampaignError::NotShardable {
            study: name.to_owned(),
            shardable: all.map(|entry| entry.name).collect(),
        }
    };
    let entry = painleve_study::find(name)
        .filter(|entry| entry.has_shards)
        .ok_or_else(not_shardable)?;
    let command = entry.command().no_binary_name(true);
    let arguments = arguments(campaign, command.clone())?;
    let matches = command.try_get_matches_from(arguments);
    let options = matches.and_then(|matches| (entry.read)(&matches))?;
    options.table()?.ok_or_else(not_shardable)
}

/// Returns the campaign's options as a command line.
fn arguments(campaign: &Campaign, mut study: Command) -> Result<Vec<String>, CampaignError> {
    study.build();
    let options: BTreeMap<&str, &clap::Arg> = study
        .get_arguments()
        .filter_map(|option| Some((option.get_long()?, option)))
        .filter(|(name, _)| *name != "help")
        .collect();
    let mut line = Vec::new();
    for (key, values) in &campaign.options {
        let Some(option) = options.get(key.as_str()) else {
            return Err(CampaignError::UnknownOption {
                key: key.clone(),
                study: campaign.study.clone(),
                known: options.keys().map(ToString::to_string).collect(),
            });
        };
        // Repeated options become `--set a --set b`, lists become `--mu a,b`.
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

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_study_quality::effects::{EFFECTS, RigEffect};

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

    /// Levels of all effects on the contacts that have them.
    fn levels() -> usize {
        let contacts = |effect: &RigEffect| if effect.compliant_only { 1 } else { 2 };
        let all = EFFECTS.iter();
        all.map(|effect| effect.levels.len() * contacts(effect))
            .sum()
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
            ("effects", 100 * levels()),
        ] {
            let understood = understand(&campaign(study, &[])).unwrap();
            assert_eq!(understood.table.len(), rows, "{study}");
            assert!(!understood.table.seeds().unwrap().is_empty());
        }
    }

    #[test]
    fn every_file_that_the_rows_depend_on_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let table = file("friction.csv", "time_s,change\n0,0.1\n1,0.2\n");
        let change = format!(
            "effects.friction={{ kind = 'file', path = '{}' }}",
            table.display()
        );
        let effect = change.replacen("effects.", "[effects]\n", 1);
        let scenario = file(
            "mine.toml",
            &format!("{effect}\n[contact]\nkind='compliant'\n"),
        );
        let scenario = scenario.to_str().unwrap();
        let controllers = ["hybrid", scenario];
        let set = ["contact.kind=compliant", &change];
        for (study, option, values) in [
            ("robustness", "set", &set[..]),
            ("capture", "set", &set),
            ("lift-off", "set", &set),
            ("sliding-range", "set", &set),
            ("closed-loop-bifurcation", "controller", &controllers),
            ("sliding-range", "controller", &controllers),
            ("loop", "controller", &controllers),
        ] {
            let campaign = campaign(study, &[(option, values)]);
            let Understood { files, .. } = understand(&campaign).unwrap();
            assert!(files.contains_key(&table), "{study}: {files:?}");
            let count = if option == "set" { 1 } else { 2 };
            assert_eq!(files.len(), count, "{study}: {files:?}");
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
    fn mistakes_are_reported_in_one_line() {
        let seed: (&str, &[&str]) = ("seed", &["-1"]);
        for (campaign, part) in [
            (campaign("regions", &[]), "cannot be computed in shards"),
            (campaign("x", &[]), "bifurcation, poincare"),
            (campaign("bifurcation", &[("v_belt", &["1"])]), "'v_belt'"),
            (campaign("bifurcation", &[("json", &["1"])]), "'json'"),
            (
                campaign("bifurcation", &[("csv", &["x"])]),
                "known: initial, mu",
            ),
            (campaign("bifurcation", &[seed]), "--seed"),
            (
                campaign("effects", &[("effect", &["payloads"])]),
                "'--effect <EFFECTS>'; did you mean 'payload'? known: none, ",
            ),
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
            let message = understand(&campaign).err().unwrap().to_string();
            assert!(message.contains(part), "{message}");
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}
