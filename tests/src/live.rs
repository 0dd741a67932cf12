//! A live run on a free port, and what is sent to it past a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStderr, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;

use crate::{Bench, signal};

/// Headers of a request that turns a connection into a WebSocket.
pub const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
     Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

/// A live run; killed when dropped.
pub struct LiveRun {
    process: Child,
    stderr: BufReader<ChildStderr>,
    /// Address of the page, as the run prints it.
    pub page: String,
    /// Address for Foxglove, as the run prints it.
    pub foxglove: String,
}

impl LiveRun {
    /// Starts `painleve run` with these arguments and `--live 0`.
    ///
    /// # Panics
    /// If it does not print where it serves.
    pub fn start(bench: &Bench, arguments: &[&str]) -> Self {
        let mut command = bench.command(&["run"]);
        command.args(arguments).args(["--live", "0"]);
        let mut process = command
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start painleve: {error}"));
        let stderr = process.stderr.take().unwrap_or_else(|| unreachable!());
        let mut stderr = BufReader::new(stderr);
        let mut line = String::new();
        // What cannot be read contains no address.
        let _ = stderr.read_line(&mut line);
        let address = |scheme: &str| {
            let word = line
                .split_whitespace()
                .find(|word| word.starts_with(scheme));
            word.unwrap_or_else(|| panic!("no {scheme} in {line:?}"))
                .to_owned()
        };
        Self {
            page: address("http://"),
            foxglove: address("ws://"),
            process,
            stderr,
        }
    }

    /// Address of the page's WebSocket.
    pub fn live(&self) -> String {
        self.page.replacen("http", "ws", 1).replacen(
            &format!("{}/", self.authority()),
            &format!("{}/live", self.authority()),
            1,
        )
    }

    /// Host and port, as they are printed.
    pub fn authority(&self) -> &str {
        self.page.split('/').nth(2).unwrap_or_default()
    }

    /// The query of the printed address, with its question mark; empty if it has none.
    pub fn query(&self) -> &str {
        self.page.find('?').map_or("", |at| &self.page[at..])
    }

    /// Returns a new connection.
    ///
    /// # Panics
    /// If it is refused.
    pub fn connect(&self) -> TcpStream {
        TcpStream::connect(self.authority()).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Sends the head of a request and returns the head of the answer; empty if there is none.
    ///
    /// # Panics
    /// If the connection is refused.
    pub fn knock(&self, path: &str, headers: &str) -> String {
        let mut stream = self.connect();
        let head = format!("GET {path} HTTP/1.1\r\n{headers}\r\n");
        let mut answer = vec![0; 1024];
        let length = stream
            .write_all(head.as_bytes())
            .and_then(|()| stream.read(&mut answer))
            .unwrap_or_default();
        String::from_utf8_lossy(&answer[..length]).into_owned()
    }

    /// The process.
    pub fn id(&self) -> i32 {
        self.process.id().cast_signed()
    }

    /// The largest memory so far, MB.
    pub fn peak_memory_mb(&self) -> f64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id()));
        let status = status.unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with("VmHWM:"));
        let kb = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
        kb.unwrap_or(f64::NAN) / 1024.0
    }

    /// Sends SIGINT, as Ctrl-C does; returns how the run ended, after what time, and what it has printed on
    /// standard error after its first line.
    ///
    /// # Panics
    /// If it is still running after 10 s.
    pub fn interrupt(mut self) -> (ExitStatus, Duration, String) {
        signal(self.id(), Signal::SIGINT);
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(10) {
            if let Ok(Some(status)) = self.process.try_wait() {
                let took = start.elapsed();
                let mut text = String::new();
                let _ = self.stderr.read_to_string(&mut text);
                return (status, took, text);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("still running 10 s after SIGINT");
    }
}

impl Drop for LiveRun {
    fn drop(&mut self) {
        // It runs until it is ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
