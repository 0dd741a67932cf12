//! `painleve sweep`: a study in shards, on several machines.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use painleve_files::atomic_file::{self, AtomicFile, prepare};
use painleve_process::terminal::warn;
use painleve_study_core::outcome;
use painleve_study_sweep::campaign::{Campaign, Understood};
use painleve_study_sweep::folder::path_as_text;
use painleve_study_sweep::manifest::Manifest;
use painleve_study_sweep::share::{self, ShardOption, Share};
use painleve_study_sweep::slurm::Job;
use painleve_study_sweep::{SweepError, array, folder, shard_file};
use serde::Serialize;
use serde_json::json;

use super::json::JsonOption;
use super::output_error::output;
use super::progress::Shown;
use super::study::campaign::understand;
use super::study::outcome::Threads;
use super::{CommandError, distinct_files, say};

/// Options of `painleve sweep`.
#[derive(Debug, Args)]
pub struct SweepArguments {
    #[command(subcommand)]
    command: SweepCommand,
}

#[derive(Debug, Subcommand)]
enum SweepCommand {
    /// Distribute the rows of a campaign over shards and write the manifest.
    Plan(PlanArguments),
    /// Compute one shard, or all missing ones; finished shards are skipped.
    Run(ShardArguments),
    /// Show which shards are finished.
    Status(StatusArguments),
    /// Print the missing shards in array syntax, for example 3,7,9-12.
    Missing(MissingArguments),
    /// Merge all shards; fails if one is missing or duplicated.
    Merge(MergeArguments),
    /// Write a script that submits the missing shards to a scheduler.
    Submit(SubmitArguments),
}

/// Location of a sweep.
#[derive(Debug, Args)]
struct SweepFolder {
    /// Folder of the sweep: its manifest and its shards.
    #[arg(long, value_name = "PATH", default_value = "out/sweep")]
    folder: PathBuf,
}

#[derive(Debug, Args)]
struct PlanArguments {
    /// TOML file: study = "bifurcation" and its options, as on the command line.
    campaign: PathBuf,
    /// Number of shards; choose it so that each takes a few minutes.
    #[arg(long, value_name = "N", value_parser = super::count)]
    shards: NonZeroUsize,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    place: SweepFolder,
}

#[derive(Debug, Args)]
struct MissingArguments {
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    place: SweepFolder,
}

#[derive(Debug, Args)]
struct ShardArguments {
    /// Shard K of N, K from 0; by default taken from SLURM_ARRAY_TASK_ID, HQ_TASK_ID,
    /// JOB_COMPLETION_INDEX or OMPI_COMM_WORLD_RANK.
    #[arg(long, value_name = "K/N", allow_hyphen_values = true)]
    shard: Option<ShardOption>,
    /// Compute all missing shards, one after the other.
    #[arg(long, conflicts_with = "shard")]
    all: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print one JSON object on stdout at the end instead of a line per shard.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    place: SweepFolder,
}

#[derive(Debug, Args)]
struct StatusArguments {
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    place: SweepFolder,
}

#[derive(Debug, Args)]
struct MergeArguments {
    /// Path of the CSV file; by default merged.csv in the sweep's folder.
    #[arg(long, value_name = "PATH")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    place: SweepFolder,
}

#[derive(Debug, Args)]
struct SubmitArguments {
    #[command(subcommand)]
    scheduler: Scheduler,
}

#[derive(Debug, Subcommand)]
enum Scheduler {
    /// Write sweep.sbatch, a job array of the missing shards, but do not submit it.
    Slurm(SlurmArguments),
}

#[derive(Debug, Args)]
struct SlurmArguments {
    /// Cores of each shard.
    #[arg(long, value_name = "N", default_value = "1", value_parser = super::count)]
    cpus: NonZeroUsize,
    /// Additional option of sbatch, for example --option=--time=30; may be repeated.
    #[arg(long = "option", value_name = "OPTION", allow_hyphen_values = true)]
    options: Vec<String>,
    /// Path of the script; by default sweep.sbatch in the sweep's folder.
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    place: SweepFolder,
}

/// Runs one step of a sweep.
///
/// # Errors
/// [`CommandError`] if the sweep does not exist or is incomplete, a file cannot be written, or the user
/// interrupts.
pub fn run(arguments: &SweepArguments) -> Result<(), CommandError> {
    match &arguments.command {
        SweepCommand::Plan(arguments) => plan(arguments),
        SweepCommand::Run(arguments) => compute(arguments),
        SweepCommand::Status(arguments) => status(arguments),
        SweepCommand::Missing(arguments) => missing(arguments),
        SweepCommand::Merge(arguments) => merge(arguments),
        SweepCommand::Submit(SubmitArguments {
            scheduler: Scheduler::Slurm(arguments),
        }) => submit_slurm(arguments),
    }
}

fn plan(arguments: &PlanArguments) -> Result<(), CommandError> {
    let path = &arguments.campaign;
    let campaign = Campaign::load(path)?;
    let understood = understand(&campaign).map_err(|source| SweepError::Campaign {
        path: path.clone(),
        source,
    })?;
    let manifest = Manifest::new(campaign, &understood, arguments.shards.get())?;
    let folder = &arguments.place.folder;
    let is_new = manifest.write(folder)?;
    let path = Manifest::path(folder);
    let result = json!({
        "manifest": path.display().to_string(),
        "is_new": is_new,
        "campaign_hash": manifest.campaign_hash(),
        "rows": manifest.rows,
        "shards": manifest.shards,
    });
    arguments.json.say(
        &result,
        format_args!(
            "{}{}: campaign {}, {} rows in {} shards",
            path.display(),
            if is_new { "" } else { " (there already)" },
            manifest.campaign_hash(),
            manifest.rows,
            manifest.shards,
        ),
    )
}

/// Returns the manifest and the study that it describes.
fn load(folder: &Path) -> Result<(Manifest, Understood), SweepError> {
    let manifest = Manifest::load(folder)?;
    let understood = understand(&manifest.campaign).map_err(|source| SweepError::Manifest {
        path: Manifest::path(folder),
        source: source.into(),
    })?;
    manifest.check(folder, &understood)?;
    Ok((manifest, understood))
}

fn compute(arguments: &ShardArguments) -> Result<(), CommandError> {
    let folder = &arguments.place.folder;
    let (manifest, understood) = load(folder)?;
    let shards = if arguments.all {
        (0..manifest.shards).collect()
    } else {
        let variable = |name: &str| std::env::var(name).ok();
        vec![share::shard(arguments.shard, manifest.shards, variable).map_err(SweepError::from)?]
    };
    let mut finished = Vec::new();
    for shard in shards {
        let result = compute_shard(arguments, &manifest, &understood, shard)?;
        if !arguments.json {
            say(result.line(manifest.shards))?;
        }
        finished.push(result);
    }
    if arguments.json {
        say(json!({ "shards": manifest.shards, "finished": finished }))?;
    }
    Ok(())
}

/// A shard after `sweep run`.
#[derive(Debug, Serialize)]
struct FinishedShard {
    /// Number of the shard.
    shard: usize,
    /// Number of its rows.
    rows: usize,
    /// Its file.
    #[serde(serialize_with = "path_as_text")]
    file: PathBuf,
    /// False if it was already finished.
    computed: bool,
}

impl FinishedShard {
    /// Returns the shard as a line of text.
    fn line(&self, shards: usize) -> String {
        let name = format!("shard {}/{shards}", self.shard);
        if self.computed {
            format!("{name}: {} rows in {}", self.rows, self.file.display())
        } else {
            format!("{name}: already finished")
        }
    }
}

fn compute_shard(
    arguments: &ShardArguments,
    manifest: &Manifest,
    understood: &Understood,
    shard: usize,
) -> Result<FinishedShard, CommandError> {
    let folder = &arguments.place.folder;
    let path = shard_file::path(folder, shard);
    let name = format!("shard {shard}/{}", manifest.shards);
    let share = Share::new(understood.table.as_ref(), shard, manifest.shards);
    let finished = |computed| FinishedShard {
        shard,
        rows: share.rows().len(),
        file: path.clone(),
        computed,
    };
    distinct_files::check_distinct(&[("the shard", &path)])?;
    if path.exists() {
        match shard_file::read(&path, manifest) {
            Ok(found) if found.shard == shard => return Ok(finished(false)),
            Ok(found) => warn(format_args!(
                "{} holds shard {}: computed again",
                path.display(),
                found.shard
            )),
            Err(reason) => warn(format_args!("{} {reason}: computed again", path.display())),
        }
    } else {
        // An unwritable path is reported before anything is computed.
        AtomicFile::create(&path).map_err(output)?;
    }
    let records = arguments
        .threads
        .compute(&name, &share, Shown::with_json(arguments.json))?;
    Manifest::check_files(folder, &understood.files)?;
    shard_file::write(folder, manifest, shard, share.rows(), &records)?;
    Ok(finished(true))
}

fn status(arguments: &StatusArguments) -> Result<(), CommandError> {
    let folder = &arguments.place.folder;
    let manifest = Manifest::load(folder)?;
    let status = folder::status(folder, &manifest)?;
    let mut table = outcome::table(["sweep", &folder.display().to_string()]);
    table.add_row(["campaign", manifest.campaign_hash()]);
    table.add_row(["study", &manifest.campaign.study]);
    table.add_row(["rows", &status.rows.to_string()]);
    let finished = format!("{} of {}", status.finished, status.shards);
    table.add_row(["finished shards", &finished]);
    let missing = if status.missing.is_empty() {
        "none"
    } else {
        &status.missing
    };
    table.add_row(["missing shards", missing]);
    for file in &status.unusable {
        table.add_row([file.file.display().to_string(), file.reason.to_string()]);
    }
    for duplicate in &status.duplicates {
        for file in &duplicate.files {
            let reason = format!("is one of several of shard {}", duplicate.shard);
            table.add_row([&file.display().to_string(), &reason]);
        }
    }
    arguments.json.say(&status, table)
}

fn missing(arguments: &MissingArguments) -> Result<(), CommandError> {
    let folder = &arguments.place.folder;
    let manifest = Manifest::load(folder)?;
    let missing = array::syntax(&folder::missing(folder, &manifest)?);
    let result = json!({ "shards": manifest.shards, "missing": missing });
    arguments.json.say(&result, &missing)
}

fn merge(arguments: &MergeArguments) -> Result<(), CommandError> {
    let folder = &arguments.place.folder;
    let manifest = Manifest::load(folder)?;
    let text = folder::merge(folder, &manifest)?;
    let default = folder.join("merged.csv");
    let path = arguments.csv.as_ref().unwrap_or(&default);
    distinct_files::check(&[("--csv", path)])?;
    prepare(path, &text)
        .and_then(AtomicFile::commit)
        .map_err(output)?;
    folder::tidy(folder);
    let result = json!({ "files": [path.display().to_string()], "rows": manifest.rows, "shards": manifest.shards });
    arguments.json.say(
        &result,
        format_args!(
            "{}: {} rows of {} shards",
            path.display(),
            manifest.rows,
            manifest.shards
        ),
    )
}

fn submit_slurm(arguments: &SlurmArguments) -> Result<(), CommandError> {
    let folder = &arguments.place.folder;
    let manifest = Manifest::load(folder)?;
    let array = array::syntax(&folder::missing(folder, &manifest)?);
    if array.is_empty() {
        return arguments.json.say(
            &json!({ "missing": array, "script": null, "command": null }),
            "every shard is finished; merge them with `painleve sweep merge`",
        );
    }
    let job = Job {
        program: &std::env::current_exe()?,
        directory: &std::env::current_dir()?,
        folder: &std::path::absolute(folder)?,
        array: &array,
        cpus: arguments.cpus.get(),
        options: &arguments.options,
    };
    let script = job.script().map_err(SweepError::from)?;
    let default = folder.join("sweep.sbatch");
    let path = arguments.out.as_ref().unwrap_or(&default);
    distinct_files::check_distinct(&[("--out", path)])?;
    atomic_file::write(path, script.as_bytes()).map_err(output)?;
    let command = format!("sbatch {}", outcome::quoted(&path.display().to_string()));
    let result =
        json!({ "missing": array, "script": path.display().to_string(), "command": command });
    arguments.json.say(
        &result,
        format_args!("{}: shards {array}; submit with: {command}", path.display()),
    )
}
