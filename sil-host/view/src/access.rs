//! Who may see and steer a live run: who knows its token, on this machine, from its own page or the Foxglove app.

use std::io;

use data_encoding::HEXLOWER;
use subtle::ConstantTimeEq;
use tungstenite::handshake::server::Request;
use tungstenite::http::StatusCode;
use tungstenite::http::header::{HOST, HeaderName, ORIGIN};

use crate::foxglove;

/// A secret in the printed addresses, without which nobody on this machine, whichever user, sees or steers
/// the run.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// Draws a token of 128 bits.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub fn draw() -> io::Result<Self> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        Ok(Self(HEXLOWER.encode(&bytes)))
    }

    /// Compares in a time that does not depend on the content.
    fn is(&self, given: &str) -> bool {
        self.0.as_bytes().ct_eq(given.as_bytes()).into()
    }
}

/// What a request must show.
pub(crate) struct Access {
    pub(crate) port: u16,
    /// `None` if everybody on this machine may see and steer the run.
    pub(crate) token: Option<Token>,
    /// Origins of further pages that may connect as Foxglove does.
    pub(crate) origins: Vec<String>,
}

impl Access {
    /// Returns the query of the printed addresses, with its question mark.
    pub(crate) fn query(&self) -> String {
        let token = self.token.as_ref();
        token.map_or_else(String::new, |token| format!("?token={}", token.0))
    }

    /// Refuses requests for another host (DNS rebinding), from pages of another origin, and without the token.
    ///
    /// # Errors
    /// With the status of the answer.
    pub(crate) fn check(&self, request: &Request, is_foxglove: bool) -> Result<(), StatusCode> {
        let host = single(request, HOST)?;
        let origin = single(request, ORIGIN)?;
        let own = |authority: &str| {
            let names = ["localhost", "127.0.0.1"];
            names
                .iter()
                .any(|name| authority == format!("{name}:{}", self.port))
        };
        let is_own_host = host.is_some_and(own) && request.uri().host().is_none();
        let is_welcome = origin.is_none_or(|origin| {
            let further = || self.origins.iter().map(String::as_str);
            origin.strip_prefix("http://").is_some_and(own)
                || is_foxglove
                    && further()
                        .chain([foxglove::ORIGIN])
                        .any(|known| known == origin)
        });
        let query = request.uri().query().unwrap_or_default();
        let given = query
            .split('&')
            .find_map(|part| part.strip_prefix("token="));
        let knows_token = self
            .token
            .as_ref()
            .is_none_or(|token| given.is_some_and(|given| token.is(given)));
        if is_own_host && is_welcome && knows_token {
            Ok(())
        } else {
            Err(StatusCode::FORBIDDEN)
        }
    }
}

/// Returns a header that a request may contain once, since programs differ in which of two they believe.
fn single(request: &Request, name: HeaderName) -> Result<Option<&str>, StatusCode> {
    let mut values = request.headers().get_all(name).iter();
    match (values.next(), values.next()) {
        (None, _) => Ok(None),
        (Some(value), None) => value
            .to_str()
            .map(Some)
            .map_err(|_| StatusCode::BAD_REQUEST),
        _ => Err(StatusCode::BAD_REQUEST),
    }
}
