//! The live page on this machine: HTTP and WebSocket on one port of the loopback interface.
//!
//! Requests for another host (DNS rebinding) are refused, and so are connections from pages of another
//! origin: the live page is open to itself only, and the [`foxglove`](mod@super::foxglove) service to the
//! Foxglove app and the origins that the user names. Each viewer has a thread of its own, which sends
//! about 60 times a second what the run has published to the [`Hub`].

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::foxglove;
use crate::hub::{Hub, PageQueue, locked};
use crate::receive::receive;
use crate::request::{Order, Orders};

/// Time between two messages to a viewer.
const INTERVAL: Duration = Duration::from_millis(16);
/// How long a connection may take to send its request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest request head and longest order, bytes.
const MOST_BYTES: usize = 16 << 10;

/// Serves the page until the process ends.
#[derive(Debug)]
pub struct Server {
    /// The viewers.
    pub hub: Arc<Hub>,
    /// Their requests.
    pub orders: Receiver<Order>,
    /// Where the page is.
    pub address: SocketAddr,
}

impl Server {
    /// Starts to serve `page` on a port of the loopback interface; 0 for any free one. Pages of
    /// `origins` may connect as Foxglove does.
    ///
    /// # Errors
    /// If the port is taken or a thread cannot be started.
    pub fn start(port: u16, page: String, origins: &[String]) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let hub = Arc::<Hub>::default();
        let (sender, orders) = Orders::channel();
        let service = Service {
            page: page.into(),
            port: address.port(),
            hub: hub.clone(),
            orders: sender,
            origins: origins.into(),
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
    orders: Orders,
    /// Origins of further pages that may connect as Foxglove does.
    origins: Arc<[String]>,
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
        let origin = header("origin");
        let is_own_host = header("host").is_some_and(own);
        let is_own_origin =
            origin.is_none_or(|origin| origin.strip_prefix("http://").is_some_and(own));
        let protocol = foxglove::subprotocol(header("sec-websocket-protocol").unwrap_or_default());
        let is_allowed = is_own_origin
            || protocol.is_some()
                && origin.is_some_and(|origin| {
                    foxglove::ORIGINS.contains(&origin)
                        || self.origins.iter().any(|own| own == origin)
                });
        if !is_own_host || !is_allowed {
            return refuse(&mut stream, "403 Forbidden");
        }
        let key = header("sec-websocket-key");
        match (request.method, request.path, key, protocol) {
            (Some("GET"), Some("/live"), Some(key), _) if is_own_origin => {
                stream.write_all(upgrade(key, "").as_bytes())?;
                self.view(stream)
            }
            (Some("GET"), Some("/"), Some(key), Some(protocol)) => {
                let protocol = format!("Sec-WebSocket-Protocol: {protocol}\r\n");
                stream.write_all(upgrade(key, &protocol).as_bytes())?;
                foxglove::serve(web_socket(stream)?, &self.hub, &self.orders);
                Ok(())
            }
            (Some("GET"), Some("/"), _, _) => {
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
        let mut socket = web_socket(stream)?;
        let Some(waiting) = self.hub.pages.join() else {
            return Ok(());
        };
        while self.exchange(&mut socket, &waiting).is_ok() {}
        self.hub.pages.leave(&waiting);
        Ok(())
    }

    fn exchange(
        &self,
        socket: &mut WebSocket<TcpStream>,
        waiting: &Mutex<PageQueue>,
    ) -> Result<(), tungstenite::Error> {
        if let Some(Message::Text(text)) = receive(socket)? {
            match serde_json::from_str(&text) {
                Ok(request) => self.orders.send(request),
                Err(error) => {
                    let message = serde_json::json!({ "error": error.to_string() });
                    socket.send(Message::text(message.to_string()))?;
                }
            }
        }
        let PageQueue { rows, messages } = std::mem::take(&mut *locked(waiting));
        if !rows.is_empty() {
            socket.send(Message::binary(rows))?;
        }
        for message in messages {
            socket.send(Message::text(message))?;
        }
        Ok(())
    }
}

/// Returns the answer that turns a connection into a WebSocket, with a further header.
fn upgrade(key: &str, header: &str) -> String {
    let accept = derive_accept_key(key.as_bytes());
    format!(
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         {header}Sec-WebSocket-Accept: {accept}\r\n\r\n"
    )
}

fn web_socket(stream: TcpStream) -> io::Result<WebSocket<TcpStream>> {
    stream.set_read_timeout(Some(INTERVAL))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let limits = WebSocketConfig::default().max_message_size(Some(MOST_BYTES));
    Ok(WebSocket::from_raw_socket(
        stream,
        Role::Server,
        Some(limits),
    ))
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
    use crate::request::ViewerRequest;

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
        let server = Server::start(0, "page".into(), &["http://localhost:8080".into()]).unwrap();
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
        let server = Server::start(0, String::new(), &[]).unwrap();
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
        assert_eq!(order.request, ViewerRequest::Step { ticks: 3 });
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
