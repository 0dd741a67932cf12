//! A serial port of which this process has exclusive use: 921,600 baud, 8N1, without flow control.
//!
//! Two hosts on one line would each get part of the board's answers. Two locks keep the second one out:
//! `flock`, which even root respects, and the terminal's exclusive mode, which also stops programs that know
//! nothing of `flock`.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

use nix::errno::Errno;
use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{
    BaudRate, ControlFlags, FlushArg, SetArg, cfmakeraw, cfsetspeed, tcflush, tcgetattr, tcsetattr,
};
use rustix::termios::{ioctl_tiocexcl, ioctl_tiocnxcl};

use crate::BoardError;

/// A line to a board, with a clock.
pub trait Port {
    /// Reads what has arrived, after at most `limit`; returns the number of bytes, 0 if there are none.
    ///
    /// # Errors
    /// [`BoardError::Unplugged`], or [`BoardError::System`] if the port fails in another way.
    fn read(&mut self, bytes: &mut [u8], limit: Duration) -> Result<usize, BoardError>;

    /// Writes all bytes within `limit`.
    ///
    /// # Errors
    /// [`BoardError::Deaf`] if they have not been taken in time; otherwise as [`Port::read`].
    fn write(&mut self, bytes: &[u8], limit: Duration) -> Result<(), BoardError>;

    /// Returns the time since some instant.
    fn now(&self) -> Duration;
}

/// An open port. No call waits longer than it is told to.
pub struct SerialPort {
    file: File,
    opened: Instant,
}

impl SerialPort {
    /// Opens the port and discards what it has received before.
    ///
    /// # Errors
    /// [`BoardError::InUse`] if another program has opened it, [`BoardError::Port`] if it cannot be used.
    pub(crate) fn open(path: &Path) -> Result<Self, BoardError> {
        let unusable = |source: io::Error| match source.kind() {
            ErrorKind::ResourceBusy => BoardError::InUse(path.into()),
            _ => BoardError::Port {
                path: path.into(),
                source,
            },
        };
        // A blocking port would wait for a modem's carrier here, and for a full queue in `write`.
        let flags = OFlag::O_NOCTTY | OFlag::O_NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits())
            .open(path)
            .map_err(unusable)?;
        // No setting is touched before the port is ours.
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(BoardError::InUse(path.into())),
            Err(TryLockError::Error(error)) => return Err(unusable(error)),
        }
        configure(&file).map_err(unusable)?;
        let opened = Instant::now();
        Ok(Self { file, opened })
    }

    fn is_ready(&self, event: PollFlags, limit: Duration) -> Result<bool, BoardError> {
        // Rounded up, so that the last fraction of a millisecond is not spent polling.
        let limit = PollTimeout::try_from(limit + Duration::from_millis(1));
        let mut ports = [PollFd::new(self.file.as_fd(), event)];
        match poll(&mut ports, limit.unwrap_or(PollTimeout::MAX)) {
            Ok(0) | Err(Errno::EINTR) => Ok(false),
            Ok(_) => Ok(true),
            Err(error) => Err(failure(error.into())),
        }
    }
}

impl Port for SerialPort {
    fn read(&mut self, bytes: &mut [u8], limit: Duration) -> Result<usize, BoardError> {
        if !self.is_ready(PollFlags::POLLIN, limit)? {
            return Ok(0);
        }
        match self.file.read(bytes) {
            Ok(0) => Err(BoardError::Unplugged),
            Ok(length) => Ok(length),
            Err(error) if is_passing(&error) => Ok(0),
            Err(error) => Err(failure(error)),
        }
    }

    fn write(&mut self, mut bytes: &[u8], limit: Duration) -> Result<(), BoardError> {
        let start = Instant::now();
        while !bytes.is_empty() {
            match self.file.write(bytes) {
                Ok(length) => bytes = &bytes[length..],
                Err(error) if is_passing(&error) => {
                    let left = limit.saturating_sub(start.elapsed());
                    if left.is_zero() {
                        return Err(BoardError::Deaf(limit));
                    }
                    self.is_ready(PollFlags::POLLOUT, left)?;
                }
                Err(error) => return Err(failure(error)),
            }
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }
}

/// Ends the exclusive mode, which would outlast this process while another program has the port open.
impl Drop for SerialPort {
    fn drop(&mut self) {
        let _ = ioctl_tiocnxcl(&self.file);
    }
}

fn configure(file: &File) -> io::Result<()> {
    let mut settings = tcgetattr(file)?;
    ioctl_tiocexcl(file)?;
    cfmakeraw(&mut settings);
    settings.control_flags.remove(ControlFlags::CRTSCTS);
    let receive_without_modem = ControlFlags::CLOCAL | ControlFlags::CREAD;
    settings.control_flags.insert(receive_without_modem);
    cfsetspeed(&mut settings, BaudRate::B921600)?;
    tcsetattr(file, SetArg::TCSANOW, &settings)?;
    tcflush(file, FlushArg::TCIOFLUSH)?;
    Ok(())
}

/// Returns whether the same call may succeed later.
fn is_passing(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

fn failure(error: io::Error) -> BoardError {
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::EIO | Errno::ENODEV | Errno::ENXIO) => BoardError::Unplugged,
        _ => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::pty::openpty;
    use nix::unistd::ttyname;

    const SOON: Duration = Duration::from_millis(50);

    #[test]
    fn no_state_of_a_port_holds_its_user() {
        let pair = openpty(None, None).unwrap();
        let path = ttyname(&pair.slave).unwrap();
        let mut port = SerialPort::open(&path).unwrap();
        let taken = SerialPort::open(&path).err();
        assert!(matches!(taken, Some(BoardError::InUse(_))), "{taken:?}");

        let mut bytes = [0; 16];
        assert_eq!(port.read(&mut bytes, SOON).unwrap(), 0);
        // Nobody reads at the other end.
        let deaf = port.write(&[1; 1 << 20], SOON).err();
        assert!(matches!(deaf, Some(BoardError::Deaf(_))), "{deaf:?}");

        drop(port);
        let mut port = SerialPort::open(&path).unwrap();
        drop(pair.master);
        let gone = port.read(&mut bytes, SOON).err();
        assert!(matches!(gone, Some(BoardError::Unplugged)), "{gone:?}");
        let gone = port.write(&bytes, SOON).err();
        assert!(matches!(gone, Some(BoardError::Unplugged)), "{gone:?}");
    }
}
