// A connection to the viewer that reconnects whenever it is lost: channels by topic, decoded messages,
// parameters, services, files.

import { FoxgloveClient } from "@foxglove/ws-protocol";
import { ScalarType, createFileRegistry, fromBinary } from "@bufbuild/protobuf";
import { FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";

const SUBPROTOCOL = "foxglove.sdk.v1";
const AGAIN_MS = 500;

// The server's answer to a subscription to a channel that does not exist.
const UNKNOWN_CHANNEL = /^Unknown channel ID: (\d+)$/;

const bytesOf = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

const NO_NUMBERS = [ScalarType.BOOL, ScalarType.STRING, ScalarType.BYTES];

/** Numeric fields of a schema: name, name in a message object, and `isList`. */
function numbersOf(schema) {
  const numbers = schema.fields.filter(({ fieldKind, listKind, scalar }) => {
    return (fieldKind === "scalar" || (fieldKind === "list" && listKind === "scalar")) && !NO_NUMBERS.includes(scalar);
  });
  return numbers.map(({ name, localName, fieldKind }) => ({ name: name.replaceAll("__", "."), local: localName, isList: fieldKind === "list" }));
}

/** Numeric fields of a channel, and a function that decodes the bytes of a message. */
function decoder(channel) {
  if (channel.encoding === "json") {
    const text = new TextDecoder();
    return { fields: [], decode: (data) => JSON.parse(text.decode(data)) };
  }
  if (channel.encoding !== "protobuf") return undefined;
  const registry = createFileRegistry(fromBinary(FileDescriptorSetSchema, bytesOf(channel.schema)));
  const schema = registry.getMessage(channel.schemaName);
  const decode = (data) => fromBinary(schema, new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  return schema && { fields: numbersOf(schema), decode };
}

export class Connection extends EventTarget {
  #address;
  #client;
  #channels = new Map(); // by topic
  #listeners = new Map(); // by topic: a set of functions
  #subscriptions = new Map(); // by subscription: topic, fields and decoder
  #subscribed = new Map(); // by topic: subscription
  #services = new Map(); // by name
  #answers = new Map(); // by number of the call or the request
  #parameters = new Set(); // names of those with subscribed changes
  #number = 0;
  #session;

  constructor(address) {
    super();
    this.#address = address;
    this.#connect();
  }

  get channels() {
    return [...this.#channels.values()];
  }

  get connected() {
    return this.#client !== undefined;
  }

  /** Calls `listener` with every message of a topic, its time and its numeric fields, while the channel exists. */
  subscribe(topic, listener) {
    if (!this.#listeners.has(topic)) this.#listeners.set(topic, new Set());
    this.#listeners.get(topic).add(listener);
    this.#subscribeTo(topic);
  }

  unsubscribe(topic, listener) {
    const listeners = this.#listeners.get(topic);
    listeners?.delete(listener);
    if (listeners?.size !== 0) return;
    this.#listeners.delete(topic);
    const subscription = this.#subscribed.get(topic);
    if (subscription === undefined) return;
    this.#subscribed.delete(topic);
    this.#subscriptions.delete(subscription);
    this.#client?.unsubscribe(subscription);
  }

  /** Requests a constant message again: a page that was busy for long may have lost it. */
  again(topic) {
    const subscription = this.#subscribed.get(topic);
    if (subscription === undefined) return;
    this.#subscribed.delete(topic);
    this.#subscriptions.delete(subscription);
    this.#client?.unsubscribe(subscription);
    this.#subscribeTo(topic);
  }

  setParameter(name, value, type) {
    this.#client?.setParameters([{ name, value, type }], `set ${++this.#number}`);
  }

  /** Requests the values of all parameters; they arrive as an event. */
  getParameters() {
    this.#client?.getParameters([], `get ${++this.#number}`);
  }

  /** Calls a service; resolves with the answer, or rejects with a message. */
  call(name, request = {}) {
    const service = this.#services.get(name);
    if (!this.#client || !service) return Promise.reject(new Error("no connection"));
    const callId = ++this.#number;
    const data = new TextEncoder().encode(JSON.stringify(request));
    return new Promise((resolve, reject) => {
      this.#answers.set(callId, { resolve, reject });
      this.#client.sendServiceCallRequest({ serviceId: service.id, callId, encoding: "json", data });
    });
  }

  /** The bytes of a file of a robot. */
  fetchAsset(uri) {
    if (!this.#client) return Promise.reject(new Error("no connection"));
    const requestId = ++this.#number;
    return new Promise((resolve, reject) => {
      this.#answers.set(requestId, { resolve, reject });
      this.#client.fetchAsset(uri, requestId);
    });
  }

  #emit(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  #connect() {
    const client = new FoxgloveClient({ ws: new WebSocket(this.#address, [SUBPROTOCOL]) });
    client.on("open", () => {
      this.#client = client;
      this.#emit("open");
    });
    client.on("close", () => {
      const was = this.#client !== undefined;
      this.#client = undefined;
      for (const { reject } of this.#answers.values()) reject(new Error("the connection is lost"));
      this.#forget();
      this.#session = undefined;
      if (was) this.#emit("close");
      setTimeout(() => this.#connect(), AGAIN_MS);
    });
    client.on("error", () => {}); // "close" follows
    client.on("serverInfo", (info) => {
      // Another run: the state of the previous one is obsolete.
      if (this.#session !== undefined && this.#session !== info.sessionId) this.#emit("session");
      this.#session = info.sessionId;
      this.#parameters.clear();
      client.getParameters([], `get ${++this.#number}`);
    });
    client.on("advertise", (channels) => {
      for (const channel of channels) {
        this.#channels.set(channel.topic, channel);
        this.#subscribed.delete(channel.topic);
        if (this.#listeners.has(channel.topic)) this.#subscribeTo(channel.topic);
      }
      this.#emit("channels");
    });
    client.on("unadvertise", (ids) => {
      for (const [topic, channel] of this.#channels) {
        if (!ids.includes(channel.id)) continue;
        this.#channels.delete(topic);
        this.#subscriptions.delete(this.#subscribed.get(topic));
        this.#subscribed.delete(topic);
      }
    });
    client.on("advertiseServices", (services) => {
      for (const service of services) this.#services.set(service.name, service);
    });
    client.on("message", ({ subscriptionId, timestamp, data }) => {
      const subscription = this.#subscriptions.get(subscriptionId);
      if (!subscription) return;
      const message = subscription.decode(data);
      for (const listener of this.#listeners.get(subscription.topic) ?? []) listener(message, timestamp, subscription.fields);
    });
    client.on("parameterValues", ({ parameters }) => {
      const unknown = parameters.map(({ name }) => name).filter((name) => !this.#parameters.has(name));
      for (const name of unknown) this.#parameters.add(name);
      if (unknown.length > 0) client.subscribeParameterUpdates(unknown);
      this.#emit("parameters", parameters);
    });
    client.on("status", (status) => {
      const unknown = UNKNOWN_CHANNEL.exec(status.message);
      if (!unknown) return this.#emit("status", status);
      // A channel may end while a subscription is pending, as at the end of a run; its end may be reported later.
      const isThere = () => this.channels.some(({ id }) => id === Number(unknown[1]));
      setTimeout(() => isThere() && this.#emit("status", status), AGAIN_MS);
    });
    const answer = (number, outcome) => {
      const waiting = this.#answers.get(number);
      this.#answers.delete(number);
      if (waiting) outcome(waiting);
    };
    client.on("serviceCallResponse", ({ callId, data }) => {
      answer(callId, ({ resolve }) => resolve(JSON.parse(new TextDecoder().decode(data))));
    });
    client.on("serviceCallFailure", ({ callId, message }) => {
      answer(callId, ({ reject }) => reject(new Error(message)));
    });
    client.on("fetchAssetResponse", ({ requestId, status, data, error }) => {
      answer(requestId, ({ resolve, reject }) => (status === 0 ? resolve(data) : reject(new Error(error))));
    });
  }

  #forget() {
    this.#channels.clear();
    this.#subscriptions.clear();
    this.#subscribed.clear();
    this.#services.clear();
    this.#answers.clear();
  }

  #subscribeTo(topic) {
    const channel = this.#channels.get(topic);
    if (!this.#client || !channel || this.#subscribed.has(topic)) return;
    const known = decoder(channel);
    if (!known) return;
    const subscription = this.#client.subscribe(channel.id);
    this.#subscribed.set(topic, subscription);
    this.#subscriptions.set(subscription, { topic, ...known });
  }
}
