//! The image under QEMU, in lockstep.
//!
//! Through QEMU's semihosting the image reads requests from one pipe and writes its responses to
//! another. While it waits for a request, its virtual clock stands still, and under `-icount` every
//! instruction takes the same virtual time. The image's behaviour and its instruction counts are
//! therefore the same in every run. The counts are instructions, not cycles: QEMU models no
//! pipeline, no flash wait states and no bus.

use std::io::{self, PipeReader, PipeWriter, Read, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use command_fds::{CommandFdExt, FdMapping};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::Signal;
use painleve_files::input_file;
use painleve_plant::Configuration;
use painleve_plant::law_choice::build;
use painleve_process::lifetime::{Guarded, end_with_parent};
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{FrameSource, Health, MAXIMUM_LENGTH, Request, Response};
use painleve_shared::wire;

use super::{BoardError, ConnectedBoard, TimedAnswer};
use crate::timing::Unit;

/// The emulator's program.
const PROGRAM: &str = "qemu-system-arm";

/// The program that decodes an image's log, defmt's own.
const LOG_PRINTER: &str = "defmt-print";

/// QEMU's descriptor of the pipe from which the image reads requests, `/dev/fd/100` to the image.
const REQUESTS: i32 = 100;
/// QEMU's descriptor of the pipe to which the image writes responses.
const RESPONSES: i32 = 101;

/// Folder of the images, below the workspace's target folder.
const IMAGES: &str = "thumbv7em-none-eabihf/firmware";

/// Interval between two checks whether the emulator is alive.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// Instructions allowed between two control ticks: the tick, the link, and back. A larger value
/// only makes the emulator spin longer.
const INSTRUCTIONS_PER_TICK: f32 = 6000.0;

/// Returns the path of the image in the workspace that built this program.
pub fn default_image() -> PathBuf {
    built_image("painleve-f405")
}

/// Returns the path of the workspace's own build of an image, relative to this program. The image
/// need not exist.
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

/// Checks that the image exists, and that the emulator and, `with_log`, the program that prints the image's log start.
/// This also reads them from a disk that may be slow, before any limit of time applies.
///
/// # Errors
/// [`BoardError::ImageMissing`], [`BoardError::NotAnImage`], [`BoardError::EmulatorMissing`],
/// [`BoardError::LogPrinterMissing`].
pub fn check(image: &Path, with_log: bool) -> Result<(), BoardError> {
    if !image.is_file() {
        return Err(BoardError::ImageMissing(image.into()));
    }
    // From now on it is known as an input.
    let mut header = [0; 20];
    let read = input_file::open(image).and_then(|mut file| file.read_exact(&mut header));
    let is_image = match read {
        // 32 bits, for ARM.
        Ok(()) => header.starts_with(b"\x7fELF\x01") && header.ends_with(&[40, 0]),
        // An image that cannot be read is reported where it is read; an empty one is an invalid input.
        Err(error) => !matches!(
            error.kind(),
            io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput
        ),
    };
    if !is_image {
        return Err(BoardError::NotAnImage(image.into()));
    }
    if !is_installed(PROGRAM) {
        return Err(BoardError::EmulatorMissing);
    }
    if with_log && !is_installed(LOG_PRINTER) {
        return Err(BoardError::LogPrinterMissing);
    }
    Ok(())
}

fn is_installed(program: &str) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdin(Stdio::null());
    let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// Starts the program that prints the log of `image` on stderr, and returns its end for the log. It ends with the log.
fn log_printer(image: &Path) -> Result<Stdio, BoardError> {
    let (log, log_end) = io::pipe()?;
    Command::new(LOG_PRINTER)
        .arg("-e")
        .arg(image)
        .stdin(log)
        .stdout(io::stderr().as_fd().try_clone_to_owned()?)
        .spawn()?;
    Ok(log_end.into())
}

/// A configured image running under QEMU.
///
/// QEMU ends when this value is dropped or the thread that created it ends.
pub struct Emulator {
    process: Guarded,
    requests: PipeWriter,
    responses: PipeReader,
    /// QEMU's ends. Held here too, a pipe of an ended QEMU stays whole, and the error is its exit
    /// status instead of a broken pipe.
    _ends: (PipeReader, PipeWriter),
    silence_limit: Duration,
    /// One instruction takes 2^shift ns of virtual time.
    shift: u32,
}

impl Emulator {
    /// Starts `image` and sends it its configuration. With `with_log`, prints the image's log on
    /// stderr through `defmt-print`. An image that is silent for longer than `silence_limit` is an error.
    ///
    /// # Errors
    /// Any [`BoardError`].
    pub fn start(
        image: &Path,
        configuration: &Configuration,
        with_log: bool,
        silence_limit: Duration,
    ) -> Result<Self, BoardError> {
        check(image, with_log)?;
        let printer = with_log.then(|| log_printer(image)).transpose()?;
        // Pipes without names leave nothing behind, whenever a process is killed.
        let (request_end, requests) = io::pipe()?;
        let (responses, response_end) = io::pipe()?;
        let shift = shift_for(configuration.tick_hz);
        let mut command = Command::new(PROGRAM);
        command
            .args(["-machine", "netduinoplus2", "-display", "none"])
            .args(["-monitor", "none", "-serial", "none", "-nodefaults"])
            .args(["-icount", &format!("shift={shift},sleep=off")])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(printer.unwrap_or_else(Stdio::null));
        command
            .fd_mappings(vec![
                FdMapping {
                    parent_fd: request_end.try_clone()?.into(),
                    child_fd: REQUESTS,
                },
                FdMapping {
                    parent_fd: response_end.try_clone()?.into(),
                    child_fd: RESPONSES,
                },
            ])
            .map_err(io::Error::other)?;
        let child = end_with_parent(&mut command, Signal::SIGKILL).spawn()?;
        let mut emulator = Self {
            process: Guarded::new(child),
            requests,
            responses,
            _ends: (request_end, response_end),
            silence_limit,
            shift,
        };
        match emulator.request(&Request::Configure {
            build: build(),
            source: FrameSource::Lockstep,
            configuration: &super::encode(configuration)?,
        })? {
            Response::Ready { .. } => {}
            Response::Refused => return Err(BoardError::Refused),
            Response::OtherBuild { build } => return Err(BoardError::other_build(build)),
            other => return Err(BoardError::OutOfTurn(other)),
        }
        // An emulated run promises the same bits as one in this program.
        match emulator.request(&Request::Sources)? {
            Response::Sources(board) => BoardError::compare_sources(board).map(|()| emulator),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }

    /// Sends bytes as they are, as a disturbed link delivers them; nothing is received.
    ///
    /// # Errors
    /// [`BoardError::System`] if the emulator's pipe fails.
    pub fn send_raw(&mut self, bytes: &[u8]) -> Result<(), BoardError> {
        Ok(self.requests.write_all(bytes)?)
    }

    fn request(&mut self, request: &Request<'_>) -> Result<Response, BoardError> {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(request, &mut buffer)?;
        // A single write, shorter than a pipe's buffer, arrives whole and never blocks.
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
        // Counts looks instead of time: the time passes also while this process is stopped together with QEMU.
        let mut silence = Duration::ZERO;
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
            silence += LOOK_INTERVAL;
            if silence >= self.silence_limit {
                return Err(BoardError::Silent(silence));
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
    /// Kills QEMU, because it ignores requests to end while its image waits in a pipe.
    fn drop(&mut self) {
        self.process.kill();
    }
}

/// Returns the slowest processor, as QEMU's `shift`, on which [`INSTRUCTIONS_PER_TICK`] fit into a
/// tick.
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
    fn the_error_about_a_missing_image_names_it_and_the_build_command() {
        let configuration =
            painleve_plant::scenario::Scenario::default().controller_configuration();
        let error = Emulator::start(
            Path::new("/nowhere/image"),
            &configuration,
            false,
            crate::SILENCE_LIMIT,
        );
        let text = error
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default();
        assert!(text.contains("/nowhere/image"), "{text}");
        assert!(text.contains("cargo xtask build-fw"), "{text}");
    }
}
