//! Cuts a stream of bytes into words of a fixed size, wherever the buffers end.

/// Words of `N` bytes; keeps the part of a word that a buffer ended with.
#[derive(Debug, Clone)]
pub(super) struct Framing<const N: usize> {
    partial: [u8; N],
    held: usize,
}

impl<const N: usize> Framing<N> {
    pub(super) fn new() -> Self {
        Self { partial: [0; N], held: 0 }
    }

    /// Calls `word` for each word that `bytes` completes.
    pub(super) fn feed(&mut self, bytes: &[u8], mut word: impl FnMut([u8; N])) {
        self.feed_slices(bytes, |words| words.iter().for_each(|&bytes| word(bytes)));
    }

    /// Calls `take` with the words that `bytes` completes, in one slice or two.
    pub(super) fn feed_slices(&mut self, mut bytes: &[u8], mut take: impl FnMut(&[[u8; N]])) {
        if self.held > 0 {
            let (first, rest) = bytes.split_at(bytes.len().min(N - self.held));
            for (slot, &byte) in self.partial.iter_mut().skip(self.held).zip(first) {
                *slot = byte;
            }
            self.held += first.len();
            bytes = rest;
            if self.held < N {
                return;
            }
            self.held = 0;
            take(&[self.partial]);
        }
        let (words, rest) = bytes.as_chunks::<N>();
        take(words);
        for (slot, &byte) in self.partial.iter_mut().zip(rest) {
            *slot = byte;
        }
        self.held = rest.len();
    }

    /// Forgets a partial word and returns how many bytes it had.
    pub(super) fn finish(&mut self) -> u64 {
        let held = self.held;
        self.held = 0;
        held as u64
    }
}
