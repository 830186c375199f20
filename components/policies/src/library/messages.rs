//! Messages of `policy.library` beside targets.

/// The most weights of one message.
pub const MAX_WEIGHTS: usize = 64;
/// The most bytes of a label in a message.
pub const MAX_LABEL: usize = 32;

motorium::state_buffer! {
    /// Asks for a movement: of a label, or of weights. It begins when the one under way has ended.
    pub struct MovementRequest as "motorium.MovementRequest" {
        /// Number of the request: a new number is a new request, 0 is no request.
        pub sequence: u64,
        /// A label, or the id of a movement, in UTF-8, padded with 0; all 0 for weights alone.
        pub label: [u8; 32],
        /// Number of weights. With a label, that many eigenforces are used (0: as configured).
        pub count: u64,
        /// Weights of the first eigenforces, if there is no label. Start, goal and duration are those of the
        /// movement before.
        pub weights: [f64; 64],
    }
}

motorium::state_buffer! {
    /// Recognition of the movement that just ended.
    pub struct Recognition as "motorium.Recognition" {
        /// Counts what was recognised.
        pub sequence: u64,
        /// Index of the nearest movement of the library.
        pub movement: u64,
        /// Its label (or id, if it has none) in UTF-8, padded with 0.
        pub label: [u8; 32],
        /// Distance of the weights from those of that movement, over their length.
        pub distance: f64,
        /// Residual of the eigenforces, 0 to 1.
        pub novelty: f64,
        /// Duration, s.
        pub duration: f64,
        /// Number of weights.
        pub count: u64,
        /// Its weights.
        pub weights: [f64; 64],
    }
}

/// The text of a label.
pub(super) fn text(label: &[u8; MAX_LABEL]) -> &str {
    let end = label.iter().position(|byte| *byte == 0).unwrap_or(MAX_LABEL);
    std::str::from_utf8(&label[..end]).unwrap_or("")
}

/// A label as bytes; what is too long is cut.
pub(super) fn bytes(text: &str) -> [u8; MAX_LABEL] {
    let mut label = [0; MAX_LABEL];
    let end = (0..=text.len().min(MAX_LABEL)).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    label[..end].copy_from_slice(&text.as_bytes()[..end]);
    label
}
