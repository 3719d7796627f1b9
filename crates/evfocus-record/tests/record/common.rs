//! What several tests of this crate need.

use std::path::{Path, PathBuf};

use evfocus_core::{CameraMicros, Event, EventBatch, Polarity};
use evfocus_record::{Format, MAX_EVENTS_PER_READ, Recording};
use tempfile::TempDir;

/// A file of `tests/data`.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// All events of a recording, read with one batch that never grows.
pub(crate) fn read_all(recording: &mut Recording) -> Vec<Event> {
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    let capacity = batch.events.capacity();
    let mut events = Vec::new();
    while recording.read(&mut batch).unwrap() {
        assert!(!batch.events.is_empty());
        events.extend(batch.events.iter());
    }
    assert_eq!(batch.events.capacity(), capacity, "the batch grew");
    events
}

/// All events of a file.
pub(crate) fn read_file(path: &Path, format: Option<Format>) -> Vec<Event> {
    read_all(&mut Recording::open(path, format).unwrap())
}

/// A file with this content and name in a folder of its own, which lives as long as the first value.
pub(crate) fn file(name: &str, content: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

/// An event, ON for `true`.
pub(crate) fn event(t: i64, x: u16, y: u16, on: bool) -> Event {
    Event { t: CameraMicros(t), x, y, polarity: Polarity::from_on(on) }
}

/// The events, `micros` later.
pub(crate) fn shifted(events: &[Event], micros: i64) -> Vec<Event> {
    events.iter().map(|event| Event { t: CameraMicros(event.t.0 + micros), ..*event }).collect()
}
