//! `cargo xtask dist`: makes what a maintainer publishes, in `target/dist`.
//!
//! Everything is built in a target folder of its own, without the names of this machine's folders in it. The command is static,
//! with glibc: iceoryx2 0.9 does not compile with musl, and 0.10, which does, allocates memory for every frame that the ends of
//! the bus exchange. The wheels need an old glibc, for which Zig links.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use clap::Args;

use crate::command::{ChoreError, answer, cargo, output, run, run_with, say, starts, workspace};
use crate::files::{copy, unwritable};
use crate::{boards, build_fw, fmu, python, size};

/// Options of `cargo xtask dist`.
#[derive(Debug, Args)]
pub struct DistArguments {
    /// Make only some parts; may be repeated.
    #[arg(long = "part", value_enum)]
    parts: Vec<Part>,
}

/// What is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// The command, for each processor.
    Command,
    /// The Python package, for each processor.
    Wheel,
    /// The boards' images, with their limits.
    Images,
    /// The plant as an FMU for this computer.
    Fmu,
    /// The dependencies of the command with their versions and licences.
    Sbom,
}

const ALL: [Part; 5] = [
    Part::Command,
    Part::Wheel,
    Part::Images,
    Part::Fmu,
    Part::Sbom,
];

const FOLDER: &str = "target/dist";
const TARGET: &str = "target/dist-build";
const ENVIRONMENT: &str = "target/python/dist";
const SBOM_TOOL: &str = "target/tools/bin/cargo-sbom";

/// Exact versions, because another linker makes other files.
const TOOLS: [&str; 4] = [
    "ziglang==0.17.1",
    "cargo-zigbuild==0.24.1",
    "maturin==1.16.0",
    "auditwheel==6.8.2",
];

/// Processors of Linux machines.
const PROCESSORS: [&str; 2] = ["x86_64", "aarch64"];

/// A function that the crate libc calls by its version in the shared glibc of each processor. A static one has only the name.
const FUNCTION: &str = "cfsetspeed";
const VERSIONS: [&str; 2] = ["GLIBC_2.2.5", "GLIBC_2.17"];

/// The tag of wheels that work with the oldest glibc with which Rust's standard library works.
const WHEEL_TAG: &str = "manylinux_2_17";

/// Longest time for installing a wheel and one run, s.
const WHEEL_S: f64 = 10.0;

/// Makes the parts, installs command and wheel where there is nothing else, and writes the checksums.
///
/// # Errors
/// If a tool cannot be installed, a build fails, or what was made does not work.
pub fn run_chore(arguments: &DistArguments) -> Result<(), ChoreError> {
    let parts = match &arguments.parts[..] {
        [] => &ALL[..],
        parts => parts,
    };
    let folder = workspace().join(FOLDER);
    if arguments.parts.is_empty() && folder.exists() {
        // Files of another version would be published too.
        fs::remove_dir_all(&folder).map_err(|cause| unwritable(&folder, &cause))?;
    }
    let dist = Dist::new(folder)?;
    for part in parts {
        match part {
            Part::Command => dist.command()?,
            Part::Wheel => dist.wheel()?,
            Part::Images => dist.images()?,
            Part::Fmu => dist.fmu()?,
            Part::Sbom => dist.sbom()?,
        }
    }
    dist.checksums()
}

/// The folder of what is published, and how it is built.
struct Dist {
    folder: PathBuf,
    /// An option of cargo: no names of folders of this machine.
    config: String,
    /// Variables of the environment.
    variables: Vec<(&'static str, String)>,
}

impl Dist {
    /// Installs the tools.
    fn new(folder: PathBuf) -> Result<Self, ChoreError> {
        fs::create_dir_all(&folder).map_err(|cause| unwritable(&folder, &cause))?;
        python::environment(ENVIRONMENT, &TOOLS)?;
        for target in PROCESSORS.map(target) {
            if !build_fw::target_is_installed(&target) {
                run("rustup", &["target", "add", &target])?;
            }
        }
        let programs = workspace().join(ENVIRONMENT).join("bin");
        let path = std::env::var("PATH").unwrap_or_default();
        Ok(Self {
            folder,
            config: config(&remapping()),
            variables: vec![
                ("PATH", format!("{}:{path}", programs.display())),
                ("SOURCE_DATE_EPOCH", commit_time()?),
                ("CARGO_INCREMENTAL", "0".into()),
                // Zig writes debug information with paths unless told otherwise.
                ("CFLAGS", "-g0".into()),
            ],
        })
    }

    fn environment(&self) -> Vec<(&str, &str)> {
        let variables = self.variables.iter();
        variables
            .map(|(name, value)| (*name, value.as_str()))
            .collect()
    }

    fn command(&self) -> Result<(), ChoreError> {
        for (processor, version) in PROCESSORS.into_iter().zip(VERSIONS) {
            let target = target(processor);
            let linker = format!("{processor}-linux-gnu-gcc");
            if !starts(&linker) {
                return Err(ChoreError(format!(
                    "{linker} is missing (Debian: gcc-{}-linux-gnu with the libc6-dev of that processor)",
                    processor.replace('_', "-")
                )));
            }
            let flags = [
                "-Ctarget-feature=+crt-static".to_owned(),
                "-Cstrip=symbols".to_owned(),
                format!("-Clinker={linker}"),
                "-Clink-arg=-fuse-ld=bfd".to_owned(),
                format!(
                    "-Clink-arg=-Wl,-u,{FUNCTION},--defsym=\"{FUNCTION}@{version}\"={FUNCTION}"
                ),
            ];
            let config = config(&[&remapping()[..], &flags].concat());
            let build = ["build", "--release", "--locked", "--config", &config];
            let of = [
                "--package",
                "painleve-command",
                "--target",
                &target,
                "--target-dir",
                TARGET,
            ];
            run_with(&cargo(), &[&build[..], &of].concat(), &self.environment())?;
            let built = workspace().join(format!("{TARGET}/{target}/release/painleve"));
            let command = self.folder.join(format!("painleve-{processor}-linux"));
            copy(&built, &command)?;
            check_command(&command)?;
        }
        Ok(())
    }

    fn wheel(&self) -> Result<(), ChoreError> {
        let environment = self.environment();
        for processor in PROCESSORS {
            let target = target(processor);
            let build = [
                "build",
                "--release",
                "--locked",
                "--zig",
                "--strip",
                "--config",
                &self.config,
            ];
            let of = ["--manifest-path", "python/Cargo.toml", "--target", &target];
            let to = [
                "--compatibility",
                "manylinux2014",
                "--target-dir",
                TARGET,
                "--out",
                FOLDER,
            ];
            run_with("maturin", &[&build[..], &of, &to].concat(), &environment)?;
            let wheel = self.wheel_for(processor)?;
            let auditwheel = workspace().join(ENVIRONMENT).join("bin/auditwheel");
            let report = output(Command::new(auditwheel).arg("show").arg(&wheel))?;
            let tag = format!("\"{WHEEL_TAG}_{processor}\"");
            if !report.replace('\n', " ").contains(&format!("tag: {tag}")) {
                return Err(ChoreError(format!(
                    "{} has not the tag {tag}: {report}",
                    wheel.display()
                )));
            }
            if processor == std::env::consts::ARCH {
                check_wheel(&wheel)?;
            }
        }
        Ok(())
    }

    fn wheel_for(&self, processor: &str) -> Result<PathBuf, ChoreError> {
        let start = concat!("painleve-", env!("CARGO_PKG_VERSION"), "-");
        let end = format!("{processor}.whl");
        let files = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        // A folder that is not emptied may hold those of other versions.
        let found = files.map(|file| file.path()).find(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(start) && name.ends_with(&end)
        });
        found.ok_or_else(|| ChoreError(format!("maturin has made no wheel for {processor}")))
    }

    fn images(&self) -> Result<(), ChoreError> {
        let boards = boards::all()?;
        let mut selection = vec![
            "--profile",
            build_fw::PROFILE,
            "--bins",
            "--locked",
            "--config",
            &self.config,
        ];
        for board in &boards {
            selection.extend(["--package", &board.package]);
        }
        let images: Vec<_> = boards.iter().flat_map(|board| &board.images).collect();
        build_fw::build(
            build_fw::TARGET,
            &selection,
            TARGET,
            build_fw::PROFILE,
            &images,
        )?;
        for image in images {
            let built = format!(
                "{TARGET}/{}/{}/{image}",
                build_fw::TARGET,
                build_fw::PROFILE
            );
            size::check_image(image, &workspace().join(&built))?;
            copy(
                &workspace().join(&built),
                &self.folder.join(format!("{image}.elf")),
            )?;
            for (format, end) in [("binary", "bin"), ("ihex", "hex")] {
                convert(&["-O", format], &built, &format!("{FOLDER}/{image}.{end}"))?;
            }
        }
        copy(
            &workspace().join("tests/budget.json"),
            &self.folder.join("budget.json"),
        )
    }

    fn fmu(&self) -> Result<(), ChoreError> {
        // Its bundler starts cargo itself, which hands on only the environment.
        let flags = remapping().join(" ");
        let environment = [("RUSTFLAGS", flags.as_str()), ("CARGO_INCREMENTAL", "0")];
        let fmu = fmu::build(TARGET, &environment)?;
        copy(&fmu, &self.folder.join("painleve.fmu"))
    }

    fn sbom(&self) -> Result<(), ChoreError> {
        let tool = workspace().join(SBOM_TOOL);
        if !tool.exists() {
            run(
                &cargo(),
                &[
                    "install",
                    "cargo-sbom@0.10.0",
                    "--locked",
                    "--root",
                    "target/tools",
                ],
            )?;
        }
        let sbom = output(Command::new(&tool).current_dir(workspace()).args([
            "sbom",
            "--cargo-package",
            "painleve-command",
            "--output-format",
            "cyclone_dx_json_1_4",
        ]))?;
        let path = self.folder.join("painleve.cdx.json");
        fs::write(&path, sbom).map_err(|cause| unwritable(&path, &cause))
    }

    /// Writes `SHA256SUMS` of all other files.
    fn checksums(&self) -> Result<(), ChoreError> {
        copy(&workspace().join("LICENSE"), &self.folder.join("LICENSE"))?;
        let files = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut names: Vec<_> = files.map(|file| file.file_name()).collect();
        names.retain(|name| name != "SHA256SUMS");
        names.sort();
        let mut sha256sum = Command::new("sha256sum");
        let sums = output(sha256sum.args(names).current_dir(&self.folder))?;
        let path = self.folder.join("SHA256SUMS");
        fs::write(&path, &sums).map_err(|cause| unwritable(&path, &cause))?;
        say(sums.trim_end())
    }
}

fn target(processor: &str) -> String {
    format!("{processor}-unknown-linux-gnu")
}

/// Returns cargo's option for options of the compiler.
fn config(flags: &[String]) -> String {
    format!("target.'cfg(all())'.rustflags={flags:?}")
}

/// Returns the compiler's options that replace the names of this machine's folders.
fn remapping() -> Vec<String> {
    let home = std::env::var("HOME").unwrap_or_default();
    let registry = std::env::var("CARGO_HOME").unwrap_or_else(|_| format!("{home}/.cargo"));
    [
        (workspace().display().to_string(), "/painleve"),
        (registry, "/cargo"),
    ]
    .map(|(folder, name)| format!("--remap-path-prefix={folder}={name}"))
    .into()
}

/// Returns the time of the commit that is built, s since 1970.
fn commit_time() -> Result<String, ChoreError> {
    answer("git", &["log", "-1", "--format=%ct"])
}

/// Converts a program with the `objcopy` of the Rust toolchain.
fn convert(options: &[&str], from: &str, to: &str) -> Result<(), ChoreError> {
    let sysroot = PathBuf::from(answer("rustc", &["--print", "sysroot"])?);
    let host = target(std::env::consts::ARCH);
    let objcopy = sysroot
        .join("lib/rustlib")
        .join(host)
        .join("bin/rust-objcopy");
    let libraries = sysroot.join("lib").display().to_string();
    let line = [options, &[from, to]].concat();
    run_with(
        &objcopy.to_string_lossy(),
        &line,
        &[("LD_LIBRARY_PATH", &libraries)],
    )
}

/// Runs the command in a root with nothing else, one of another processor with the emulator that the kernel starts for it. Says
/// so if this machine has none.
fn check_command(command: &Path) -> Result<(), ChoreError> {
    let start = Command::new(command).arg("--version").output();
    if start.is_err_and(|cause| cause.raw_os_error() == Some(nix::libc::ENOEXEC)) {
        return say(&format!(
            "{} is NOT tested: that needs qemu-user-static and binfmt_misc",
            command.display()
        ));
    }
    let root = tempfile::tempdir().map_err(|cause| ChoreError(format!("no folder: {cause}")))?;
    let root = root.path();
    for folder in ["dev", "proc", "tmp"] {
        fs::create_dir(root.join(folder)).map_err(|cause| unwritable(root, &cause))?;
    }
    copy(command, &root.join("painleve"))?;
    let enter =
        "mount --rbind /dev dev && mount --rbind /proc proc && exec chroot . /painleve run edge";
    let start = Instant::now();
    output(
        Command::new("unshare")
            .args(["--map-root-user", "--mount", "/bin/sh", "-c", enter])
            .env_clear()
            .env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin")
            .current_dir(root),
    )?;
    if !root.join("out/run.html").exists() {
        return Err(ChoreError(format!("{} writes no page", command.display())));
    }
    let seconds = start.elapsed().as_secs_f64();
    say(&format!(
        "{} runs where nothing else is: {seconds:.1} s",
        command.display()
    ))
}

/// Installs a wheel in a new environment without programs and without the package index, and runs a scenario.
fn check_wheel(wheel: &Path) -> Result<(), ChoreError> {
    let folder = tempfile::tempdir().map_err(|cause| ChoreError(format!("no folder: {cause}")))?;
    let environment = folder.path().to_string_lossy();
    run("python3", &["-m", "venv", &environment])?;
    let python = folder.path().join("bin/python");
    let wheel = wheel.to_string_lossy();
    let install = ["-m", "pip", "install", "--quiet", "--no-index", &wheel];
    let one_run = [
        "-c",
        "import painleve; assert painleve.run('edge')['time_s'][-1] > 5.9",
    ];
    let start = Instant::now();
    for line in [&install[..], &one_run] {
        let status = Command::new(&python)
            .args(line)
            .current_dir(folder.path())
            .env_clear()
            .status();
        if !status.is_ok_and(|status| status.success()) {
            return Err(ChoreError(format!(
                "{wheel}: `python {}` fails",
                line.join(" ")
            )));
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    say(&format!("{wheel} is installed and runs: {seconds:.1} s"))?;
    if seconds > WHEEL_S {
        return Err(ChoreError(format!("that is more than {WHEEL_S} s")));
    }
    Ok(())
}
