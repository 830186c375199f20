//! Refusals of entries of the drive table.

/// Value found, and advice.
pub(super) type Refusal = (String, &'static str);
