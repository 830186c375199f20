//! Failures of a component: errors and panics, as one line of text.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

/// The failure of a component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Index of the step, or of the step that would have been next.
    pub tick: u64,
    /// The message of the error or panic.
    pub message: String,
}

thread_local! {
    static PANIC: RefCell<Option<String>> = const { RefCell::new(None) };
    static CAUGHT: RefCell<bool> = const { RefCell::new(false) };
}

/// Keeps the message of a panic in the calling thread instead of printing it: the launcher prints it, with the
/// component's name.
pub(super) fn catch_panic_messages() {
    static ONCE: Once = Once::new();
    CAUGHT.with_borrow_mut(|caught| *caught = true);
    ONCE.call_once(|| {
        let default = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !CAUGHT.with_borrow(|caught| *caught) {
                return default(info);
            }
            let words = info.payload_as_str().unwrap_or("a value that is no text");
            let place = info.location().map(|l| format!(" at {}:{}", l.file(), l.line())).unwrap_or_default();
            PANIC.with_borrow_mut(|panic| *panic = Some(format!("panicked{place}: {words}")));
        }));
    });
}

/// Runs a call into a component; a panic becomes an error.
pub(super) fn guard<R, E: From<String>>(call: impl FnOnce() -> Result<R, E>) -> Result<R, E> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(result) => result,
        Err(_) => {
            let words = PANIC.with_borrow_mut(Option::take);
            Err(E::from(words.unwrap_or_else(|| "panicked".to_string())))
        }
    }
}
