//! Foxglove's WebSocket protocol (`foxglove.sdk.v1`, formerly `foxglove.websocket.v1`): topics of a
//! live run, its settings as parameters, its controls as services.
//!
//! Own code instead of the `foxglove` crate: that crate accepts connections from pages of every
//! origin, needs a port of its own, and doubles the time of a build.
//! Specification: <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.
//!
//! - [`feed`]: the run's messages, made only while a client has subscribed to them
//! - [`services`]: pause, resume, step, reset, push
//! - `client`: the conversation with one client

mod client;
pub mod feed;
pub mod services;

pub(crate) use client::serve;

/// Origin of the Foxglove app in the browser. That of the desktop app, `file://`, is also that of any page that
/// is opened from a file.
pub(crate) const ORIGIN: &str = "https://app.foxglove.dev";

/// Versions of the protocol, best first. They agree in everything that is used here.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Returns the best version of the protocol among those that a client offers.
pub(crate) fn subprotocol(offered: &str) -> Option<&'static str> {
    SUBPROTOCOLS
        .into_iter()
        .find(|known| offered.split(',').any(|name| name.trim() == *known))
}
