//! The little of flatbuffers that AEDAT 4 needs, with every offset checked: two tables with three fields at most.
//!
//! A generated reader would verify packets too, but its code is unsafe inside and larger than this.

use std::borrow::Cow;
use std::ops::Range;

/// A table in a buffer: the buffer without its size prefix, and where the table and its vtable are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Table<'a> {
    buffer: &'a [u8],
    position: usize,
    vtable: usize,
}

impl<'a> Table<'a> {
    /// The root table of `buffer`, which must bear `identifier`. `None` for anything inconsistent.
    pub(super) fn root(buffer: &'a [u8], identifier: [u8; 4]) -> Option<Self> {
        if bytes::<4>(buffer, 4)? != identifier {
            return None;
        }
        let position = offset(buffer, 0)?;
        // The vtable lies before or after the table: a signed distance, subtracted.
        let distance = i64::from(i32::from_le_bytes(bytes(buffer, position)?));
        let vtable = usize::try_from(i64::try_from(position).ok()? - distance).ok()?;
        Some(Self { buffer, position, vtable })
    }

    /// Where field number `index` is; `None` if absent, when it has its default.
    fn field(&self, index: usize) -> Option<usize> {
        let vtable_bytes = usize::from(u16::from_le_bytes(bytes(self.buffer, self.vtable)?));
        let entry = 4 + 2 * index;
        if entry + 2 > vtable_bytes {
            return None;
        }
        let offset = u16::from_le_bytes(bytes(self.buffer, self.vtable.checked_add(entry)?)?);
        (offset != 0).then(|| self.position.checked_add(usize::from(offset)))?
    }

    pub(super) fn i32(&self, index: usize) -> Option<i32> {
        Some(i32::from_le_bytes(bytes(self.buffer, self.field(index)?)?))
    }

    pub(super) fn i64(&self, index: usize) -> Option<i64> {
        Some(i64::from_le_bytes(bytes(self.buffer, self.field(index)?)?))
    }

    /// Where in the buffer the content of a vector of structs of `size` bytes is; it lies within the buffer.
    pub(super) fn vector(&self, index: usize, size: usize) -> Option<Range<usize>> {
        let field = self.field(index)?;
        let start = field.checked_add(offset(self.buffer, field)?)?;
        let length = offset(self.buffer, start)?.checked_mul(size)?;
        let first = start.checked_add(4)?;
        let range = first..first.checked_add(length)?;
        self.buffer.get(range.clone()).map(|_| range)
    }

    /// A string; empty if absent.
    pub(super) fn string(&self, index: usize) -> Cow<'a, str> {
        let bytes = self.vector(index, 1).and_then(|range| self.buffer.get(range));
        String::from_utf8_lossy(bytes.unwrap_or_default())
    }

    /// Whether field number `index` is there at all.
    pub(super) fn has(&self, index: usize) -> bool {
        self.field(index).is_some()
    }
}

/// An unsigned 32-bit number as an offset.
fn offset(buffer: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32::from_le_bytes(bytes(buffer, at)?)).ok()
}

fn bytes<const N: usize>(buffer: &[u8], at: usize) -> Option<[u8; N]> {
    buffer.get(at..)?.first_chunk().copied()
}
