//! Prefetching of the cache lines that a step needs first.

use std::cell::Cell;

use crate::os::{prefetch_read, prefetch_write};

/// Maximum number of recorded lines; further lines are not prefetched.
const LINES: usize = 64;
/// Size of a cache line, bytes.
const LINE: usize = 64;
/// Flag of a line that is written.
const WRITTEN: usize = 1;

/// The cache lines that a step needs first: words of the control block, heads and next slots of its topics.
///
/// After a sleep, a thread's caches and address translations have been evicted by others. Misses on dependent
/// lines are sequential; prefetches overlap.
#[derive(Debug)]
pub(crate) struct FirstLines {
    /// Addresses, with the flag in the lowest bit.
    lines: [Cell<usize>; LINES],
    count: Cell<usize>,
}

impl Default for FirstLines {
    fn default() -> Self {
        Self { lines: [const { Cell::new(0) }; LINES], count: Cell::new(0) }
    }
}

/// Access for which a line is prefetched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Shared access: other cores keep their copies.
    Read,
    /// Exclusive access for this core.
    Write,
}

/// Index of a recorded line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Line(usize);

impl FirstLines {
    /// Records the line of an address. Returns `None` if the list is full.
    pub(crate) fn note<T>(&self, address: *const T, access: Access) -> Option<Line> {
        let line = Line(self.count.get());
        self.lines.get(line.0)?.set(marked(address, access));
        self.count.set(line.0 + 1);
        Some(line)
    }

    /// Records the first lines of values, up to a maximum.
    pub(crate) fn note_values<T>(&self, values: &[T], access: Access, at_most: usize) {
        self.note_range(values.as_ptr().cast(), size_of_val(values), access, at_most);
    }

    /// Records the first lines of a range of bytes, up to a maximum.
    pub(crate) fn note_range(&self, first: *const u8, bytes: usize, access: Access, at_most: usize) {
        let offset = first.addr() % LINE;
        for line in (0..bytes + offset).step_by(LINE).take(at_most) {
            self.note(first.wrapping_sub(offset).wrapping_add(line), access);
        }
    }

    /// Replaces the address of a recorded line.
    #[inline]
    pub(crate) fn replace<T>(&self, line: Line, address: *const T, access: Access) {
        if let Some(noted) = self.lines.get(line.0) {
            noted.set(marked(address, access));
        }
    }

    /// Prefetches all lines.
    #[inline]
    pub(crate) fn fetch(&self) {
        for line in self.lines.iter().take(self.count.get()) {
            let address = core::ptr::without_provenance::<u8>(line.get() & !WRITTEN);
            if line.get() & WRITTEN == 0 {
                prefetch_read(address, 1);
            } else {
                prefetch_write(address, 1);
            }
        }
    }
}

fn marked<T>(address: *const T, access: Access) -> usize {
    (address.addr() & !WRITTEN) | usize::from(access == Access::Write)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_beyond_the_capacity_are_not_recorded() {
        let (lines, word) = (FirstLines::default(), 7_u64);
        let noted: Vec<_> = (0..LINES).map(|_| lines.note(&raw const word, Access::Read)).collect();
        assert!(noted.iter().all(Option::is_some));
        assert_eq!(lines.note(&raw const word, Access::Write), None);
        lines.fetch();
        assert_eq!(word, 7);
    }

    #[test]
    fn replaced_line_keeps_its_index() {
        let (lines, words) = (FirstLines::default(), [[0_u64; 8]; 2]);
        let line = lines.note(&raw const words[0], Access::Write).unwrap();
        lines.note(&raw const words[1], Access::Read);
        lines.replace(line, &raw const words[1], Access::Read);
        assert_eq!(lines.lines[0].get(), lines.lines[1].get());
        assert_eq!(lines.count.get(), 2);
    }
}
