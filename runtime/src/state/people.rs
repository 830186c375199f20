//! Operator input and output: buttons and axes, text, events.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// Maximum number of axes of [`Controls`].
pub const MAX_AXES: usize = 16;
/// Maximum length of a [`Text`], bytes.
pub const MAX_TEXT: usize = 1024;
/// Maximum length of the text in an [`Event`], bytes.
pub const MAX_EVENT_TEXT: usize = 128;

counted_buffer! {
    /// Axes and buttons of a keyboard, a gamepad or a SpaceMouse.
    ///
    /// ```
    /// use motorium::state::Controls;
    ///
    /// let mut controls = Controls::default();
    /// controls.buttons = 0b101;
    /// controls.set_count(6);
    /// assert!(controls.is_pressed(2) && !controls.is_pressed(1));
    /// ```
    pub struct Controls as "motorium.Controls", at most MAX_AXES {
        plain {
            /// Bit mask of the pressed buttons; button 0 is the lowest bit.
            buttons: u64;
        }
        counted {
            /// Positions of the axes, -1 to 1.
            axis, axis_mut: f64;
        }
    }
}

impl Controls {
    /// Returns `true` if a button is pressed. Buttons are counted from 0.
    pub fn is_pressed(&self, button: u32) -> bool {
        button < 64 && self.buttons >> button & 1 == 1
    }
}

counted_buffer! {
    /// A line of text in UTF-8.
    ///
    /// ```
    /// use motorium::state::Text;
    ///
    /// assert_eq!(Text::truncated("go").as_str(), "go");
    /// assert_eq!(Text::truncated(&"long ".repeat(1000)).as_str().len(), 1024, "cut at the buffer length");
    /// ```
    pub struct Text as "motorium.Text", at most MAX_TEXT {
        counted {
            /// Bytes of the text.
            text, text_mut: u8;
        }
    }
}

impl Text {
    /// Creates a text, truncated after the last character that fits.
    pub fn truncated(text: &str) -> Self {
        let mut buffer = Self::default();
        let end = text.floor_char_boundary(MAX_TEXT);
        buffer.set_count(end);
        buffer.text_mut().copy_from_slice(&text.as_bytes()[..end]);
        buffer
    }

    /// Returns the text up to the first byte that is not valid UTF-8.
    pub fn as_str(&self) -> &str {
        valid(self.text())
    }
}

counted_buffer! {
    /// A single event of a component: a code, a value and a short text.
    ///
    /// ```
    /// use motorium::state::Event;
    ///
    /// let mut event = Event::truncated("goal out of reach");
    /// event.severity = Event::WARNING;
    /// assert_eq!(event.as_str(), "goal out of reach");
    /// ```
    pub struct Event as "motorium.Event", at most MAX_EVENT_TEXT {
        plain {
            /// Number that identifies the kind of the event. Its meaning is defined by the publisher.
            code: u32;
            /// Severity: one of the constants of this type.
            severity: u32;
            /// Number that belongs to the event, in a unit defined by `code`.
            value: f64;
        }
        counted {
            /// Text for users, in UTF-8.
            text, text_mut: u8;
        }
    }
}

impl Event {
    /// Severity: normal operation.
    pub const INFORMATION: u32 = 0;
    /// Severity: a condition that is allowed, but probably unintended.
    pub const WARNING: u32 = 1;
    /// Severity: a failure.
    pub const ERROR: u32 = 2;

    /// Creates an event with this text, truncated after the last character that fits. All other fields are
    /// zero.
    pub fn truncated(text: &str) -> Self {
        let mut event = Self::default();
        let end = text.floor_char_boundary(MAX_EVENT_TEXT);
        event.set_count(end);
        event.text_mut().copy_from_slice(&text.as_bytes()[..end]);
        event
    }

    /// Returns the text up to the first byte that is not valid UTF-8.
    pub fn as_str(&self) -> &str {
        valid(self.text())
    }
}

/// Returns the text of bytes, up to the first byte that is not UTF-8.
pub(super) fn valid(bytes: &[u8]) -> &str {
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        // the bytes before the error are valid
        Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    }
}
