//! An allocator that knows how much a thread holds, so that a trial can tell whether its memory grows.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Bytes: trials run on a thread each, and hand nothing to others.
    static HELD: Cell<i64> = const { Cell::new(0) };
}

/// Bytes that this thread has asked for and not given back.
pub(super) fn held() -> i64 {
    HELD.get()
}

struct Counting;

fn count(bytes: i64) {
    // A thread that is ending has no count any more.
    let _gone = HELD.try_with(|held| held.set(held.get() + bytes));
}

#[expect(
    unsafe_code,
    reason = "an allocator is unsafe by its nature; this one passes everything on to the system's"
)]
// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as i64 - layout.size() as i64);
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as i64));
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_known() {
        let before = held();
        let bytes = std::hint::black_box(vec![1_u8; 1000]);
        assert_eq!(held() - before, 1000);
        drop(bytes);
        assert_eq!(held(), before);
    }
}
