//! The live page on this machine: HTTP and WebSocket on one port of the loopback interface.
//!
//! Only pages that this server itself has sent may connect: requests for another host (DNS rebinding) and
//! from another origin are refused. Each viewer has a thread of its own, which sends what the run has
//! [published](Hub::publish) about 60 times a second; a viewer that is too slow loses rows, never
//! the run time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use serde::Deserialize;
use serde_json::Value;
use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

/// Most viewers at once.
const MOST_VIEWERS: usize = 8;
/// Time between two messages to a viewer.
const INTERVAL: Duration = Duration::from_millis(16);
/// How long a connection may take to send its request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest request head and longest order, bytes.
const MOST_BYTES: usize = 16 << 10;
/// Bytes that may wait for a viewer.
const MOST_WAITING: usize = 4 << 20;

/// What a viewer orders.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "order", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ViewerRequest {
    /// Stops simulated time.
    Pause,
    /// Lets simulated time go on.
    Resume,
    /// Runs some ticks and pauses.
    Step {
        /// Number of control ticks.
        ticks: u32,
    },
    /// Changes the speed.
    Speed {
        /// Simulated seconds per second; 0 for as fast as possible.
        factor: f64,
    },
    /// Starts the run again.
    Reset,
    /// Changes a key of the scenario.
    Set {
        /// The key, as in `belt.friction`.
        key: String,
        /// The value in TOML.
        value: String,
    },
    /// Pushes the tip.
    Push {
        /// Force along the belt and away from it, N.
        force_n: [f64; 2],
        /// How long, s.
        duration_s: f64,
    },
}

/// What waits for one viewer.
#[derive(Debug, Default)]
struct Waiting {
    rows: Vec<u8>,
    messages: Vec<String>,
}

/// The viewers of a run.
#[derive(Debug, Default)]
pub struct Hub {
    count: AtomicUsize,
    viewers: Mutex<Vec<Arc<Mutex<Waiting>>>>,
}

impl Hub {
    /// Returns the number of viewers.
    pub fn viewers(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    /// Passes rows and messages to every viewer.
    pub fn publish(&self, rows: &[u8], messages: &[Value]) {
        for viewer in locked(&self.viewers).iter() {
            let mut waiting = locked(viewer);
            if waiting.rows.len() + rows.len() > MOST_WAITING {
                waiting.rows.clear();
            }
            waiting.rows.extend_from_slice(rows);
            waiting
                .messages
                .extend(messages.iter().map(Value::to_string));
        }
    }

    fn join(&self) -> Option<Arc<Mutex<Waiting>>> {
        let mut viewers = locked(&self.viewers);
        if viewers.len() >= MOST_VIEWERS {
            return None;
        }
        let viewer = Arc::<Mutex<Waiting>>::default();
        viewers.push(viewer.clone());
        self.count.store(viewers.len(), Ordering::Relaxed);
        Some(viewer)
    }

    fn leave(&self, viewer: &Arc<Mutex<Waiting>>) {
        let mut viewers = locked(&self.viewers);
        viewers.retain(|other| !Arc::ptr_eq(other, viewer));
        self.count.store(viewers.len(), Ordering::Relaxed);
    }
}

/// A thread that panicked has left nothing half-done here.
fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves the page until the process ends.
#[derive(Debug)]
pub struct Server {
    /// The viewers.
    pub hub: Arc<Hub>,
    /// What they order.
    pub orders: Receiver<ViewerRequest>,
    /// Where the page is.
    pub address: SocketAddr,
}

impl Server {
    /// Starts to serve `page` on a port of the loopback interface; 0 for any free one.
    ///
    /// # Errors
    /// If the port is taken or a thread cannot be started.
    pub fn start(port: u16, page: String) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let hub = Arc::<Hub>::default();
        let (sender, orders) = channel();
        let service = Service {
            page: page.into(),
            port: address.port(),
            hub: hub.clone(),
            orders: sender,
        };
        let accept = move || {
            for stream in listener.incoming().flatten() {
                let service = service.clone();
                // A connection that cannot be served is closed.
                let _ = thread::Builder::new()
                    .name("viewer".into())
                    .spawn(move || service.serve(stream));
            }
        };
        thread::Builder::new()
            .name("live page".into())
            .spawn(accept)?;
        Ok(Self {
            hub,
            orders,
            address,
        })
    }
}

/// What every connection needs.
#[derive(Clone)]
struct Service {
    page: Arc<str>,
    port: u16,
    hub: Arc<Hub>,
    orders: Sender<ViewerRequest>,
}

impl Service {
    fn serve(&self, mut stream: TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        let head = read_head(&mut stream)?;
        let mut headers = [httparse::EMPTY_HEADER; 64];
        let mut request = httparse::Request::new(&mut headers);
        if !request
            .parse(&head)
            .is_ok_and(|status| status.is_complete())
        {
            return refuse(&mut stream, "400 Bad Request");
        }
        let header = |name: &str| {
            let found = request
                .headers
                .iter()
                .find(|header| header.name.eq_ignore_ascii_case(name));
            found.and_then(|header| std::str::from_utf8(header.value).ok())
        };
        let own = |authority: &str| {
            let names = ["localhost", "127.0.0.1"];
            names
                .iter()
                .any(|name| authority == format!("{name}:{}", self.port))
        };
        let is_own_host = header("host").is_some_and(own);
        let is_own_origin =
            header("origin").is_none_or(|origin| origin.strip_prefix("http://").is_some_and(own));
        if !is_own_host || !is_own_origin {
            return refuse(&mut stream, "403 Forbidden");
        }
        match (request.method, request.path, header("sec-websocket-key")) {
            (Some("GET"), Some("/live"), Some(key)) => {
                let accept = derive_accept_key(key.as_bytes());
                let answer = format!(
                    "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
                     Sec-WebSocket-Accept: {accept}\r\n\r\n"
                );
                stream.write_all(answer.as_bytes())?;
                self.view(stream)
            }
            (Some("GET"), Some("/"), _) => {
                let answer = format!(
                    "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\
                     Content-Length: {}\r\nCache-Control: no-store\r\nX-Frame-Options: DENY\r\n\
                     Connection: close\r\n\r\n{}",
                    self.page.len(),
                    self.page
                );
                stream.write_all(answer.as_bytes())
            }
            _ => refuse(&mut stream, "404 Not Found"),
        }
    }

    /// Sends to one viewer and takes its orders until it leaves.
    fn view(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(INTERVAL))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let limits = WebSocketConfig::default().max_message_size(Some(MOST_BYTES));
        let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(limits));
        let Some(waiting) = self.hub.join() else {
            return Ok(());
        };
        while self.exchange(&mut socket, &waiting).is_ok() {}
        self.hub.leave(&waiting);
        Ok(())
    }

    fn exchange(
        &self,
        socket: &mut WebSocket<TcpStream>,
        waiting: &Mutex<Waiting>,
    ) -> Result<(), tungstenite::Error> {
        match socket.read() {
            Ok(Message::Text(text)) => match serde_json::from_str(&text) {
                Ok(order) => drop(self.orders.send(order)),
                Err(error) => {
                    let message = serde_json::json!({ "error": error.to_string() });
                    socket.send(Message::text(message.to_string()))?;
                }
            },
            Ok(Message::Close(_)) => return Err(tungstenite::Error::ConnectionClosed),
            Ok(_) => {}
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
        let Waiting { rows, messages } = std::mem::take(&mut *locked(waiting));
        if !rows.is_empty() {
            socket.send(Message::binary(rows))?;
        }
        for message in messages {
            socket.send(Message::text(message))?;
        }
        Ok(())
    }
}

/// Reads a request up to its empty line.
fn read_head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut part = [0; 1024];
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let length = stream.read(&mut part)?;
        if length == 0 || head.len() + length > MOST_BYTES {
            return Err(ErrorKind::InvalidData.into());
        }
        head.extend_from_slice(&part[..length]);
    }
    Ok(head)
}

fn refuse(stream: &mut TcpStream, status: &str) -> io::Result<()> {
    let answer = format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    stream.write_all(answer.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends a request and returns the first line of the answer.
    fn status(server: &Server, request: &str) -> String {
        let mut stream = TcpStream::connect(server.address).unwrap();
        let request = request.replace("PORT", &server.address.port().to_string());
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = [0; 64];
        let length = stream.read(&mut answer).unwrap();
        let text = String::from_utf8_lossy(&answer[..length]);
        text.lines().next().unwrap_or_default().to_owned()
    }

    const UPGRADE: &str = "Upgrade: websocket\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

    #[test]
    fn only_this_machines_own_pages_are_served() {
        let server = Server::start(0, "page".into()).unwrap();
        assert!(server.address.ip().is_loopback());
        for (request, expected) in [
            (
                "GET / HTTP/1.1\r\nHost: localhost:PORT\r\n\r\n".to_owned(),
                "200 OK",
            ),
            (
                "GET / HTTP/1.1\r\nHost: evil.example:PORT\r\n\r\n".to_owned(),
                "403 Forbidden",
            ),
            ("GET / HTTP/1.1\r\n\r\n".to_owned(), "403 Forbidden"),
            (
                "GET /etc HTTP/1.1\r\nHost: localhost:PORT\r\n\r\n".to_owned(),
                "404 Not Found",
            ),
            ("nonsense\r\n\r\n".to_owned(), "400 Bad Request"),
            (
                format!(
                    "GET /live HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: http://127.0.0.1:PORT\r\n{UPGRADE}\r\n"
                ),
                "101 Switching Protocols",
            ),
            (
                format!(
                    "GET /live HTTP/1.1\r\nHost: localhost:PORT\r\nOrigin: https://evil.example\r\n{UPGRADE}\r\n"
                ),
                "403 Forbidden",
            ),
            (
                format!(
                    "GET /live HTTP/1.1\r\nHost: localhost:PORT\r\nOrigin: null\r\n{UPGRADE}\r\n"
                ),
                "403 Forbidden",
            ),
        ] {
            assert_eq!(
                status(&server, &request),
                format!("HTTP/1.1 {expected}"),
                "{request}"
            );
        }
    }

    #[test]
    fn a_viewer_gets_what_is_published_and_its_orders_arrive() {
        let server = Server::start(0, String::new()).unwrap();
        let stream = TcpStream::connect(server.address).unwrap();
        let url = format!("ws://localhost:{}/live", server.address.port());
        let (mut socket, _) = tungstenite::client(url, stream).unwrap();
        while server.hub.viewers() == 0 {
            thread::sleep(Duration::from_millis(1));
        }
        server
            .hub
            .publish(&[1, 2, 3], &[serde_json::json!({ "a": 1 })]);
        assert_eq!(socket.read().unwrap(), Message::binary(vec![1, 2, 3]));
        assert_eq!(socket.read().unwrap(), Message::text("{\"a\":1}"));
        socket
            .send(Message::text("{\"order\":\"step\",\"ticks\":3}"))
            .unwrap();
        let order = server.orders.recv_timeout(PATIENCE).unwrap();
        assert_eq!(order, ViewerRequest::Step { ticks: 3 });
        socket
            .send(Message::text("{\"order\":\"explode\"}"))
            .unwrap();
        assert!(
            socket
                .read()
                .unwrap()
                .into_text()
                .unwrap()
                .contains("error")
        );
        socket.close(None).unwrap();
        while server.hub.viewers() > 0 {
            thread::sleep(Duration::from_millis(1));
        }
    }
}
