//! `painleve export`: the ticks of a record as a table.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use painleve_files::atomic_file::{AtomicFile, AtomicFileError, commit_all};
use painleve_files::input_file;
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;
use painleve_record::export::{ExportError, Exported, ticks_to_csv};
use painleve_record::record_file;
use painleve_record::ros2;
use serde_json::json;

use super::output_error::{InputError, RecordFileError, output};
use super::{CommandError, distinct_files, say};

/// Options of `painleve export`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("formats").args(["csv", "ros2"]).required(true).multiple(true))]
pub struct ExportArguments {
    /// Record of a run, for example out/run.mcap.
    record: PathBuf,
    /// Write CSV, by default beside the record.
    #[arg(long, value_name = "PATH", num_args = 0..=1)]
    csv: Option<Option<PathBuf>>,
    /// Write a ROS 2 bag, by default beside the record.
    #[arg(long, value_name = "PATH", num_args = 0..=1, conflicts_with = "recover")]
    ros2: Option<Option<PathBuf>>,
    /// Export the intact part of a damaged or truncated record: the ticks before the damage.
    #[arg(long)]
    recover: bool,
    /// Print one JSON object on stdout.
    #[arg(long)]
    json: bool,
}

/// A file that gives and takes nothing more once the user has interrupted, so that an output is removed rather than left
/// behind.
struct Interruptible<'a, F> {
    file: F,
    interrupt: &'a Interrupt,
}

impl<F> Interruptible<'_, F> {
    fn check(&self) -> io::Result<()> {
        match self.interrupt.is_requested() {
            true => Err(io::Error::other("interrupted")),
            false => Ok(()),
        }
    }
}

impl<R: Read> Read for Interruptible<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.check()?;
        self.file.read(bytes)
    }
}

impl<W: Write> Write for Interruptible<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check()?;
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.check()?;
        self.file.flush()
    }
}

impl<W: Seek> Seek for Interruptible<'_, W> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}

/// Writes one row per control tick and one column per quantity.
///
/// # Errors
/// [`CommandError`] if the recording cannot be read, the table cannot be written, or the user interrupts.
pub fn run(arguments: &ExportArguments) -> Result<(), CommandError> {
    let interrupt = Interrupt::catch()?;
    match export_all(arguments, &interrupt) {
        Err(_) if interrupt.is_requested() => Err(CommandError::Interrupted),
        outcome => outcome,
    }
}

fn export_all(arguments: &ExportArguments, interrupt: &Interrupt) -> Result<(), CommandError> {
    let record = &arguments.record;
    let beside = |path: &Option<Option<PathBuf>>, extension: &str| {
        let path = path.as_ref()?;
        Some(
            path.clone()
                .unwrap_or_else(|| record.with_extension(extension)),
        )
    };
    let csv = beside(&arguments.csv, "csv");
    let bag = beside(&arguments.ros2, "ros2.mcap");
    let wanted = [("--csv", csv.as_deref()), ("--ros2", bag.as_deref())];
    let wanted: Vec<_> = wanted
        .into_iter()
        .filter_map(|(option, path)| Some((option, path?)))
        .collect();
    let bytes = record_error(
        arguments,
        input_file::open(record).and_then(|file| file.metadata()),
    )?
    .len();
    distinct_files::check(&wanted)?;

    let (mut files, mut exported) = (Vec::new(), None);
    if let Some(path) = &csv {
        let mut file = AtomicFile::create(path).map_err(output)?;
        exported = Some(export(arguments, path, &mut file, interrupt)?);
        files.push(file);
    }
    let mut rows = exported.as_ref().map(|exported| exported.rows);
    if let Some(path) = &bag {
        let (bag, ticks) = export_bag(arguments, path, interrupt)?;
        rows = rows.or(Some(ticks));
        files.push(bag);
    }
    commit_all(files).map_err(output)?;

    let damage = exported.as_ref().and_then(|exported| {
        let reason = exported.damage.as_ref()?.to_string();
        Some((reason, exported))
    });
    if let Some((
        reason,
        Exported {
            rows,
            end_s,
            whole_bytes,
            ..
        },
    )) = &damage
    {
        warn(format_args!(
            "{} is damaged after {whole_bytes} of {bytes} bytes: {reason}; exported the {rows} ticks before, up to \
             {end_s} s",
            record.display()
        ));
    }
    if arguments.json {
        return say(json!({
            "record": record.display().to_string(),
            "rows": rows,
            "files": wanted.iter().map(|(_, path)| path.display().to_string()).collect::<Vec<_>>(),
            "damage": damage.map(|(reason, exported)| {
                json!({ "reason": reason, "whole_bytes": exported.whole_bytes, "bytes": bytes })
            }),
        }));
    }
    for (_, path) in wanted {
        warn(format_args!("wrote {}", path.display()));
    }
    Ok(())
}

/// Opens the record.
fn open<'a>(
    arguments: &ExportArguments,
    interrupt: &'a Interrupt,
) -> Result<BufReader<Interruptible<'a, File>>, CommandError> {
    let file = record_error(arguments, input_file::open(&arguments.record))?;
    let file = Interruptible { file, interrupt };
    Ok(BufReader::with_capacity(1 << 20, file))
}

/// Writes the ticks of the record as CSV to what becomes the file at `path`.
fn export(
    arguments: &ExportArguments,
    path: &Path,
    file: impl Write,
    interrupt: &Interrupt,
) -> Result<Exported, CommandError> {
    let table = Interruptible { file, interrupt };
    let exported = ticks_to_csv(open(arguments, interrupt)?, table);
    let wanted = match exported {
        Ok(exported) if !arguments.recover => exported.whole(),
        exported => exported,
    };
    written(arguments, path, wanted)
}

/// Writes the bag, and returns it with the number of its ticks.
fn export_bag(
    arguments: &ExportArguments,
    path: &Path,
    interrupt: &Interrupt,
) -> Result<(AtomicFile, u64), CommandError> {
    let open = || open(arguments, interrupt);
    let notes = record_file::notes(open()?).map_err(ExportError::from);
    let notes = record_error(arguments, notes)?.unwrap_or_default();
    // Records of earlier versions do not tell when they began.
    let start_ns = notes
        .get("start_unix_ns")
        .and_then(|start| start.parse().ok());
    let file = Interruptible {
        file: AtomicFile::create(path).map_err(output)?,
        interrupt,
    };
    let bag = ros2::to_bag(open()?, start_ns.unwrap_or_default(), file);
    written(arguments, path, bag).map(|(bag, ticks)| (bag.file, ticks))
}

/// Adds the name of the file that was to be written, or of the record, to an error.
fn written<T>(
    arguments: &ExportArguments,
    path: &Path,
    exported: Result<T, ExportError>,
) -> Result<T, CommandError> {
    match exported {
        Err(ExportError::Write(source)) => Err(output(AtomicFileError::Write {
            path: path.to_path_buf(),
            source: source.into(),
        })),
        exported => record_error(arguments, exported),
    }
}

/// Adds the name of the record to an error.
fn record_error<T, E: Into<RecordFileError>>(
    arguments: &ExportArguments,
    result: Result<T, E>,
) -> Result<T, CommandError> {
    result.map_err(|source| InputError::record(&arguments.record, source).into())
}
