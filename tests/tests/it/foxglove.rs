//! A live run as a Foxglove client sees and steers it: protocol `foxglove.sdk.v1`.

#![allow(clippy::unwrap_used, reason = "a client that fails fails its test")]

use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use boon::{Compiler, SchemaIndex, Schemas};
use painleve_tests::Bench;
use painleve_tests::live::{LiveRun, UPGRADE};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// How long a test waits for anything.
const PATIENCE: Duration = Duration::from_secs(20);

/// What the server sends.
#[derive(Debug)]
enum Received {
    Text(Value),
    Time(u64),
    Data {
        subscription: u32,
        time_ns: u64,
        message: Value,
    },
    Answer {
        call: u32,
    },
}

/// A Foxglove client.
struct Client {
    socket: WebSocket<TcpStream>,
    channels: BTreeMap<String, Value>,
    services: BTreeMap<String, u32>,
}

impl Client {
    fn connect(run: &LiveRun) -> Self {
        let stream = run.connect();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = run.foxglove.as_str().into_client_request().unwrap();
        let protocols = "foxglove.sdk.v1.1, foxglove.sdk.v1";
        let header = "Sec-WebSocket-Protocol";
        request
            .headers_mut()
            .insert(header, protocols.parse().unwrap());
        let (socket, answer) = tungstenite::client(request, stream).unwrap();
        assert_eq!(answer.headers()[header], "foxglove.sdk.v1");
        let mut client = Self {
            socket,
            channels: BTreeMap::new(),
            services: BTreeMap::new(),
        };
        let info = client.operation("serverInfo");
        for capability in ["parameters", "services", "time"] {
            let capabilities = info["capabilities"].as_array().unwrap();
            assert!(capabilities.contains(&json!(capability)), "{info}");
        }
        let advertised = client.operation("advertise");
        for channel in advertised["channels"].as_array().unwrap() {
            let topic = channel["topic"].as_str().unwrap().to_owned();
            client.channels.insert(topic, channel.clone());
        }
        let advertised = client.operation("advertiseServices");
        for service in advertised["services"].as_array().unwrap() {
            let name = service["name"].as_str().unwrap().to_owned();
            let id = service["id"].as_u64().unwrap() as u32;
            client.services.insert(name, id);
        }
        client
    }

    fn receive(&mut self) -> Received {
        let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
        let time = |bytes: &[u8]| u64::from_le_bytes(bytes.try_into().unwrap());
        match self.socket.read().unwrap() {
            Message::Text(text) => Received::Text(serde_json::from_str(&text).unwrap()),
            Message::Binary(bytes) => match bytes[0] {
                1 => Received::Data {
                    subscription: number(&bytes[1..5]),
                    time_ns: time(&bytes[5..13]),
                    message: serde_json::from_slice(&bytes[13..]).unwrap(),
                },
                2 => Received::Time(time(&bytes[1..9])),
                3 => Received::Answer {
                    call: number(&bytes[5..9]),
                },
                code => panic!("{code}"),
            },
            other => panic!("{other:?}"),
        }
    }

    /// Waits for something.
    fn wait<T>(&mut self, what: &str, mut select: impl FnMut(Received) -> Option<T>) -> T {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Some(found) = select(self.receive()) {
                return found;
            }
        }
        panic!("there is no {what}");
    }

    fn operation(&mut self, name: &str) -> Value {
        self.wait(name, |received| match received {
            Received::Text(message) if message["op"] == name => Some(message),
            _ => None,
        })
    }

    /// Waits for a message of a topic, whose subscription has the number of the channel.
    fn message(&mut self, topic: &str, matches: impl Fn(&Value) -> bool) -> (u64, Value) {
        let id = self.channels[topic]["id"].as_u64().unwrap() as u32;
        self.wait(topic, |received| match received {
            Received::Data {
                subscription,
                time_ns,
                message,
            } if subscription == id && matches(&message) => Some((time_ns, message)),
            _ => None,
        })
    }

    fn send(&mut self, message: Value) {
        self.socket
            .send(Message::text(message.to_string()))
            .unwrap();
    }

    fn subscribe(&mut self, topics: &[&str]) {
        let ids = topics.iter().map(|topic| &self.channels[*topic]["id"]);
        let subscriptions: Vec<Value> =
            ids.map(|id| json!({ "id": id, "channelId": id })).collect();
        self.send(json!({ "op": "subscribe", "subscriptions": subscriptions }));
    }

    /// Sets a parameter and returns the value that it then has.
    fn set(&mut self, name: &str, value: Value) -> Value {
        self.send(json!({
            "op": "setParameters",
            "parameters": [{ "name": name, "value": value }],
            "id": name,
        }));
        self.wait("parameter", |received| match received {
            Received::Text(message) if message["id"] == name => {
                Some(message["parameters"][0]["value"].clone())
            }
            _ => None,
        })
    }

    /// Calls a service; the answer has the same number as the call.
    fn call(&mut self, name: &str, request: &Value) -> Result<(), String> {
        let mut bytes = vec![2];
        bytes.extend(self.services[name].to_le_bytes());
        bytes.extend(7_u32.to_le_bytes());
        bytes.extend(4_u32.to_le_bytes());
        bytes.extend(b"json");
        bytes.extend(request.to_string().as_bytes());
        self.socket.send(Message::binary(bytes)).unwrap();
        self.wait("answer", |received| match received {
            Received::Answer { call: 7 } => Some(Ok(())),
            Received::Text(message) if message["op"] == "serviceCallFailure" => {
                Some(Err(message["message"].to_string()))
            }
            _ => None,
        })
    }

    /// Compiles the schema with which a topic was advertised.
    fn schema(&self, topic: &str, schemas: &mut Schemas) -> SchemaIndex {
        let text = self.channels[topic]["schema"].as_str().unwrap();
        let mut compiler = Compiler::new();
        let schema = serde_json::from_str(text).unwrap();
        compiler.add_resource("schema.json", schema).unwrap();
        compiler.compile("schema.json", schemas).unwrap()
    }
}

#[test]
fn a_client_sees_the_arm_raises_the_friction_and_sees_the_tip_lift_off() {
    let bench = Bench::new("foxglove");
    let run = LiveRun::start(&bench, &["open-loop-bounce", "--set", "belt.friction=0.3"]);
    let mut client = Client::connect(&run);
    let topics = [
        "/plant",
        "/sensor",
        "/actuator",
        "/estimates",
        "/tf",
        "/scene",
        "/events",
    ];
    client.subscribe(&topics);
    client.send(json!({ "op": "subscribeParameterUpdates", "parameterNames": ["belt.friction"] }));
    for topic in &topics[..6] {
        let mut schemas = Schemas::new();
        let schema = client.schema(topic, &mut schemas);
        let (_, message) = client.message(topic, |_| true);
        schemas.validate(&message, schema).unwrap();
    }
    let (_, scene) = client.message("/scene", |_| true);
    let entities = scene["entities"].as_array().unwrap();
    assert!(entities.iter().any(|entity| entity["id"] == "link_2"));

    assert_eq!(client.set("belt.friction", json!(0.6)), json!(0.6));
    let (time_ns, lift_off) = client.message("/events", |event| event["kind"] == "lift-off");
    let time_s = lift_off["time_s"].as_f64().unwrap();
    assert!((time_ns as f64 * 1e-9 - time_s).abs() < 1e-8, "{lift_off}");

    // What the scenario's check refuses leaves the parameter as it is.
    client.send(json!({ "op": "setParameters", "parameters": [{ "name": "belt.friction", "value": 7000 }] }));
    let refusal = client.wait("refusal", |received| match received {
        Received::Text(message) if message["level"] == 2 => Some(message),
        _ => None,
    });
    let text = refusal["message"].as_str().unwrap();
    assert!(text.contains("belt.friction"), "{text}");
    client.send(json!({ "op": "getParameters", "parameterNames": ["belt.friction"], "id": "a" }));
    let answer = client.operation("parameterValues");
    assert_eq!(answer["parameters"][0]["value"], 0.6, "{answer}");
}

#[test]
fn services_pause_step_push_and_reset() {
    let bench = Bench::new("foxglove-services");
    let run = LiveRun::start(&bench, &["hybrid-elbow-down"]);
    let mut client = Client::connect(&run);
    client.subscribe(&["/plant", "/events"]);
    client.message("/plant", |_| true);
    client.call("/pause", &json!({})).unwrap();
    client.send(json!({ "op": "getParameters", "parameterNames": ["live.paused"], "id": "p" }));
    let paused = client.operation("parameterValues");
    assert_eq!(paused["parameters"][0]["value"], true, "{paused}");
    client.call("/step", &json!({ "ticks": 2 })).unwrap();
    let (first, _) = client.message("/plant", |_| true);
    let (second, _) = client.message("/plant", |_| true);
    assert_eq!(second - first, 1_000_000);

    let failure = client.call("/push", &json!({ "normal_n": 1e9 }));
    assert!(failure.unwrap_err().contains("1000 N"));
    let failure = client.call("/step", &json!({ "tocks": 2 }));
    assert!(failure.unwrap_err().contains("tocks"));

    client.call("/resume", &json!({})).unwrap();
    assert_eq!(client.set("live.speed", json!(0)), json!(0.0));
    // Nothing else throws the tip off in this scenario.
    let push = json!({ "normal_n": 60.0, "duration_s": 0.05 });
    client.call("/push", &push).unwrap();
    client.message("/events", |event| event["kind"] == "lift-off");

    client.call("/pause", &json!({})).unwrap();
    client.call("/reset", &json!({})).unwrap();
    client.call("/step", &json!({})).unwrap();
    let time_ns = client.wait("new start", |received| match received {
        Received::Time(time_ns) if time_ns < 10_000_000 => Some(time_ns),
        _ => None,
    });
    assert_eq!(time_ns, 0);
}

#[test]
fn only_the_foxglove_app_and_named_origins_may_connect() {
    let bench = Bench::new("foxglove-origins");
    let own = "http://localhost:8080";
    let run = LiveRun::start(&bench, &["--live-origin", own]);
    let protocol = "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n";
    let knock = |more: &str| {
        let headers = format!("Host: {}\r\n{UPGRADE}{more}", run.authority());
        run.knock(&format!("/{}", run.query()), &headers)
    };
    for (origin, is_allowed) in [
        ("https://app.foxglove.dev", true),
        (own, true),
        ("https://evil.example", false),
        ("file://", false),
        ("null", false),
    ] {
        let answer = knock(&format!("{protocol}Origin: {origin}\r\n"));
        let status = if is_allowed { "101" } else { "403" };
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}")),
            "{answer}"
        );
        let confirms = answer.to_lowercase().contains(&protocol.to_lowercase());
        assert_eq!(confirms, is_allowed, "{answer}");
    }
    // The origins are those of Foxglove, so only its protocol is open to them.
    let answer = knock("Origin: https://app.foxglove.dev\r\n");
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
}
