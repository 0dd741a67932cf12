//! The image under QEMU, in lockstep.
//!
//! QEMU's semihosting lets the image read requests from one pipe and write its
//! responses to another. While it waits for a request its virtual clock stands
//! still, and under `-icount` every instruction takes the same virtual time: what the image does, and
//! how many instructions it takes, is the same in every run. They are instructions and not
//! cycles: QEMU knows no pipeline, no flash wait states and no bus.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::Signal;
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;
use painleve_firmware::BUILD;
use painleve_plant::Configuration;
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{FrameSource, Health, MAXIMUM_LENGTH, Request, Response};
use painleve_shared::wire;
use painleve_system::lifetime::{Guarded, end_with_parent};

use super::{BoardError, ConnectedBoard, SILENCE_LIMIT, TimedAnswer, log};
use crate::timing::Unit;

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";

/// Where the workspace builds the image, below its target folder.
const IMAGES: &str = "thumbv7em-none-eabihf/firmware";

/// Time between two looks at whether the emulator is alive.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// Instructions to leave room for between two control ticks: tick, link, and back.
/// More only makes the emulator spin longer.
const INSTRUCTIONS_PER_TICK: f32 = 6000.0;

/// The image that the workspace this program was built in has made.
pub fn default_image() -> PathBuf {
    built_image("painleve-qemu")
}

/// The workspace's own build of an image, found from where this program lies; where it would be if
/// there is none.
pub fn built_image(name: &str) -> PathBuf {
    let image = Path::new(IMAGES).join(name);
    let program = std::env::current_exe().unwrap_or_default();
    let mut folders = program.ancestors().skip(1);
    let built = folders.clone().map(|folder| folder.join(&image));
    built
        .into_iter()
        .find(|image| image.exists())
        .or_else(|| folders.nth(1).map(|target| target.join(&image)))
        .unwrap_or(image)
}

/// Checks that image and emulator are there, before anything is started.
///
/// # Errors
/// [`BoardError::ImageMissing`], [`BoardError::EmulatorMissing`].
pub fn check(image: &Path) -> Result<(), BoardError> {
    if !image.is_file() {
        return Err(BoardError::ImageMissing(image.into()));
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    if !std::env::split_paths(&path).any(|folder| folder.join(PROGRAM).is_file()) {
        return Err(BoardError::EmulatorMissing);
    }
    Ok(())
}

/// An image running under QEMU, configured.
///
/// QEMU ends with this value, and with the thread that made it.
pub struct Emulator {
    process: Guarded,
    requests: File,
    responses: File,
    /// 2^shift ns of virtual time are one instruction.
    shift: u32,
}

impl Emulator {
    /// Starts `image` and gives it its configuration. With `with_log` what it says
    /// is printed on stderr.
    ///
    /// # Errors
    /// [`BoardError`], all of them.
    pub fn start(
        image: &Path,
        configuration: &Configuration,
        with_log: bool,
    ) -> Result<Self, BoardError> {
        check(image)?;
        // QEMU runs in a folder of its own.
        let image = image.canonicalize()?;
        let table = with_log
            .then(|| log::LogTable::of_image(&image))
            .transpose()?;
        let folder = tempfile::Builder::new().prefix("painleve-").tempdir()?;
        let pipe = |name| -> io::Result<File> {
            let path = folder.path().join(name);
            mkfifo(&path, Mode::S_IRUSR | Mode::S_IWUSR)?;
            // Both ways, so that opening does not wait for the other side.
            OpenOptions::new().read(true).write(true).open(path)
        };
        let (requests, responses) = (pipe("requests")?, pipe("responses")?);
        let shift = shift_for(configuration.tick_hz);
        let mut command = Command::new(PROGRAM);
        command
            .args(["-machine", "netduinoplus2", "-display", "none"])
            .args(["-monitor", "none", "-serial", "none", "-nodefaults"])
            .args(["-icount", &format!("shift={shift},sleep=off")])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-kernel")
            .arg(&image)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(if with_log {
                Stdio::piped()
            } else {
                Stdio::null()
            });
        let child = end_with_parent(&mut command, Signal::SIGKILL).spawn()?;
        let mut emulator = Self {
            process: Guarded::new(child),
            requests,
            responses,
            shift,
        };
        if let (Some(table), Some(output)) = (table, emulator.process.child().stdout.take()) {
            table.print_from(output);
        }
        match emulator.request(&Request::Configure {
            build: BUILD,
            source: FrameSource::Lockstep,
            configuration: &super::encode(configuration)?,
        })? {
            Response::Ready { .. } => Ok(emulator),
            Response::Refused => Err(BoardError::Refused),
            Response::OtherBuild { build } => Err(BoardError::other_build(build)),
            other => Err(BoardError::OutOfTurn(other)),
        }
        // The folder goes here: both sides have their pipes open.
    }

    fn request(&mut self, request: &Request<'_>) -> Result<Response, BoardError> {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(request, &mut buffer)?;
        // One write, shorter than a pipe's buffer: it arrives whole and never blocks.
        self.requests.write_all(bytes)?;
        let mut length = 0;
        while length == 0 || buffer[length - 1] != 0 {
            self.wait_for_bytes()?;
            let read = self.responses.read(&mut buffer[length..])?;
            length += read;
            if read == 0 || length == buffer.len() {
                return Err(wire::WireError::Garbage.into());
            }
        }
        Ok(wire::decode(&mut buffer[..length - 1])?)
    }

    fn wait_for_bytes(&mut self) -> Result<(), BoardError> {
        let start = Instant::now();
        loop {
            let look = PollTimeout::try_from(LOOK_INTERVAL).unwrap_or(PollTimeout::ZERO);
            let mut pipes = [PollFd::new(self.responses.as_fd(), PollFlags::POLLIN)];
            match poll(&mut pipes, look) {
                Ok(0) | Err(Errno::EINTR) => {}
                Ok(_) => return Ok(()),
                Err(error) => return Err(io::Error::from(error).into()),
            }
            if let Some(status) = self.process.ended()? {
                return Err(BoardError::Ended(status));
            }
            if start.elapsed() > SILENCE_LIMIT {
                return Err(BoardError::Silent(start.elapsed()));
            }
        }
    }
}

impl ConnectedBoard for Emulator {
    const HOST: &'static str = "qemu";

    fn unit(&self) -> Unit {
        Unit::Instructions
    }

    fn exchange(&mut self, frame: &SensorFrame) -> Result<TimedAnswer, BoardError> {
        match self.request(&Request::Sensor(*frame))? {
            Response::Actuator { frame, elapsed } => Ok(TimedAnswer {
                frame,
                cost: elapsed >> self.shift,
            }),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }

    fn health(&mut self) -> Result<Health, BoardError> {
        match self.request(&Request::Health)? {
            Response::Health(health) => Ok(health),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }
}

impl Drop for Emulator {
    /// By force: a QEMU whose image waits in a pipe ignores requests to end.
    fn drop(&mut self) {
        self.process.kill();
    }
}

/// The slowest processor on which [`INSTRUCTIONS_PER_TICK`] fit into a tick, as QEMU's `shift`.
fn shift_for(tick_hz: f32) -> u32 {
    let ns_per_instruction = 1e9 / tick_hz / INSTRUCTIONS_PER_TICK;
    (ns_per_instruction.log2().floor() as u32).clamp(0, 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faster_loops_get_a_faster_processor() {
        assert_eq!([10.0, 1e3, 1e4, 1e5].map(shift_for), [10, 7, 4, 0]);
    }

    #[test]
    fn a_missing_image_is_named_with_the_command_that_makes_it() {
        let configuration =
            painleve_plant::scenario::Scenario::default().controller_configuration();
        let error = Emulator::start(Path::new("/nowhere/image"), &configuration, false);
        let text = error
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default();
        assert!(text.contains("/nowhere/image"), "{text}");
        assert!(text.contains("cargo xtask build-fw"), "{text}");
    }
}
