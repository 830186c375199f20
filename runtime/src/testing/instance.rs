//! A component of a graph built in code, and its table in the graph.

use super::closure::Part;
use crate::component::Component;
use crate::worker::Kind;

/// A component of a graph that is built in code.
#[derive(Debug)]
pub struct Instance {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) table: toml::Table,
    pub(super) part: Option<Part>,
}

impl Instance {
    /// Creates a component of type `C`. The component needs a [`rate`](Self::rate) or a
    /// [`trigger`](Self::trigger).
    pub fn of<C: Component>(name: &str) -> Self {
        Self { name: name.to_string(), kind: Kind::of::<C>(), table: toml::Table::new(), part: None }
            .set("kind", C::KIND)
    }

    /// Sets the rate of the steps, such as `"1 kHz"`.
    #[must_use]
    pub fn rate(mut self, rate: &str) -> Self {
        self.table.remove("trigger");
        self.set("rate", rate)
    }

    /// Triggers a step at every publication of `topic`. The component must subscribe to the topic.
    #[must_use]
    pub fn trigger(mut self, topic: &str) -> Self {
        self.table.remove("rate");
        self.set("trigger", topic)
    }

    /// Assigns a robot of the graph to the component.
    #[must_use]
    pub fn robot(self, name: &str) -> Self {
        self.set("robot", name)
    }

    /// Wires the input `port` to a topic.
    #[must_use]
    pub fn subscribe(mut self, port: &str, topic: &str) -> Self {
        self.entry("subscribe", port, topic.into());
        self
    }

    /// Wires the output `port` to a topic.
    #[must_use]
    pub fn publish(mut self, port: &str, topic: &str) -> Self {
        self.entry("publish", port, topic.into());
        self
    }

    /// Sets the initial value of a parameter.
    #[must_use]
    pub fn parameter(mut self, name: &str, value: impl Into<toml::Value>) -> Self {
        self.entry("params", name, value.into());
        self
    }

    /// Sets a key of the component's `config` table.
    #[must_use]
    pub fn config(mut self, key: &str, value: impl Into<toml::Value>) -> Self {
        self.entry("config", key, value.into());
        self
    }

    /// Sets a key of the component's table in the graph for which this type has no method, such as `on_error`
    /// or `budget`.
    #[must_use]
    pub fn set(mut self, key: &str, value: impl Into<toml::Value>) -> Self {
        self.table.insert(key.to_string(), value.into());
        self
    }

    fn entry(&mut self, table: &str, key: &str, value: toml::Value) {
        let table = self.table.entry(table).or_insert_with(|| toml::Table::new().into());
        if let toml::Value::Table(table) = table {
            table.insert(key.to_string(), value);
        }
    }
}
