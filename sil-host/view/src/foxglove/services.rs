//! Services of a live run: what a client can make it do.

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::request::ViewerRequest;

/// A service.
pub(crate) struct Service {
    /// Its name.
    name: &'static str,
    /// JSON Schema of the properties of its request.
    properties: fn() -> Value,
    /// Reads its request.
    read: fn(&[u8]) -> Result<ViewerRequest, serde_json::Error>,
}

/// The services. A service's number is its index.
pub(crate) const SERVICES: [Service; 5] = [
    Service {
        name: "/pause",
        properties: || json!({}),
        read: |request| read(request).map(|Nothing {}| ViewerRequest::Pause),
    },
    Service {
        name: "/resume",
        properties: || json!({}),
        read: |request| read(request).map(|Nothing {}| ViewerRequest::Resume),
    },
    Service {
        name: "/step",
        properties: || json!({ "ticks": { "type": "integer", "minimum": 1, "default": 1, "description": "Control ticks to run before the next pause." } }),
        read: |request| read(request).map(|Step { ticks }| ViewerRequest::Step { ticks }),
    },
    Service {
        name: "/reset",
        properties: || json!({}),
        read: |request| read(request).map(|Nothing {}| ViewerRequest::Reset),
    },
    Service {
        name: "/push",
        properties: || {
            json!({
                "tangential_n": { "type": "number", "default": 0, "description": "Force on the tip along the belt, N." },
                "normal_n": { "type": "number", "default": 0, "description": "Force on the tip away from the belt, N." },
                "duration_s": { "type": "number", "default": 0.05, "description": "Duration, s." },
            })
        },
        read: |request| read(request).map(Push::request),
    },
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    #[serde(default = "one")]
    ticks: u32,
}

fn one() -> u32 {
    1
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Push {
    tangential_n: f64,
    normal_n: f64,
    duration_s: f64,
}

impl Default for Push {
    fn default() -> Self {
        Self {
            tangential_n: 0.0,
            normal_n: 0.0,
            duration_s: 0.05,
        }
    }
}

impl Push {
    fn request(self) -> ViewerRequest {
        ViewerRequest::Push {
            force_n: [self.tangential_n, self.normal_n],
            duration_s: self.duration_s,
        }
    }
}

/// Reads a request; an empty one means the defaults.
fn read<T: DeserializeOwned>(request: &[u8]) -> Result<T, serde_json::Error> {
    serde_json::from_slice(if request.is_empty() { b"{}" } else { request })
}

/// Returns the services as the server advertises them.
pub(crate) fn advertisement() -> Value {
    let schema = |name: String, properties: Value| {
        let schema = json!({ "title": name, "type": "object", "properties": properties });
        json!({
            "encoding": "json",
            "schemaName": name,
            "schemaEncoding": "jsonschema",
            "schema": schema.to_string(),
        })
    };
    let services = SERVICES.iter().enumerate().map(|(id, service)| {
        let kind = format!("painleve.{}", service.name.trim_start_matches('/'));
        json!({
            "id": id,
            "name": service.name,
            "type": kind,
            "request": schema(format!("{kind}.Request"), (service.properties)()),
            "response": schema(format!("{kind}.Response"), json!({})),
        })
    });
    json!({ "op": "advertiseServices", "services": services.collect::<Vec<_>>() })
}

/// Reads the request to a service.
///
/// # Errors
/// A sentence for the user.
pub(crate) fn request(service: u32, payload: &[u8]) -> Result<ViewerRequest, String> {
    let service = usize::try_from(service)
        .ok()
        .and_then(|number| SERVICES.get(number));
    let service = service.ok_or("there is no such service")?;
    (service.read)(payload).map_err(|error| format!("{}: {error}", service.name))
}
