//! Pure decoders: bytes in, events out. They keep their state between calls, so the bytes may be cut anywhere; they never
//! panic, never wait, and hold no memory of their own beyond a partial word.

mod davis;
mod evt2;
pub(crate) mod evt3;
mod framing;

pub use davis::DavisWordDecoder;
pub(crate) use davis::looks_like_davis_words;
pub use evt2::Evt2Decoder;
pub use evt3::Evt3Decoder;
