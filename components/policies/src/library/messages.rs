//! Messages of `policy.library` other than targets.

/// Maximum number of weights in a message.
pub const MAX_WEIGHTS: usize = 64;
/// Maximum number of bytes of a label in a message.
pub const MAX_LABEL: usize = 32;

motorium::state_buffer! {
    /// A request for a movement, by label or by weights. The movement starts when the current movement has
    /// ended.
    pub struct MovementRequest as "motorium.MovementRequest" {
        /// Number of the request. A new number marks a new request; 0 means no request.
        pub sequence: u64,
        /// Label, or id of a movement, in UTF-8, padded with 0. All 0 for weights without a label.
        pub label: [u8; 32],
        /// Number of weights. With a label, the number of eigenforces to use (0: as configured).
        pub count: u64,
        /// Weights of the first eigenforces, if there is no label. Start, goal and duration are copied from
        /// the previous movement.
        pub weights: [f64; 64],
    }
}

motorium::state_buffer! {
    /// Result of recognising the movement that has just ended.
    pub struct Recognition as "motorium.Recognition" {
        /// Number of movements recognised so far.
        pub sequence: u64,
        /// Index of the nearest movement of the library.
        pub movement: u64,
        /// Label of the nearest movement (or its id, if it has no label) in UTF-8, padded with 0.
        pub label: [u8; 32],
        /// Distance between the weights of the recognised movement and of the nearest movement, relative to
        /// the norm of `weights`.
        pub distance: f64,
        /// Fraction of the movement that the eigenforces do not explain, 0 to 1.
        pub novelty: f64,
        /// Duration of the recognised movement, s.
        pub duration: f64,
        /// Number of weights.
        pub count: u64,
        /// Weights of the recognised movement.
        pub weights: [f64; 64],
    }
}

/// Returns the text of a label.
pub(super) fn text(label: &[u8; MAX_LABEL]) -> &str {
    let end = label.iter().position(|byte| *byte == 0).unwrap_or(MAX_LABEL);
    std::str::from_utf8(&label[..end]).unwrap_or("")
}

/// Returns a label as bytes, truncated if it is too long.
pub(super) fn bytes(text: &str) -> [u8; MAX_LABEL] {
    let mut label = [0; MAX_LABEL];
    let end = (0..=text.len().min(MAX_LABEL)).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    label[..end].copy_from_slice(&text.as_bytes()[..end]);
    label
}
