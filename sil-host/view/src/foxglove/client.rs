//! The conversation with one Foxglove client.

use std::collections::BTreeSet;
use std::net::TcpStream;
use std::sync::{Arc, Mutex};

use painleve_record::RecordedTick;
use painleve_record::fields::TOPICS;
use painleve_record::messages::{
    CHANNELS, EVENTS, SCENE, TRANSFORMS, TickMessage, channels, event_message, nanoseconds,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tungstenite::{Error, Message, WebSocket};

use super::services;
use crate::hub::{ClientQueue, Entry, Hub, Severity, WatchedTick};
use crate::locked;
use crate::parameters::Parameter;
use crate::receive::{conclude, receive, turn_away};
use crate::request::{Desk, TOO_MANY};

/// First bytes of binary messages.
const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;
const SERVICE_CALL_RESPONSE: u8 = 3;
const SERVICE_CALL_REQUEST: u8 = 2;

/// A client's message in JSON.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    GetParameters {
        parameter_names: Vec<String>,
        id: Option<String>,
    },
    SetParameters {
        parameters: Vec<Parameter>,
        id: Option<String>,
    },
    SubscribeParameterUpdates {
        parameter_names: Vec<String>,
    },
    UnsubscribeParameterUpdates {
        parameter_names: Vec<String>,
    },
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

/// Talks to a client until it leaves; one client too many is turned away.
pub(crate) fn serve(socket: WebSocket<TcpStream>, hub: &Hub, desk: Desk) {
    let Some(queue) = hub.clients.join() else {
        turn_away(socket);
        return;
    };
    let mut client = Client {
        socket,
        hub,
        desk,
        queue: &queue,
        subscriptions: [None; CHANNELS],
        watched: BTreeSet::new(),
    };
    // Every error ends the conversation.
    let mut state = client.greet();
    while state.is_ok() {
        state = client.exchange();
    }
    let Client { socket, .. } = client;
    hub.clients.leave(&queue);
    if let Err(end) = state {
        conclude(socket, &end);
    }
}

struct Client<'a> {
    socket: WebSocket<TcpStream>,
    hub: &'a Hub,
    desk: Desk,
    queue: &'a Arc<Mutex<ClientQueue>>,
    /// The number of its subscription to each channel; the protocol allows one at a time.
    subscriptions: [Option<u32>; CHANNELS],
    /// Parameters, among those that there are, whose changes it wants to know.
    watched: BTreeSet<String>,
}

impl Client<'_> {
    fn greet(&mut self) -> Result<(), Error> {
        self.introduce()?;
        let channels = channels().into_iter().enumerate().map(|(id, channel)| {
            json!({
                "id": id,
                "topic": channel.topic,
                "encoding": "json",
                "schemaName": channel.schema_name,
                "schemaEncoding": "jsonschema",
                "schema": channel.schema,
            })
        });
        let channels: Vec<Value> = channels.collect();
        self.write(&json!({ "op": "advertise", "channels": channels }))?;
        self.write(&services::advertisement())?;
        self.socket.flush()
    }

    /// Introduces the server; a new session makes the client forget what it has received.
    fn introduce(&mut self) -> Result<(), Error> {
        self.write(&json!({
            "op": "serverInfo",
            "name": "painleve",
            "capabilities": ["parameters", "parametersSubscribe", "services", "time"],
            "supportedEncodings": ["json"],
            "metadata": {},
            "sessionId": self.hub.session(),
        }))
    }

    /// Takes a request and sends what waits.
    fn exchange(&mut self) -> Result<(), Error> {
        match receive(&mut self.socket)? {
            Some(Message::Text(text)) => match serde_json::from_str(&text) {
                Ok(request) => self.obey(request)?,
                Err(error) => self.write(&status(Severity::Error, &error.to_string()))?,
            },
            Some(Message::Binary(bytes)) => self.call(&bytes)?,
            _ => {}
        }
        let entries = locked(self.queue).take();
        for entry in entries {
            self.pass_on(entry)?;
        }
        self.socket.flush()
    }

    fn obey(&mut self, request: Request) -> Result<(), Error> {
        match request {
            Request::Subscribe { subscriptions } => {
                for Subscription { id, channel_id } in subscriptions {
                    if let Some(subscription) = self.subscriptions.get_mut(channel_id) {
                        *subscription = Some(id);
                    } else {
                        let text = format!("there is no channel {channel_id}");
                        self.write(&status(Severity::Error, &text))?;
                    }
                }
                self.update_subscriptions();
            }
            Request::Unsubscribe { subscription_ids } => {
                for subscription in &mut self.subscriptions {
                    subscription.take_if(|id| subscription_ids.contains(id));
                }
                self.update_subscriptions();
            }
            Request::GetParameters {
                parameter_names,
                id,
            } => self.send_parameters(&parameter_names, id)?,
            Request::SetParameters { parameters, id } => {
                let names: Vec<String> = parameters.iter().map(|one| one.name.clone()).collect();
                for parameter in parameters {
                    if let Err(Some(error)) = self.set(parameter) {
                        self.write(&status(Severity::Error, &error))?;
                    }
                }
                if id.is_some() {
                    self.send_parameters(&names, id)?;
                }
            }
            Request::SubscribeParameterUpdates { parameter_names } => {
                let wanted = chosen(self.hub.parameters(), &parameter_names);
                self.watched.extend(wanted.map(|one| one.name));
            }
            Request::UnsubscribeParameterUpdates { parameter_names } => {
                if parameter_names.is_empty() {
                    self.watched.clear();
                }
                for name in parameter_names {
                    self.watched.remove(&name);
                }
            }
        }
        Ok(())
    }

    /// Sets a parameter.
    ///
    /// # Errors
    /// With what the client must be told; the run itself tells every client about a request that it refuses.
    fn set(&mut self, parameter: Parameter) -> Result<(), Option<String>> {
        self.desk.admit()?;
        let request = parameter.request().map_err(Some)?;
        self.desk.request(request).map_err(|_| None)
    }

    fn update_subscriptions(&self) {
        let is_subscribed = self.subscriptions.iter().any(Option::is_some);
        locked(self.queue).is_subscribed = is_subscribed;
    }

    /// Sends the parameters with these names; all if there are none.
    fn send_parameters(&mut self, names: &[String], id: Option<String>) -> Result<(), Error> {
        let parameters: Vec<Parameter> = chosen(self.hub.parameters(), names).collect();
        let mut message = json!({ "op": "parameterValues", "parameters": parameters });
        if let Some(id) = id {
            message["id"] = id.into();
        }
        self.write(&message)
    }

    /// Answers a call of a service.
    fn call(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Some(call) = ServiceCall::read(bytes) else {
            return self.write(&status(Severity::Error, "a message cannot be read"));
        };
        let outcome = if call.encoding == b"json" {
            let admitted = self.desk.admit().map_err(|_| TOO_MANY.to_owned());
            admitted
                .and_then(|()| services::request(call.service, call.payload))
                .and_then(|request| self.desk.request(request))
        } else {
            Err("requests to services must be JSON".to_owned())
        };
        match outcome {
            Ok(()) => self.socket.write(Message::binary(call.response(b"{}"))),
            Err(message) => self.write(&json!({
                "op": "serviceCallFailure",
                "serviceId": call.service,
                "callId": call.call,
                "message": message,
            })),
        }
    }

    fn pass_on(&mut self, entry: Entry) -> Result<(), Error> {
        match entry {
            Entry::Tick(tick) => self.send_tick(&tick),
            Entry::Event(event) => self.send_data(EVENTS, event.time_s, || event_message(&event)),
            Entry::Parameters(changed) => {
                let known = |one: &&Parameter| self.watched.contains(&one.name);
                let parameters: Vec<&Parameter> = changed.iter().filter(known).collect();
                if parameters.is_empty() {
                    return Ok(());
                }
                self.write(&json!({ "op": "parameterValues", "parameters": parameters }))
            }
            Entry::Status(severity, text) => self.write(&status(severity, &text)),
            Entry::Restarted => self.introduce(),
        }
    }

    fn send_tick(&mut self, watched: &WatchedTick) -> Result<(), Error> {
        let time_s = watched.sample.plant.time_s;
        let mut bytes = vec![TIME];
        bytes.extend(nanoseconds(time_s).to_le_bytes());
        self.socket.write(Message::binary(bytes))?;
        let tick = RecordedTick {
            sample: &watched.sample,
            estimates: watched.estimates.as_ref(),
        };
        for (channel, topic) in TOPICS.into_iter().enumerate() {
            if tick.estimates.is_some() || !topic.needs_estimates {
                self.send_data(channel, time_s, || TickMessage { topic, tick: &tick })?;
            }
        }
        if let Some(scene) = &watched.scene
            && (self.wants(TRANSFORMS) || self.wants(SCENE))
        {
            let picture = scene.picture(&tick);
            self.send_data(TRANSFORMS, time_s, || &picture.transforms)?;
            self.send_data(SCENE, time_s, || &picture.scene)?;
        }
        Ok(())
    }

    fn wants(&self, channel: usize) -> bool {
        self.subscriptions[channel].is_some()
    }

    /// Sends a message of a channel to which there is a subscription.
    fn send_data<M: Serialize>(
        &mut self,
        channel: usize,
        time_s: f64,
        message: impl FnOnce() -> M,
    ) -> Result<(), Error> {
        let Some(id) = self.subscriptions[channel] else {
            return Ok(());
        };
        // It contains only finite numbers and text keys, so it can be written as JSON.
        let Ok(json) = serde_json::to_vec(&message()) else {
            return Ok(());
        };
        let mut bytes = Vec::with_capacity(13 + json.len());
        bytes.push(MESSAGE_DATA);
        bytes.extend(id.to_le_bytes());
        bytes.extend(nanoseconds(time_s).to_le_bytes());
        bytes.extend(&json);
        self.socket.write(Message::binary(bytes))
    }

    fn write(&mut self, message: &Value) -> Result<(), Error> {
        self.socket.write(Message::text(message.to_string()))
    }
}

/// Returns the parameters with these names; all if there are none.
fn chosen(parameters: Vec<Parameter>, names: &[String]) -> impl Iterator<Item = Parameter> {
    let is_chosen = move |one: &Parameter| names.is_empty() || names.contains(&one.name);
    parameters.into_iter().filter(is_chosen)
}

fn status(severity: Severity, text: &str) -> Value {
    let level = match severity {
        Severity::Information => 0,
        Severity::Error => 2,
    };
    json!({ "op": "status", "level": level, "message": text })
}

/// A call of a service.
struct ServiceCall<'a> {
    service: u32,
    call: u32,
    encoding: &'a [u8],
    payload: &'a [u8],
}

impl<'a> ServiceCall<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let (&SERVICE_CALL_REQUEST, bytes) = bytes.split_first()? else {
            return None;
        };
        let (&service, bytes) = bytes.split_first_chunk()?;
        let (&call, bytes) = bytes.split_first_chunk()?;
        let (&length, bytes) = bytes.split_first_chunk()?;
        let length = usize::try_from(u32::from_le_bytes(length)).ok()?;
        let (encoding, payload) = bytes.split_at_checked(length)?;
        Some(Self {
            service: u32::from_le_bytes(service),
            call: u32::from_le_bytes(call),
            encoding,
            payload,
        })
    }

    fn response(&self, payload: &[u8]) -> Vec<u8> {
        let mut bytes = vec![SERVICE_CALL_RESPONSE];
        bytes.extend(self.service.to_le_bytes());
        bytes.extend(self.call.to_le_bytes());
        // The encoding is `json`, so its length is 4.
        bytes.extend(4_u32.to_le_bytes());
        bytes.extend(b"json");
        bytes.extend(payload);
        bytes
    }
}
