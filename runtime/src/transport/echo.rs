//! What an output does when the step that published is over: it wakes those it triggers on its own core, and repeats
//! small states over iceoryx2, for tools and for programs with stock iceoryx2.

use std::cell::Cell;
use std::fmt::Debug;
use std::rc::Rc;

use iceoryx2::port::publisher::Publisher;

use super::Shared;
use super::bell::Bell;
use crate::state::{Stamp, StateBuffer};

/// What is left to do for an output when a step is over.
pub(crate) trait AfterStep: Debug {
    /// Wakes those that the step has triggered.
    fn wake(&self);

    /// Repeats what the step has published.
    fn echo(&self);
}

/// The duties of one output.
#[derive(Debug)]
pub(super) struct Echo<T: StateBuffer> {
    publisher: Rc<Publisher<Shared, T, Stamp>>,
    bell: Option<Rc<Bell>>,
    slots: Option<super::slots::Slots<T>>,
    owes_wake: Cell<bool>,
    owes_echo: Cell<bool>,
}

impl<T: StateBuffer> Echo<T> {
    pub(super) fn new(
        publisher: Rc<Publisher<Shared, T, Stamp>>,
        bell: Option<Rc<Bell>>,
        slots: Option<super::slots::Slots<T>>,
    ) -> Self {
        Self { publisher, bell, slots, owes_wake: Cell::new(false), owes_echo: Cell::new(false) }
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
        if !self.owes_echo.take() {
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
