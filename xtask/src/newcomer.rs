//! `cargo xtask newcomer`: ten tasks of a new user, each one command, where there is neither compiler nor this repository.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::command::{ChoreError, run, say, workspace};
use crate::files::unwritable;
use crate::under_test::{build_program, program};
use crate::{build_fw, python, setup};

const FOLDER: &str = "target/newcomer";

/// What the last tasks need beside the package: programs that others have written.
const TOOLS: [&str; 3] = ["mcap-ros2-support", "nbconvert", "ipykernel"];

/// Files of the repository that the user has.
const FILES: [&str; 2] = [
    "examples/two-link.urdf",
    "python/notebooks/bounce_and_edge.ipynb",
];

/// Longest time from the wheel to the first figure, s: the first two tasks.
const FIRST_FIGURE_S: f64 = 60.0;

/// A task of a new user.
struct Task {
    what: &'static str,
    command: &'static str,
    /// A file that it writes; none if empty.
    writes: &'static str,
    /// What it prints.
    prints: &'static str,
}

const TASKS: [Task; 10] = [
    Task {
        what: "install the wheel",
        command: r#"python -m pip install "$WHEEL[plot]""#,
        writes: "",
        prints: "Successfully installed",
    },
    Task {
        what: "first run",
        command: r#"python -c "import painleve; painleve.plot(painleve.run('edge')).savefig('first.svg')""#,
        writes: "first.svg",
        prints: "",
    },
    Task {
        what: "own gains compared",
        command: r#"python -c "from painleve import *; print(compare(run('edge'), run('edge', {'controller.law.hybrid.velocity_gain_per_s': 200.0})))""#,
        writes: "",
        prints: "normal_force_n",
    },
    Task {
        what: "Bode plot with margins",
        command: "painleve study loop --controller hybrid --tip 0.08 --svg bode.svg",
        writes: "bode.svg",
        prints: "phase",
    },
    Task {
        what: "tuned gains saved",
        command: "painleve tune edge --key controller.law.hybrid.velocity_gain_per_s=40:400 --trials 16 --cases 1 --out tuned.toml",
        writes: "tuned.toml",
        prints: "in cases that the search has not seen",
    },
    Task {
        what: "two frictions overlaid",
        command: r#"python -c "from painleve import *; plot(run('edge'), run('edge', {'belt.friction': 0.5})).savefig('frictions.svg')""#,
        writes: "frictions.svg",
        prints: "",
    },
    Task {
        what: "a board's record against the simulation",
        command: "painleve compare run.mcap board.mcap --html compare.html",
        writes: "compare.html",
        prints: "Normal force fₙ (N)",
    },
    Task {
        what: "an arm from URDF",
        command: "painleve arm two-link.urdf",
        writes: "",
        prints: "link_inertia_kg_m2",
    },
    Task {
        what: "a ROS 2 bag opened",
        command: r#"python -c "from mcap_ros2.reader import *; print({type(message.ros_msg).__name__ for message in read_ros2_messages('run.ros2.mcap')})""#,
        writes: "",
        prints: "JointState",
    },
    Task {
        what: "the notebook executed",
        command: "python -m nbconvert --to html --execute --output-dir . bounce_and_edge.ipynb",
        writes: "bounce_and_edge.html",
        prints: "",
    },
];

/// Executes the tasks in `target/newcomer` with the wheel of `cargo xtask python` and the program under test.
///
/// # Errors
/// If the wheel has not been built, a task fails, or the first figure takes too long.
pub fn run_chore() -> Result<(), ChoreError> {
    setup::require_virtual_environments()?;
    build_fw::run()?;
    build_program()?;
    let user = User::new()?;
    let mut seconds = Vec::new();
    for (number, task) in (1..).zip(&TASKS) {
        let start = Instant::now();
        user.perform(task)?;
        let took = start.elapsed().as_secs_f64();
        seconds.push(took);
        say(&format!("{number:>2}. {}: {took:.1} s", task.what))?;
    }
    let first_figure_s: f64 = seconds.iter().take(2).sum();
    if first_figure_s > FIRST_FIGURE_S {
        return Err(ChoreError(format!(
            "from the wheel to the first figure: {first_figure_s:.0} s, more than {FIRST_FIGURE_S} s"
        )));
    }
    Ok(())
}

/// A folder and the programs of a user.
struct User {
    folder: PathBuf,
    wheel: PathBuf,
    /// The only folders with programs.
    path: String,
}

impl User {
    /// Makes a new folder with records of a run and of a board, which the board's image stands for, in an emulator.
    fn new() -> Result<Self, ChoreError> {
        let folder = workspace().join(FOLDER);
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(|cause| unwritable(&folder, &cause))?;
        }
        let programs = folder.join("bin");
        fs::create_dir_all(&programs).map_err(|cause| unwritable(&programs, &cause))?;
        let link = programs.join("painleve");
        symlink(program(), &link).map_err(|cause| unwritable(&link, &cause))?;
        for file in FILES.map(|file| workspace().join(file)) {
            let copy = folder.join(file.file_name().unwrap_or_default());
            fs::copy(&file, &copy).map_err(|cause| unwritable(&copy, &cause))?;
        }
        python::environment(&format!("{FOLDER}/venv"), &TOOLS)?;
        let program = program().to_string_lossy().into_owned();
        let [record, board] = ["run", "board"].map(|name| format!("{FOLDER}/{name}.mcap"));
        let simulate = ["run", "--no-plot", "--record"];
        run(&program, &[&simulate[..], &[&record]].concat())?;
        let emulate = ["--host", "qemu"];
        run(&program, &[&simulate[..], &[&board], &emulate].concat())?;
        run(&program, &["export", &record, "--ros2"])?;
        Ok(Self {
            wheel: python::wheel()?,
            path: format!(
                "{}:{}",
                folder.join("venv/bin").display(),
                programs.display()
            ),
            folder,
        })
    }

    /// Performs a task and checks what it has made.
    fn perform(&self, task: &Task) -> Result<(), ChoreError> {
        let failed = |why: &str| ChoreError(format!("{}: `{}` {why}", task.what, task.command));
        eprintln!("$ {}", task.command);
        let output = Command::new("/bin/sh")
            .args(["-c", task.command])
            .current_dir(&self.folder)
            .env_clear()
            .env("PATH", &self.path)
            .env("WHEEL", &self.wheel)
            .env("HOME", std::env::var_os("HOME").unwrap_or_default())
            .env("MPLBACKEND", "svg")
            .output()
            .map_err(|cause| failed(&format!("cannot be started: {cause}")))?;
        let [printed, errors] =
            [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        if !output.status.success() {
            return Err(failed(&format!("fails: {errors}")));
        }
        if !printed.contains(task.prints) {
            return Err(failed(&format!(
                "does not print '{}': {printed}",
                task.prints
            )));
        }
        let written = self.folder.join(task.writes);
        let is_written = |path: &Path| fs::metadata(path).is_ok_and(|file| file.len() > 0);
        if !is_written(&written) {
            return Err(failed(&format!("does not write {}", task.writes)));
        }
        Ok(())
    }
}
