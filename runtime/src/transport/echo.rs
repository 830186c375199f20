//! What an output does when the step that published is over: it wakes those it triggers on its own core, and repeats
//! small states over iceoryx2 while anybody listens there: tools, and programs with stock iceoryx2.

use std::cell::Cell;
use std::rc::Rc;

use iceoryx2::port::port_name::PortName;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::prelude::CallbackProgression;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe;

use super::bell::Bell;
use super::{AfterStep, Shared};
use crate::state::{Stamp, StateBuffer};

/// What the subscribers of components are called, which read small states from their slots.
const OWN: &str = "motorium.input";

/// The name of a component's subscriber.
pub(super) fn own_name() -> Result<PortName, String> {
    PortName::new(OWN).map_err(|error| format!("{error:?}"))
}

/// The duties of one output.
#[derive(Debug)]
pub(super) struct Echo<T: StateBuffer> {
    publisher: Rc<Publisher<Shared, T, Stamp>>,
    bell: Option<Rc<Bell>>,
    slots: Option<super::slots::Slots<T>>,
    audience: Audience<T>,
    owes_wake: Cell<bool>,
    owes_echo: Cell<bool>,
}

/// Who listens to a topic over iceoryx2.
#[derive(Debug)]
struct Audience<T: StateBuffer> {
    samples: publish_subscribe::PortFactory<Shared, T, Stamp>,
    /// How many subscribers there were when they were last told apart, and whether any was not a component's own.
    seen: Cell<(usize, bool)>,
}

impl<T: StateBuffer> Audience<T> {
    /// Whether anybody listens but components, which read the slots. They are told apart when their number has
    /// changed: that costs an allocation or two, when somebody comes or goes.
    fn is_there(&self) -> bool {
        let subscribers = self.samples.dynamic_config();
        let count = subscribers.number_of_subscribers();
        let (before, is_there) = self.seen.get();
        if count == before {
            return is_there;
        }
        let mut is_there = false;
        subscribers.list_subscribers(|subscriber| {
            is_there |= subscriber.subscriber_name.as_str() != OWN;
            CallbackProgression::Continue
        });
        self.seen.set((count, is_there));
        is_there
    }
}

impl<T: StateBuffer> Echo<T> {
    pub(super) fn new(
        samples: publish_subscribe::PortFactory<Shared, T, Stamp>,
        publisher: Rc<Publisher<Shared, T, Stamp>>,
        bell: Option<Rc<Bell>>,
        slots: Option<super::slots::Slots<T>>,
    ) -> Self {
        let audience = Audience { samples, seen: Cell::new((0, false)) };
        Self { publisher, bell, slots, audience, owes_wake: Cell::new(false), owes_echo: Cell::new(false) }
    }

    pub(super) fn owe_wake(&self) {
        self.owes_wake.set(true);
    }

    pub(super) fn owe_echo(&self) {
        self.owes_echo.set(true);
    }
}

impl<T: StateBuffer> AfterStep for Echo<T> {
    fn wake(&self) {
        if self.owes_wake.take()
            && let Some(bell) = &self.bell
        {
            bell.wake();
        }
    }

    fn echo(&self) {
        if !self.owes_echo.take() || !self.audience.is_there() {
            return;
        }
        let Some((stamp, payload)) = self.slots.as_ref().and_then(|slots| slots.newest()) else { return };
        // Whoever looks on keeps what it had if this cannot be sent: no component reads it.
        if let Ok(sample) = self.publisher.loan_uninit() {
            let mut sample = sample.write_payload(*payload);
            *sample.user_header_mut() = *stamp;
            let _ = sample.send();
        }
    }
}
