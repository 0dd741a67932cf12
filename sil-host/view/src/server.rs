//! The live page on this machine: HTTP and WebSocket on one port of the loopback interface.
//!
//! [`access`](crate::access) decides who may connect: the live page is open to itself only, and the
//! [`foxglove`](mod@super::foxglove) service to the Foxglove app and the origins that the user names. Each
//! viewer has a thread of its own, which sends about 60 times a second what the run has published to the
//! [`Hub`].

use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use tungstenite::handshake::server::{Request, create_response, write_response};
use tungstenite::http::StatusCode;
use tungstenite::http::header::{HeaderValue, SEC_WEBSOCKET_KEY, SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::access::{Access, Token};
use crate::connection::{Connection, PATIENCE};
use crate::foxglove;
use crate::hub::{Hub, PageQueue};
use crate::locked;
use crate::receive::{conclude, receive, turn_away};
use crate::request::{Desk, Orders};

/// Time between two messages to a viewer.
const INTERVAL: Duration = Duration::from_millis(16);
/// Time until the next connection after one that cannot be accepted, because the process has no descriptors
/// left.
const PAUSE: Duration = Duration::from_millis(100);
/// Longest order, bytes.
const MOST_BYTES: usize = 16 << 10;

/// Serves the page until the process ends.
pub struct Server {
    /// The viewers.
    pub hub: Arc<Hub>,
    /// Their requests.
    pub orders: Arc<Orders>,
    /// Where the page is.
    address: SocketAddr,
    /// Query of the addresses.
    query: String,
}

impl Server {
    /// Starts to serve `page` on a port of the loopback interface, 0 for any free one, to those who know the
    /// token, if there is one. Pages of `origins` may connect as Foxglove does.
    ///
    /// # Errors
    /// If the port is taken or a thread cannot be started.
    pub fn start(
        port: u16,
        page: String,
        token: Option<Token>,
        origins: &[String],
    ) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let service = Arc::new(Service {
            page,
            access: Access {
                port: address.port(),
                token,
                origins: origins.into(),
            },
            hub: Arc::default(),
            orders: Arc::default(),
        });
        let server = Self {
            hub: service.hub.clone(),
            orders: service.orders.clone(),
            address,
            query: service.access.query(),
        };
        let accept = move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else {
                    thread::sleep(PAUSE);
                    continue;
                };
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
        Ok(server)
    }

    /// Returns the address of the page, with the token. It names the interface that is served: `localhost`
    /// may be another one.
    pub fn page_address(&self) -> String {
        format!("http://{}/{}", self.address, self.query)
    }

    /// Returns the address for Foxglove, with the token.
    pub fn foxglove_address(&self) -> String {
        format!("ws://{}/{}", self.address, self.query)
    }
}

/// What every connection needs.
struct Service {
    page: String,
    access: Access,
    hub: Arc<Hub>,
    orders: Arc<Orders>,
}

/// What a request asks for.
enum Visit {
    /// The page.
    Page,
    /// Its data and orders.
    Live,
    /// Those for Foxglove, in this version of the protocol.
    Foxglove(&'static str),
}

impl Service {
    fn serve(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        let mut connection = Connection::new(stream);
        let visit = connection
            .request()?
            .and_then(|request| Ok((self.visit(&request)?, request)));
        match visit {
            Ok((Visit::Page, _)) => connection.answer(StatusCode::OK, "text/html", &self.page),
            Ok((Visit::Live, request)) => match upgrade(connection, &request, None)? {
                Some(socket) => self.view(socket),
                None => Ok(()),
            },
            Ok((Visit::Foxglove(protocol), request)) => {
                if let Some(socket) = upgrade(connection, &request, Some(protocol))? {
                    foxglove::serve(socket, &self.hub, Desk::new(self.orders.clone()));
                }
                Ok(())
            }
            Err(status) => connection.answer(status, "text/plain", reason(status)),
        }
    }

    /// Returns what a request asks for, if it may have it.
    fn visit(&self, request: &Request) -> Result<Visit, StatusCode> {
        let headers = request.headers();
        let offered = headers.get(SEC_WEBSOCKET_PROTOCOL);
        let offered = offered.and_then(|value| value.to_str().ok());
        let protocol = offered.and_then(foxglove::subprotocol);
        self.access.check(request, protocol.is_some())?;
        let is_socket = headers.contains_key(SEC_WEBSOCKET_KEY);
        match (request.uri().path(), is_socket, protocol) {
            ("/", false, _) => Ok(Visit::Page),
            ("/", true, Some(protocol)) => Ok(Visit::Foxglove(protocol)),
            ("/live", true, None) => Ok(Visit::Live),
            _ => Err(StatusCode::NOT_FOUND),
        }
    }

    /// Sends to one viewer and takes its orders until it leaves.
    fn view(&self, mut socket: WebSocket<TcpStream>) -> io::Result<()> {
        let Some(waiting) = self.hub.join_page() else {
            turn_away(socket);
            return Ok(());
        };
        let mut desk = Desk::new(self.orders.clone());
        let end = loop {
            if let Err(end) = exchange(&mut socket, &waiting, &mut desk) {
                break end;
            }
        };
        self.hub.pages.leave(&waiting);
        conclude(socket, &end);
        Ok(())
    }
}

/// Takes an order of a page and sends what waits for it.
fn exchange(
    socket: &mut WebSocket<TcpStream>,
    waiting: &Mutex<PageQueue>,
    desk: &mut Desk,
) -> Result<(), tungstenite::Error> {
    if let Some(Message::Text(text)) = receive(socket)? {
        let refusal = desk.admit().and_then(|()| {
            let request = serde_json::from_str(&text).map_err(|error| Some(error.to_string()))?;
            desk.send(request).map_err(Some)
        });
        if let Err(Some(reason)) = refusal {
            let message = serde_json::json!({ "error": reason });
            socket.send(Message::text(message.to_string()))?;
        }
    }
    let PageQueue {
        messages,
        events,
        rows,
    } = std::mem::take(&mut *locked(waiting));
    for message in messages.into_iter().chain(events) {
        socket.send(Message::text(message))?;
    }
    if !rows.is_empty() {
        socket.send(Message::binary(rows))?;
    }
    Ok(())
}

/// Turns a connection into a WebSocket; `None` if the request does not ask for one as it must.
fn upgrade(
    mut connection: Connection,
    request: &Request,
    protocol: Option<&'static str>,
) -> io::Result<Option<WebSocket<TcpStream>>> {
    let Ok(mut response) = create_response(request) else {
        let status = StatusCode::BAD_REQUEST;
        connection.answer(status, "text/plain", reason(status))?;
        return Ok(None);
    };
    if let Some(protocol) = protocol {
        let protocol = HeaderValue::from_static(protocol);
        response
            .headers_mut()
            .insert(SEC_WEBSOCKET_PROTOCOL, protocol);
    }
    let mut head = Vec::new();
    write_response(&mut head, &response).map_err(io::Error::other)?;
    connection.write_all(&head)?;
    let (stream, read) = connection.into_parts();
    stream.set_read_timeout(Some(INTERVAL))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    // Of the message alone would not do: memory for a whole frame is taken when its head has arrived.
    let limits = WebSocketConfig::default()
        .max_message_size(Some(MOST_BYTES))
        .max_frame_size(Some(MOST_BYTES));
    let socket = WebSocket::from_partially_read(stream, read, Role::Server, Some(limits));
    Ok(Some(socket))
}

/// Says what is wrong with a request.
fn reason(status: StatusCode) -> &'static str {
    match status {
        StatusCode::FORBIDDEN => {
            "Refused. Open the whole address that painleve has printed, with its token; pages of other origins \
             need --live-origin.\n"
        }
        StatusCode::NOT_FOUND => "There is nothing at this address.\n",
        StatusCode::METHOD_NOT_ALLOWED => "Only GET and HEAD are allowed.\n",
        _ => "This is not a request for a page or a WebSocket.\n",
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::time::Instant;

    use super::*;
    use crate::hub::MOST_VIEWERS;
    use crate::receive::MOST_CLOSING;
    use crate::request::ViewerRequest;

    fn server(origins: &[String]) -> Server {
        Server::start(0, "page".into(), None, origins).unwrap()
    }

    /// Sends a request and returns the status of the answer.
    fn status(server: &Server, request: &str) -> String {
        let mut stream = TcpStream::connect(server.address).unwrap();
        let request = request.replace("PORT", &server.address.port().to_string());
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = [0; 64];
        let length = stream.read(&mut answer).unwrap();
        let text = String::from_utf8_lossy(&answer[..length]);
        let line = text.lines().next().unwrap_or_default();
        line.trim_start_matches("HTTP/1.1 ").to_owned()
    }

    const KEY: &str =
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

    #[test]
    fn only_this_machines_own_pages_are_served() {
        let server = server(&["http://localhost:8080".into()]);
        assert!(server.address.ip().is_loopback());
        let host = "Host: localhost:PORT\r\n";
        let socket =
            format!("{host}{KEY}Connection: keep-alive, Upgrade\r\nUpgrade: websocket\r\n");
        let foxglove = "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n";
        for (path, headers, expected) in [
            ("/", host.to_owned(), "200 OK"),
            ("/", "Host: 127.0.0.1:PORT\r\n".into(), "200 OK"),
            ("/", "Host: evil.example:PORT\r\n".into(), "403 Forbidden"),
            ("http://evil.example/", host.into(), "403 Forbidden"),
            ("/", String::new(), "403 Forbidden"),
            ("/etc", host.into(), "404 Not Found"),
            ("/", format!("{host}{host}"), "400 Bad Request"),
            (
                "/",
                format!("{host}Host: evil.example:PORT\r\n"),
                "400 Bad Request",
            ),
            (
                "/live",
                format!("{socket}Origin: http://127.0.0.1:PORT\r\n"),
                "101 Switching Protocols",
            ),
            (
                "/live",
                format!("{socket}Origin: https://evil.example\r\n"),
                "403 Forbidden",
            ),
            (
                "/live",
                format!("{socket}Origin: null\r\n"),
                "403 Forbidden",
            ),
            (
                "/live",
                format!(
                    "{socket}Origin: http://localhost:PORT\r\nOrigin: https://evil.example\r\n"
                ),
                "400 Bad Request",
            ),
            // The origins of others are welcome to Foxglove's protocol only.
            (
                "/live",
                format!("{socket}Origin: http://localhost:8080\r\n"),
                "403 Forbidden",
            ),
            (
                "/live",
                format!("{socket}{foxglove}Origin: http://localhost:8080\r\n"),
                "404 Not Found",
            ),
            (
                "/",
                format!("{socket}{foxglove}Origin: http://localhost:8080\r\n"),
                "101 Switching Protocols",
            ),
            (
                "/",
                format!("{socket}{foxglove}Origin: file://\r\n"),
                "403 Forbidden",
            ),
            // A key without a request to change the protocol.
            ("/live", format!("{host}{KEY}"), "400 Bad Request"),
            ("/", format!("{host}{KEY}{foxglove}"), "400 Bad Request"),
            ("/", format!("{host}no header\r\n"), "400 Bad Request"),
        ] {
            let request = format!("GET {path} HTTP/1.1\r\n{headers}\r\n");
            assert_eq!(status(&server, &request), expected, "{request}");
        }
    }

    #[test]
    fn the_head_alone_can_be_requested_and_other_methods_are_not_allowed() {
        let server = server(&[]);
        let address = server.address;
        let answer = |method: &str, path: &str, more: &str| {
            let mut stream = TcpStream::connect(address).unwrap();
            let request = format!("{method} {path} HTTP/1.1\r\nHost: {address}\r\n{more}\r\n");
            stream.write_all(request.as_bytes()).unwrap();
            let mut answer = String::new();
            stream.read_to_string(&mut answer).unwrap();
            answer
        };
        let upgrade = format!("{KEY}Connection: Upgrade\r\nUpgrade: websocket\r\n");
        for (path, more, status) in [
            ("/", "", "200 OK"),
            ("/etc", "", "404 Not Found"),
            ("/", "Origin: null\r\n", "403 Forbidden"),
            ("/", "no header\r\n", "400 Bad Request"),
        ] {
            let whole = answer("GET", path, more);
            let (head, body) = whole.split_once("\r\n\r\n").unwrap();
            assert!(
                head.starts_with(&format!("HTTP/1.1 {status}\r\n")),
                "{head}"
            );
            assert!(!body.is_empty());
            assert_eq!(answer("HEAD", path, more), format!("{head}\r\n\r\n"));
        }
        let refused = answer("HEAD", "/live", &upgrade);
        assert!(
            refused.starts_with("HTTP/1.1 400 Bad Request\r\n"),
            "{refused}"
        );
        for method in ["POST", "PUT", "OPTIONS", "DELETE"] {
            let body = format!("Content-Length: 60000\r\n\r\n{}", " ".repeat(60_000));
            let refused = answer(method, "/", &body);
            assert!(
                refused.starts_with("HTTP/1.1 405 Method Not Allowed\r\n"),
                "{refused}"
            );
            assert!(refused.contains("\r\nAllow: GET, HEAD\r\n"), "{refused}");
        }
    }

    #[test]
    fn a_connection_that_sends_slowly_is_closed_in_time() {
        let server = server(&[]);
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.set_nodelay(true).unwrap();
        let start = Instant::now();
        // Each byte comes well within the time that the whole request has.
        while stream.write_all(b"G").is_ok() {
            assert!(start.elapsed() < 3 * PATIENCE, "still open");
            thread::sleep(PATIENCE / 10);
        }
        assert!(start.elapsed() > PATIENCE / 2);
    }

    #[test]
    fn an_order_that_comes_with_the_request_is_carried_out() {
        let server = server(&[]);
        let address = server.address;
        let mut stream = TcpStream::connect(address).unwrap();
        let head = format!(
            "GET /live HTTP/1.1\r\nHost: {address}\r\n{KEY}Connection: Upgrade\r\nUpgrade: websocket\r\n\r\n"
        );
        // The text "reset" with its quotation marks, masked by zeros.
        let frame = b"\x81\x87\0\0\0\0\"reset\"";
        stream
            .write_all(&[head.as_bytes(), frame].concat())
            .unwrap();
        let order = server.orders.next(PATIENCE).unwrap();
        assert_eq!(order.request, ViewerRequest::Reset);
    }

    fn viewer(server: &Server) -> WebSocket<TcpStream> {
        let stream = TcpStream::connect(server.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let url = format!("ws://{}/live", server.address);
        tungstenite::client(url, stream).unwrap().0
    }

    #[test]
    fn after_a_reset_come_all_rows_of_the_new_run_and_none_of_the_old() {
        let hub = Hub::default();
        let waiting = hub.join_page().unwrap();
        let event = |time_s: f64| serde_json::json!({ "event": time_s });
        hub.publish(&[1], &[event(9.0)]);
        hub.restart();
        hub.publish(&[2], &[event(0.0)]);
        hub.tell(&serde_json::json!({ "status": 1 }));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let mut page = WebSocket::from_raw_socket(stream, Role::Client, None);
        let (stream, _) = listener.accept().unwrap();
        stream.set_read_timeout(Some(INTERVAL)).unwrap();
        let mut socket = WebSocket::from_raw_socket(stream, Role::Server, None);
        exchange(&mut socket, &waiting, &mut Desk::new(Arc::default())).unwrap();
        for expected in [
            Message::text("{\"reset\":true}"),
            Message::text("{\"status\":1}"),
            Message::text("{\"event\":0.0}"),
            Message::binary(vec![2]),
        ] {
            assert_eq!(page.read().unwrap(), expected);
        }
    }

    #[test]
    fn a_viewer_that_leaves_or_errs_is_told_by_a_close_frame() {
        let server = server(&[]);
        let address = server.address;
        let mask = [0; 4];
        let long = [&b"\x81\xfe\xff\xff"[..], &mask, &[b' '; 0xffff]].concat();
        for (path, protocol) in [
            ("/live", ""),
            ("/", "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n"),
        ] {
            for (frame, code) in [
                // 1000, which the answer repeats.
                (&b"\x88\x82\0\0\0\0\x03\xe8"[..], 1000_u16),
                (&long, 1009),
                (b"\x81\x81\0\0\0\0\xff", 1007),
                // Without a mask, and of an unknown kind.
                (b"\x81\x01x", 1002),
                (b"\x83\x81\0\0\0\0x", 1002),
            ] {
                let mut stream = TcpStream::connect(address).unwrap();
                stream.set_read_timeout(Some(2 * PATIENCE)).unwrap();
                let head = format!(
                    "GET {path} HTTP/1.1\r\nHost: {address}\r\n{KEY}{protocol}Connection: Upgrade\r\n\
                     Upgrade: websocket\r\n\r\n"
                );
                stream.write_all(head.as_bytes()).unwrap();
                stream.write_all(frame).unwrap();
                let start = Instant::now();
                let mut answer = Vec::new();
                stream.read_to_end(&mut answer).unwrap();
                let close = answer.iter().rposition(|byte| *byte == 0x88).unwrap();
                let (length, payload) = (answer[close + 1], &answer[close + 2..]);
                assert_eq!(payload.len(), usize::from(length), "{code}");
                assert_eq!(payload[..2], code.to_be_bytes(), "{path}");
                assert!(start.elapsed() < PATIENCE, "{code}");
            }
        }
    }

    #[test]
    fn one_viewer_too_many_is_told_why_and_may_come_again() {
        let server = server(&[]);
        let mut viewers: Vec<_> = (0..MOST_VIEWERS).map(|_| viewer(&server)).collect();
        while server.hub.viewers() < MOST_VIEWERS {
            thread::sleep(Duration::from_millis(1));
        }
        let Message::Close(Some(close)) = viewer(&server).read().unwrap() else {
            panic!("not closed with a reason");
        };
        assert!(close.reason.contains("8 viewers"), "{}", close.reason);
        drop(viewers.pop());
        while server.hub.viewers() == MOST_VIEWERS {
            thread::sleep(Duration::from_millis(1));
        }
        let mut viewer = viewer(&server);
        while server.hub.viewers() < MOST_VIEWERS {
            thread::sleep(Duration::from_millis(1));
        }
        server.hub.publish(&[1], &[]);
        assert_eq!(viewer.read().unwrap(), Message::binary(vec![1]));
    }

    #[test]
    fn a_frame_that_is_longer_than_any_order_is_refused_at_its_head() {
        let server = server(&[]);
        let mut socket = viewer(&server);
        // Text of a mebibyte, masked by zeros, of which nothing comes.
        let head = b"\x81\xff\0\0\0\0\0\x10\0\0\0\0\0\0";
        socket.get_mut().write_all(head).unwrap();
        let mut rest = Vec::new();
        let start = Instant::now();
        let ended = socket.get_mut().read_to_end(&mut rest);
        assert!(start.elapsed() < PATIENCE / 2, "still open: {ended:?}");
    }

    #[test]
    fn a_crowd_is_turned_away_at_once() {
        let server = server(&[]);
        let viewers: Vec<_> = (0..MOST_VIEWERS).map(|_| viewer(&server)).collect();
        while server.hub.viewers() < MOST_VIEWERS {
            thread::sleep(Duration::from_millis(1));
        }
        let mut crowd: Vec<_> = (0..2 * MOST_CLOSING).map(|_| viewer(&server)).collect();
        thread::sleep(PATIENCE / 4);
        // Not a reader of messages, which would answer.
        let is_closed = |socket: &mut WebSocket<TcpStream>| {
            let stream = socket.get_mut();
            let _ = stream.set_read_timeout(Some(Duration::from_millis(1)));
            stream.read_to_end(&mut Vec::new()).is_ok()
        };
        let closed = crowd.iter_mut().map(is_closed);
        let closed = closed.filter(|is_closed| *is_closed).count();
        assert!(closed >= MOST_CLOSING, "{closed} closed");
        drop(viewers);
    }

    #[test]
    fn a_viewer_gets_what_is_published_and_its_orders_arrive() {
        let server = server(&[]);
        let mut socket = viewer(&server);
        while server.hub.viewers() == 0 {
            thread::sleep(Duration::from_millis(1));
        }
        server
            .hub
            .publish(&[1, 2, 3], &[serde_json::json!({ "a": 1 })]);
        assert_eq!(socket.read().unwrap(), Message::text("{\"a\":1}"));
        assert_eq!(socket.read().unwrap(), Message::binary(vec![1, 2, 3]));
        socket
            .send(Message::text("{\"step\":{\"ticks\":3}}"))
            .unwrap();
        let order = server.orders.next(PATIENCE).unwrap();
        assert_eq!(order.request, ViewerRequest::Step { ticks: 3 });
        socket.send(Message::text("\"explode\"")).unwrap();
        let answer = socket.read().unwrap().into_text().unwrap();
        assert!(answer.contains("error"), "{answer}");
        socket.close(None).unwrap();
        while server.hub.viewers() > 0 {
            thread::sleep(Duration::from_millis(1));
        }
    }
}
