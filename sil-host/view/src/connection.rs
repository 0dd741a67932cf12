//! A connection until it is answered or becomes a WebSocket: the request and the answer together have one
//! deadline, however slowly their bytes come.
//!
//! The head is parsed by `tungstenite`. `tiny_http` starts threads of its own and hands out an upgraded stream whose
//! timeouts cannot be set. The server of the Foxglove SDK serves no page, checks neither token nor origin, and needs `tokio`.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::Error;
use tungstenite::error::ProtocolError;
use tungstenite::handshake::machine::TryParse;
use tungstenite::handshake::server::Request;
use tungstenite::http::{Method, StatusCode};

/// How long a connection may take from its start to its answer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);
/// Longest head of a request, bytes.
const MOST_BYTES: usize = 16 << 10;

/// A connection with a deadline.
pub(crate) struct Connection {
    stream: TcpStream,
    deadline: Instant,
    /// Whether the request is for the head of the answer alone.
    is_for_head: bool,
    /// What came behind the request.
    rest: Vec<u8>,
}

impl Connection {
    pub(crate) fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            deadline: Instant::now() + PATIENCE,
            is_for_head: false,
            rest: Vec::new(),
        }
    }

    /// Reads a request up to its empty line.
    ///
    /// # Errors
    /// With a status if it is not a GET or HEAD request of HTTP/1.1; if the deadline passes.
    pub(crate) fn request(&mut self) -> io::Result<Result<Request, StatusCode>> {
        let mut head = Vec::new();
        let mut part = [0; 1024];
        loop {
            let length = self.read(&mut part)?;
            if length == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            head.extend_from_slice(&part[..length]);
            self.is_for_head = after_head(&head).is_some();
            match parse(&head) {
                Ok(Some((length, request))) => {
                    self.rest = head.split_off(length);
                    return Ok(Ok(request));
                }
                Ok(None) if head.len() <= MOST_BYTES => {}
                Ok(None) => return Ok(Err(StatusCode::BAD_REQUEST)),
                Err(status) => return Ok(Err(status)),
            }
        }
    }

    /// Answers with a page, or with the reason why there is none, and closes the connection.
    pub(crate) fn answer(&mut self, status: StatusCode, kind: &str, body: &str) -> io::Result<()> {
        let length = body.len();
        let allow = match status {
            StatusCode::METHOD_NOT_ALLOWED => "Allow: GET, HEAD\r\n",
            _ => "",
        };
        let body = if self.is_for_head { "" } else { body };
        let answer = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {length}\r\n\
             Cache-Control: no-store\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
             {allow}Connection: close\r\n\r\n{body}"
        );
        self.write_all(answer.as_bytes())?;
        if status == StatusCode::METHOD_NOT_ALLOWED {
            // A body that nobody reads would end the connection before the answer.
            self.stream.shutdown(Shutdown::Write)?;
            while self.read(&mut [0; 4096])? > 0 {}
        }
        Ok(())
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

/// Returns what follows the method of a HEAD request; empty lines may come before.
fn after_head(head: &[u8]) -> Option<&[u8]> {
    head.trim_ascii_start().strip_prefix(b"HEAD ")
}

/// Parses a request, if its head is complete, and returns the length of the head.
fn parse(head: &[u8]) -> Result<Option<(usize, Request)>, StatusCode> {
    let refused = match Request::try_parse(head) {
        Ok(parsed) => return Ok(parsed),
        Err(error) => error,
    };
    if !matches!(refused, Error::Protocol(ProtocolError::WrongHttpMethod)) {
        return Err(StatusCode::BAD_REQUEST);
    }
    // `tungstenite` knows no other method than GET.
    let rest = after_head(head).ok_or(StatusCode::METHOD_NOT_ALLOWED)?;
    let get = [b"GET ", rest].concat();
    let parsed = Request::try_parse(&get).map_err(|_| StatusCode::BAD_REQUEST)?;
    Ok(parsed.map(|(length, mut request)| {
        *request.method_mut() = Method::HEAD;
        (length + head.len() - get.len(), request)
    }))
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
