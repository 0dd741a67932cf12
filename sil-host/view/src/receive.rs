//! Messages of viewers of both kinds.

use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

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
        Err(tungstenite::Error::Io(error))
            if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Connections that are being turned away with patience, and the largest number of them.
static TURNED_AWAY: AtomicUsize = AtomicUsize::new(0);
pub(crate) const MOST_TURNED_AWAY: usize = MOST_VIEWERS;

/// Closes the connection of one viewer too many, and tells it why.
pub(crate) fn turn_away(mut socket: WebSocket<TcpStream>) {
    let reason = format!("{MOST_VIEWERS} viewers of this kind watch the run already: close one");
    let frame = CloseFrame {
        code: CloseCode::Again,
        reason: reason.into(),
    };
    let start = Instant::now();
    let closing = socket.close(Some(frame)).is_ok();
    // Until the viewer has closed it, too: what it sends at once would else end the connection before the reason.
    // A crowd is not waited for.
    let is_crowd = TURNED_AWAY.fetch_add(1, Ordering::Relaxed) >= MOST_TURNED_AWAY;
    let waits = closing && !is_crowd;
    while waits && start.elapsed() < PATIENCE && receive(&mut socket).is_ok() {}
    TURNED_AWAY.fetch_sub(1, Ordering::Relaxed);
}
