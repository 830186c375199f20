//! Failures of calls into a component: errors and panics.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

pub use crate::region::Failure;
use crate::region::{End, PanicOrigin, panic_end};

/// The cause of a failed call into a component, before its tick is known.
#[derive(Debug)]
pub(super) struct Cause {
    end: End,
    text: String,
}

impl Cause {
    /// Converts the cause to a failure at a step.
    pub(super) fn into_failure(self, tick: u64) -> Failure {
        Failure { tick, end: self.end, text: self.text }
    }

    /// Prefixes the text with the failed operation.
    pub(super) fn during(self, operation: &str) -> Self {
        Self { text: format!("{operation}: {}", self.text), ..self }
    }
}

impl From<String> for Cause {
    fn from(text: String) -> Self {
        Self { end: End::Failed, text }
    }
}

thread_local! {
    static PANIC: RefCell<Option<Cause>> = const { RefCell::new(None) };
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// Keeps the message of a panic within [`guard`] instead of printing it; the launcher prints it with the
/// component's name. Other panics of the program are printed as usual.
pub(super) fn catch_panic_messages() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let default = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !INSIDE.get() {
                return default(info);
            }
            let (end, text) = panic_end(info.location(), info.payload_as_str());
            PANIC.with_borrow_mut(|panic| *panic = Some(Cause { end, text }));
        }));
    });
}

/// Runs a call into a component. Converts a panic to an error.
#[inline(always)]
pub(super) fn guard<R, E: From<Cause>>(call: impl FnOnce() -> Result<R, E>) -> Result<R, E> {
    let outer = INSIDE.replace(true);
    let result = catch_unwind(AssertUnwindSafe(call));
    INSIDE.set(outer);
    match result {
        Ok(result) => result,
        Err(_) => Err(E::from(caught())),
    }
}

#[cold]
fn caught() -> Cause {
    PANIC.with_borrow_mut(Option::take).unwrap_or_else(|| {
        let end = End::Panicked(PanicOrigin::Component);
        Cause { end, text: end.to_string() }
    })
}
