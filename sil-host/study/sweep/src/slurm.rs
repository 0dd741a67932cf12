//! The job script for Slurm, with one array task per shard.

use std::path::{Path, PathBuf};

use painleve_study_core::outcome::quoted;

/// Settings of the job script.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Absolute path of the `painleve` program.
    pub program: &'a Path,
    /// Absolute path of the working directory.
    pub directory: &'a Path,
    /// Absolute path of the sweep's folder.
    pub folder: &'a Path,
    /// Shards to compute, for example `3,7,9-12`.
    pub array: &'a str,
    /// Cores of each task, which are also its threads.
    pub cpus: usize,
    /// Further options of `sbatch`, for example `--time=30`.
    pub options: &'a [String],
}

/// Text that does not fit into a line of the script.
#[derive(Debug, thiserror::Error)]
pub enum ScriptError {
    /// A path.
    #[error(
        "{} cannot appear in a Slurm script; choose a path without quotes, backslashes, % and line ends",
        .0.display()
    )]
    Path(PathBuf),
    /// An option.
    #[error("--option '{0}' is not an option of sbatch; give one, for example --option=--time=30")]
    Option(String),
}

impl Job<'_> {
    /// Returns the script.
    ///
    /// # Errors
    /// [`ScriptError`] if a path or an option does not fit into a line of the script.
    pub fn script(&self) -> Result<String, ScriptError> {
        let text = |path: &Path| match path.to_str() {
            Some(text) if !text.contains(['\n', '"', '\\', '%']) => Ok(text.to_owned()),
            _ => Err(ScriptError::Path(path.to_path_buf())),
        };
        let (program, directory) = (text(self.program)?, text(self.directory)?);
        let folder = text(self.folder)?;
        let mut options = vec![
            "--job-name=painleve-sweep".to_owned(),
            format!("--array={}", self.array),
            format!("--cpus-per-task={}", self.cpus),
            "--ntasks=1".to_owned(),
            // Slurm requeues a task whose node fails; finished shards are skipped.
            "--requeue".to_owned(),
            "--open-mode=append".to_owned(),
            format!("--chdir=\"{directory}\""),
            format!("--output=\"{folder}/slurm-%a.log\""),
        ];
        for option in self.options {
            if !option.starts_with('-') || option.contains('\n') {
                return Err(ScriptError::Option(option.clone()));
            }
            options.push(option.clone());
        }
        let options: String = options
            .iter()
            .map(|option| format!("#SBATCH {option}\n"))
            .collect();
        let (program, folder) = (quoted(&program), quoted(&folder));
        Ok(format!(
            "#!/bin/sh\n{options}\n\
             # The shard is SLURM_ARRAY_TASK_ID.\n\
             exec {program} sweep run --folder {folder} --threads \"${{SLURM_CPUS_PER_TASK:-1}}\"\n"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job<'a>(folder: &'a str, options: &'a [String]) -> Job<'a> {
        Job {
            program: Path::new("/opt/pain levé/painleve"),
            directory: Path::new("/home/x"),
            folder: Path::new(folder),
            array: "0,2-4",
            cpus: 3,
            options,
        }
    }

    #[test]
    fn the_script_is_what_slurm_and_the_shell_read() {
        let script = job("/data/it's", &["--time=30".into()]).script().unwrap();
        for line in [
            "#!/bin/sh",
            "#SBATCH --array=0,2-4",
            "#SBATCH --cpus-per-task=3",
            "#SBATCH --requeue",
            "#SBATCH --output=\"/data/it's/slurm-%a.log\"",
            "#SBATCH --time=30",
            r#"exec '/opt/pain levé/painleve' sweep run --folder '/data/it'\''s' --threads "${SLURM_CPUS_PER_TASK:-1}""#,
        ] {
            assert!(
                script.lines().any(|one| one == line),
                "{line} is not in {script}"
            );
        }
        // Slurm stops reading options at the first command.
        let first = script.lines().position(|line| line.starts_with("exec"));
        let before = script.lines().take(first.unwrap());
        let of_slurm = |line: &&str| line.starts_with("#SBATCH");
        let all = script.lines().filter(of_slurm).count();
        assert_eq!(before.filter(of_slurm).count(), all);
    }

    #[test]
    fn unsuitable_paths_and_options_are_refused() {
        assert!(job("/a\"b", &[]).script().is_err());
        assert!(job("/a\nb", &[]).script().is_err());
        assert!(job("/a", &["time=30".into()]).script().is_err());
        assert!(job("/a", &["--x\nrm".into()]).script().is_err());
    }
}
