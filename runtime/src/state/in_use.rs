//! Parts of a slot that are in use: counted arrays up to their count.

use super::TypeLayout;

/// Address ranges of a slot that are in use and worth prefetching. A joint state has capacity for 64 joints;
/// with 8 joints, the cache lines of the other 56 are not prefetched and evict nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct InUse(Box<[Part]>);

/// A part of a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    /// Bytes from the beginning of the slot.
    offset: usize,
    size: usize,
    /// Count of a counted array.
    counted: Option<Counted>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Counted {
    /// Offset of the count in the value, bytes.
    at: usize,
    /// Size of an entry, bytes.
    entry: usize,
}

impl InUse {
    /// Maximum number of prefetched bytes. For longer values the hardware prefetcher detects the access
    /// pattern.
    pub(crate) const MOST: usize = 1024;

    /// Returns the parts of a slot whose value has this layout and starts at offset `value`.
    pub(crate) fn from_layout(layout: &TypeLayout, value: usize) -> Self {
        let counted = |name: &str, kind: &str, size: usize| {
            let count = layout.fields.iter().find(|field| field.name == name)?;
            let capacity: usize = kind.trim_end_matches(']').rsplit("; ").next()?.parse().ok()?;
            let is_there = count.offset + size_of::<u32>() <= layout.size;
            let entry = size.checked_div(capacity).filter(|entry| is_there && *entry > 0)?;
            Some(Counted { at: count.offset, entry })
        };
        let whole = Part { offset: 0, size: value + layout.size, counted: None };
        let mut arrays = Vec::new();
        for field in &layout.fields {
            let Some(count) = &field.count else { continue };
            // Adjacent parts are merged.
            let Some(counted) = counted(count, &field.kind, field.size) else { return Self([whole].into()) };
            arrays.push(Part { offset: value + field.offset, size: field.size, counted: Some(counted) });
        }
        arrays.sort_by_key(|part| part.offset);
        let (mut parts, mut end) = (Vec::new(), 0);
        for array in arrays {
            if array.offset > end {
                parts.push(Part { offset: end, size: array.offset - end, counted: None });
            }
            end = array.offset + array.size;
            parts.push(array);
        }
        if whole.size > end {
            parts.push(Part { offset: end, size: whole.size - end, counted: None });
        }
        Self(parts.into())
    }

    /// Calls `tell` with offsets and sizes of the parts in use; `count` reads the count at an offset of the
    /// value.
    #[inline]
    pub(crate) fn each(&self, count: impl Fn(usize) -> usize, mut tell: impl FnMut(usize, usize)) {
        let mut left = Self::MOST;
        for part in &self.0 {
            let size = match part.counted {
                Some(Counted { at, entry }) => count(at).saturating_mul(entry).min(part.size),
                None => part.size,
            };
            let size = size.min(left);
            if size > 0 {
                tell(part.offset, size);
            }
            left -= size;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{JointCommand, PoseTarget, StateBuffer};

    fn parts(in_use: &InUse, count: usize) -> Vec<(usize, usize)> {
        let mut parts = Vec::new();
        in_use.each(|_| count, |offset, size| parts.push((offset, size)));
        parts
    }

    /// Returns the number of cache lines of the parts in a line-aligned slot.
    fn lines(parts: &[(usize, usize)]) -> usize {
        let lines = parts.iter().flat_map(|(offset, size)| offset / 64..=(offset + size - 1) / 64);
        lines.collect::<std::collections::BTreeSet<_>>().len()
    }

    #[test]
    fn command_for_eight_joints_prefetches_eight_entries() {
        let in_use = InUse::from_layout(&JointCommand::layout(), 56);
        let of_eight = parts(&in_use, 8);
        // Stamp words and count, then position, velocity, effort, kp and kd.
        assert_eq!(of_eight, [(0, 64), (64, 64), (576, 64), (1088, 64), (1600, 64), (2112, 64)]);
        assert_eq!(lines(&of_eight), 6);
        assert_eq!(parts(&in_use, 0), [(0, 64)]);
        let all: usize = parts(&in_use, usize::MAX).iter().map(|(_, size)| size).sum();
        assert_eq!(all, InUse::MOST, "a damaged count fetches no more than the longest value");
    }

    #[test]
    fn value_without_counted_arrays_is_one_part() {
        let layout = PoseTarget::layout();
        assert_eq!(parts(&InUse::from_layout(&layout, 56), 7), [(0, 56 + layout.size)]);
    }
}
