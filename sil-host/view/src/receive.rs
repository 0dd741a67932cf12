//! Messages of viewers of both kinds.

use std::io::{ErrorKind, Read};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use tungstenite::error::ProtocolError;
use tungstenite::protocol::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Message, WebSocket};

use crate::connection::PATIENCE;
use crate::hub::MOST_VIEWERS;

/// Waits for a viewer's message until it is time to send to it.
pub(crate) fn receive(
    socket: &mut WebSocket<TcpStream>,
) -> Result<Option<Message>, tungstenite::Error> {
    match socket.read() {
        Ok(Message::Close(_)) => Err(tungstenite::Error::ConnectionClosed),
        Ok(message) => Ok(Some(message)),
        Err(tungstenite::Error::Io(error)) if is_pause(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Ends a conversation after an error: answers the viewer's wish to end it, or tells the viewer by a code what it has done
/// wrong.
pub(crate) fn conclude(mut socket: WebSocket<TcpStream>, error: &tungstenite::Error) {
    let code = match error {
        tungstenite::Error::Capacity(_) => CloseCode::Size,
        tungstenite::Error::Utf8(_) => CloseCode::Invalid,
        tungstenite::Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => return,
        tungstenite::Error::Protocol(_) => CloseCode::Protocol,
        tungstenite::Error::ConnectionClosed => {
            // The answer is in the buffer. Whoever does not take it in time has left.
            let _ = socket.flush();
            return;
        }
        _ => return,
    };
    let reason = error.to_string().into();
    if socket.close(Some(CloseFrame { code, reason })).is_ok() {
        // What comes now means nothing, but unread it would end the connection before the reason.
        let stream = socket.get_mut();
        let _ = stream.shutdown(Shutdown::Write);
        let mut part = [0; 4096];
        wait(|| match stream.read(&mut part) {
            Ok(length) => length > 0,
            Err(error) => is_pause(&error),
        });
    }
}

fn is_pause(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

/// Connections whose end is waited for with patience, and the largest number of them.
static CLOSING: AtomicUsize = AtomicUsize::new(0);
pub(crate) const MOST_CLOSING: usize = MOST_VIEWERS;

/// Closes the connection of one viewer too many, and tells it why.
pub(crate) fn turn_away(mut socket: WebSocket<TcpStream>) {
    let reason = format!("{MOST_VIEWERS} viewers of this kind watch the run already: close one");
    let frame = CloseFrame {
        code: CloseCode::Again,
        reason: reason.into(),
    };
    // Until the viewer has closed it, too: what it sends at once would else end the connection before the reason.
    if socket.close(Some(frame)).is_ok() {
        wait(|| receive(&mut socket).is_ok());
    }
}

/// Waits with patience for the end of a connection that is being closed. A crowd is not waited for.
fn wait(mut is_open: impl FnMut() -> bool) {
    let start = Instant::now();
    let is_crowd = CLOSING.fetch_add(1, Ordering::Relaxed) >= MOST_CLOSING;
    while !is_crowd && start.elapsed() < PATIENCE && is_open() {}
    CLOSING.fetch_sub(1, Ordering::Relaxed);
}
