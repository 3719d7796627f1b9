//! Work on words, compiled for several processors, the best of which is chosen when the program runs.

use pulp::{Arch, Simd, WithSimd};

/// Who takes words and turns them into something for `Out`.
pub(super) trait TakeWords<Out> {
    /// Takes `words`. It and all that is worth vector instructions must be `#[inline(always)]`: only what becomes part of the caller is
    /// compiled for its processor.
    fn take_words(&mut self, words: &[[u8; 2]], out: &mut Out);
}

/// [`TakeWords::take_words`] with the widest vector instructions that this processor has, as far as the compiler finds a use for them.
pub(super) fn take_words<Out>(taker: &mut impl TakeWords<Out>, words: &[[u8; 2]], out: &mut Out) {
    Arch::new().dispatch(Work { taker, words, out });
}

struct Work<'a, Taker, Out> {
    taker: &'a mut Taker,
    words: &'a [[u8; 2]],
    out: &'a mut Out,
}

impl<Out, Taker: TakeWords<Out>> WithSimd for Work<'_, Taker, Out> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.taker.take_words(self.words, self.out);
    }
}
