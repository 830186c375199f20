//! Digests of published content.

use twox_hash::xxhash3_64::{DEFAULT_SECRET_LENGTH, RawHasher, SecretBuffer};

/// An incremental 64-bit digest (XXH3) of published content, by which lockstep runs are compared: equal runs
/// have equal digests.
pub struct Digest(RawHasher<&'static [u8; DEFAULT_SECRET_LENGTH]>);

impl Default for Digest {
    fn default() -> Self {
        // Without heap memory, because outputs create digests during steps.
        Self(RawHasher::new(SecretBuffer::default()))
    }
}

impl Digest {
    /// Adds bytes to the digest.
    pub fn write(&mut self, bytes: &[u8]) {
        core::hash::Hasher::write(&mut self.0, bytes);
    }

    /// Adds an integer to the digest.
    pub fn write_u64(&mut self, value: u64) {
        self.write(&value.to_le_bytes());
    }

    /// Returns the digest of all bytes written so far.
    pub fn finish(&self) -> u64 {
        core::hash::Hasher::finish(&self.0)
    }
}

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Digest({:016x})", self.finish())
    }
}
