//! A client of Foxglove's WebSocket protocol, written from its specification.

use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value as Json, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

const WITHIN: Duration = Duration::from_secs(60);

/// A message of the server.
#[derive(Debug)]
pub(crate) enum Heard {
    Text(Json),
    /// Subscription, time in ns, content.
    Message(u32, u64, Vec<u8>),
    /// Call, answer.
    Answer(u32, Json),
    /// Request, and the file or an error message.
    Asset(u32, Result<Vec<u8>, String>),
    /// State of a played recording.
    Playback(Playback),
}

/// State of a played recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Playback {
    /// 0 while playing, 1 while paused, 3 at the end.
    pub(crate) status: u8,
    pub(crate) time_ns: u64,
    pub(crate) speed: f32,
    pub(crate) did_seek: bool,
    /// The answered request; empty if the state is not an answer.
    pub(crate) request: String,
}

pub(crate) struct Client {
    socket: WebSocket<TcpStream>,
    /// Advertised channels by topic.
    pub(crate) channels: BTreeMap<String, Json>,
    /// Services by name.
    pub(crate) services: BTreeMap<String, Json>,
    /// Last message of the server about itself.
    pub(crate) info: Json,
    number: u32,
}

impl Client {
    /// Connects with this subprotocol.
    pub(crate) fn connect(port: u16, query: &str, subprotocol: &str) -> Result<Self, String> {
        let mut request = format!("ws://localhost:{port}/{query}").into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", subprotocol.parse().unwrap());
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(WITHIN)).unwrap();
        let (socket, answer) = tungstenite::client(request, stream).map_err(|error| error.to_string())?;
        assert_eq!(answer.headers()["sec-websocket-protocol"], subprotocol);
        let (channels, services) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { socket, channels, services, info: Json::Null, number: 0 })
    }

    /// Returns the next message of the server.
    pub(crate) fn hear(&mut self) -> Heard {
        loop {
            let long = |bytes: &[u8]| u64::from_le_bytes(bytes[..8].try_into().unwrap());
            let word = |bytes: &[u8]| u32::from_le_bytes(bytes[..4].try_into().unwrap());
            match self.socket.read().expect("the server sends something") {
                Message::Text(text) => {
                    let text: Json = serde_json::from_str(&text).expect("JSON");
                    self.note(&text);
                    return Heard::Text(text);
                }
                Message::Binary(bytes) => match bytes[0] {
                    1 => return Heard::Message(word(&bytes[1..]), long(&bytes[5..]), bytes[13..].to_vec()),
                    3 => {
                        let length = word(&bytes[9..]) as usize;
                        assert_eq!(&bytes[13..13 + length], b"json");
                        let answer = serde_json::from_slice(&bytes[13 + length..]).expect("JSON");
                        return Heard::Answer(word(&bytes[5..]), answer);
                    }
                    4 => {
                        let length = word(&bytes[6..]) as usize;
                        let error = String::from_utf8_lossy(&bytes[10..10 + length]).into_owned();
                        let file = if bytes[5] == 0 { Ok(bytes[10 + length..].to_vec()) } else { Err(error) };
                        return Heard::Asset(word(&bytes[1..]), file);
                    }
                    5 => {
                        return Heard::Playback(Playback {
                            status: bytes[1],
                            time_ns: long(&bytes[2..]),
                            speed: f32::from_le_bytes(bytes[10..14].try_into().unwrap()),
                            did_seek: bytes[14] == 1,
                            request: String::from_utf8_lossy(&bytes[19..]).into_owned(),
                        });
                    }
                    _ => {}
                },
                _ => {}
            }
        }
    }

    fn note(&mut self, text: &Json) {
        let list = |name: &str| text[name].as_array().cloned().unwrap_or_default();
        let name = |value: &Json| value.as_str().expect("a name").to_string();
        match text["op"].as_str().expect("an operation") {
            "serverInfo" => self.info = text.clone(),
            "advertise" => {
                self.channels.extend(list("channels").into_iter().map(|one| (name(&one["topic"]), one)));
            }
            "unadvertise" => {
                let gone = list("channelIds");
                self.channels.retain(|_, channel| !gone.contains(&channel["id"]));
            }
            "advertiseServices" => {
                self.services.extend(list("services").into_iter().map(|one| (name(&one["name"]), one)));
            }
            _ => {}
        }
    }

    /// Reads messages until a condition is met.
    pub(crate) fn hear_until<T>(
        &mut self,
        what: &str,
        mut is_so: impl FnMut(&Self, &Heard) -> Option<T>,
    ) -> T {
        let began = Instant::now();
        loop {
            assert!(began.elapsed() < WITHIN, "{what}: not within {} s", WITHIN.as_secs());
            let heard = self.hear();
            if let Some(found) = is_so(self, &heard) {
                return found;
            }
        }
    }

    /// Waits until these topics are advertised.
    pub(crate) fn await_channels(&mut self, topics: &[&str]) {
        let here = |client: &Self| topics.iter().all(|topic| client.channels.contains_key(*topic));
        if !here(self) {
            self.hear_until(&format!("{topics:?}"), |client, _| here(client).then_some(()));
        }
    }

    /// Subscribes to an advertised topic; returns the number of the subscription.
    pub(crate) fn subscribe(&mut self, topic: &str) -> u32 {
        self.number += 1;
        let channel = &self.channels[topic]["id"];
        let order =
            json!({ "op": "subscribe", "subscriptions": [{ "id": self.number, "channelId": channel }] });
        self.send(&order);
        self.number
    }

    pub(crate) fn unsubscribe(&mut self, subscription: u32) {
        self.send(&json!({ "op": "unsubscribe", "subscriptionIds": [subscription] }));
    }

    /// Returns the next JSON message of a topic.
    pub(crate) fn next_json(&mut self, topic: &str) -> Json {
        let subscription = self.subscribe(topic);
        let found = self.hear_until(topic, |_, heard| match heard {
            Heard::Message(of, _, bytes) if *of == subscription => serde_json::from_slice(bytes).ok(),
            _ => None,
        });
        self.unsubscribe(subscription);
        found
    }

    /// Requests all parameters.
    pub(crate) fn parameters(&mut self) -> Vec<Json> {
        self.send(&json!({ "op": "getParameters", "parameterNames": [], "id": "all" }));
        self.hear_until("parameters", |_, heard| match heard {
            Heard::Text(text) if text["id"] == "all" => text["parameters"].as_array().cloned(),
            _ => None,
        })
    }

    /// Sets a parameter; returns its value afterwards, or the error message of the server.
    pub(crate) fn set(&mut self, name: &str, value: &Json) -> Result<Json, String> {
        let parameters = json!([{ "name": name, "value": value }]);
        self.send(&json!({ "op": "setParameters", "parameters": parameters, "id": "set" }));
        let mut refused = None;
        self.hear_until("an answer", |_, heard| match heard {
            Heard::Text(text) if text["op"] == "status" => {
                refused = text["message"].as_str().map(str::to_string);
                None
            }
            Heard::Text(text) if text["id"] == "set" => Some(text["parameters"][0]["value"].clone()),
            _ => None,
        });
        match refused {
            Some(words) => Err(words),
            None => {
                let all = self.parameters();
                Ok(all.into_iter().find(|one| one["name"] == name).expect("the parameter")["value"].clone())
            }
        }
    }

    /// Calls a service.
    pub(crate) fn call(&mut self, service: &str) -> Result<Json, String> {
        self.call_with(service, "{}")
    }

    /// Calls a service with a request in JSON.
    pub(crate) fn call_with(&mut self, service: &str, request: &str) -> Result<Json, String> {
        if !self.services.contains_key(service) {
            self.hear_until(service, |client, _| client.services.contains_key(service).then_some(()));
        }
        self.number += 1;
        let (call, id) = (self.number, self.services[service]["id"].as_u64().unwrap() as u32);
        let mut order = vec![2];
        for word in [id, call, 4] {
            order.extend(word.to_le_bytes());
        }
        order.extend(b"json");
        order.extend(request.as_bytes());
        self.socket.send(Message::binary(order)).expect("it is sent");
        self.hear_until(service, |_, heard| match heard {
            Heard::Answer(of, answer) if *of == call => Some(Ok(answer.clone())),
            Heard::Text(text) if text["op"] == "serviceCallFailure" && text["callId"] == call => {
                Some(Err(text["message"].as_str().unwrap().to_string()))
            }
            _ => None,
        })
    }

    /// Requests that a recording plays or pauses, at a speed, from another time if given; returns the answer.
    pub(crate) fn control(&mut self, plays: bool, speed: f32, seek_ns: Option<u64>) -> Playback {
        self.number += 1;
        let request = format!("request {}", self.number);
        let mut order = vec![3, u8::from(!plays)];
        order.extend(speed.to_le_bytes());
        order.push(u8::from(seek_ns.is_some()));
        order.extend(seek_ns.unwrap_or(0).to_le_bytes());
        order.extend((request.len() as u32).to_le_bytes());
        order.extend(request.bytes());
        self.socket.send(Message::binary(order)).expect("it is sent");
        self.hear_until("the state of the recording", |_, heard| match heard {
            Heard::Playback(state) if state.request == request => Some(state.clone()),
            _ => None,
        })
    }

    /// Fetches a file.
    pub(crate) fn fetch(&mut self, uri: &str) -> Result<Vec<u8>, String> {
        self.number += 1;
        let number = self.number;
        self.send(&json!({ "op": "fetchAsset", "uri": uri, "requestId": number }));
        self.hear_until(uri, |_, heard| match heard {
            Heard::Asset(of, file) if *of == number => Some(file.clone()),
            _ => None,
        })
    }

    pub(crate) fn send(&mut self, order: &Json) {
        self.socket.send(Message::text(order.to_string())).expect("it is sent");
    }
}
