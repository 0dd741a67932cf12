//! A connection until it is answered or becomes a WebSocket: the request and the answer together have one
//! deadline, however slowly their bytes come.
//!
//! The head is parsed by `tungstenite`. `tiny_http` starts threads of its own and hands out an upgraded stream whose
//! timeouts cannot be set. The server of the Foxglove SDK serves no page, checks neither token nor origin, and needs `tokio`.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use tungstenite::handshake::machine::TryParse;
use tungstenite::handshake::server::Request;
use tungstenite::http::StatusCode;

/// How long a connection may take from its start to its answer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);
/// Longest head of a request, bytes.
const MOST_BYTES: usize = 16 << 10;

/// A connection with a deadline.
pub(crate) struct Connection {
    stream: TcpStream,
    deadline: Instant,
    /// What came behind the request.
    rest: Vec<u8>,
}

impl Connection {
    pub(crate) fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            deadline: Instant::now() + PATIENCE,
            rest: Vec::new(),
        }
    }

    /// Reads a request up to its empty line.
    ///
    /// # Errors
    /// With a status if it is not a GET request of HTTP/1.1; if the deadline passes.
    pub(crate) fn request(&mut self) -> io::Result<Result<Request, StatusCode>> {
        let mut head = Vec::new();
        let mut part = [0; 1024];
        loop {
            let length = self.read(&mut part)?;
            if length == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            head.extend_from_slice(&part[..length]);
            match Request::try_parse(&head) {
                Ok(Some((length, request))) => {
                    self.rest = head.split_off(length);
                    return Ok(Ok(request));
                }
                Ok(None) if head.len() <= MOST_BYTES => {}
                _ => return Ok(Err(StatusCode::BAD_REQUEST)),
            }
        }
    }

    /// Answers with a page, or with the reason why there is none, and closes the connection.
    pub(crate) fn answer(&mut self, status: StatusCode, kind: &str, body: &str) -> io::Result<()> {
        let length = body.len();
        let answer = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\n\
             Cache-Control: no-store\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
             Connection: close\r\n\r\n{body}"
        );
        self.write_all(answer.as_bytes())
    }

    /// The stream, and what has been read of it behind the request.
    pub(crate) fn into_parts(self) -> (TcpStream, Vec<u8>) {
        (self.stream, self.rest)
    }

    /// Time until the deadline.
    fn time_left(&self) -> io::Result<Option<Duration>> {
        let rest = self.deadline.saturating_duration_since(Instant::now());
        if rest.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        Ok(Some(rest))
    }
}

impl Read for Connection {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(self.time_left()?)?;
        self.stream.read(bytes)
    }
}

impl Write for Connection {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(self.time_left()?)?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}
