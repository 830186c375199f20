//! Failures of a component: errors and panics, as one line of text.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

/// The failure of a component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Index of the current step, or of the step that would have been next.
    pub tick: u64,
    /// The message of the error or panic.
    pub message: String,
}

thread_local! {
    static PANIC: RefCell<Option<String>> = const { RefCell::new(None) };
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
            let words = info.payload_as_str().unwrap_or("a value that is no text");
            let place = info.location().map(|l| format!(" at {}:{}", l.file(), l.line())).unwrap_or_default();
            PANIC.with_borrow_mut(|panic| *panic = Some(format!("panicked{place}: {words}")));
        }));
    });
}

/// Runs a call into a component; a panic becomes an error.
#[inline(always)]
pub(super) fn guard<R, E: From<String>>(call: impl FnOnce() -> Result<R, E>) -> Result<R, E> {
    let outer = INSIDE.replace(true);
    let result = catch_unwind(AssertUnwindSafe(call));
    INSIDE.set(outer);
    match result {
        Ok(result) => result,
        Err(_) => Err(E::from(words_of_panic())),
    }
}

#[cold]
fn words_of_panic() -> String {
    PANIC.with_borrow_mut(Option::take).unwrap_or_else(|| "panicked".to_string())
}
