//! Messages of viewers of both kinds.

use std::io::ErrorKind;
use std::net::TcpStream;

use tungstenite::{Message, WebSocket};

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
