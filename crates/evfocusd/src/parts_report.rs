//! What parts of the picture say, as the socket and the files show it.

use evfocus_core::search::Bookings;
use evfocus_core::{Answer, Failure, FocusMap, TileFocus, Window};
use evfocus_ipc as ipc;

/// Where each part of the picture is sharp.
pub fn map(tiles: &FocusMap) -> ipc::FocusMap {
    let each = |of: fn(&TileFocus) -> f64| tiles.iter().map(|tile| tile.as_ref().map(of)).collect();
    ipc::FocusMap {
        columns: Bookings::COLUMNS as u64,
        rows: Bookings::ROWS as u64,
        position: each(|tile| tile.position.0),
        error_bar: each(|tile| tile.error_bar),
        confidence: each(|tile| tile.confidence),
        significance: each(|tile| tile.significance),
    }
}

/// What a window of the request says.
pub fn window((window, said): (Window, Result<Answer, Failure>)) -> ipc::WindowAnswer {
    let found = said.as_ref().ok();
    ipc::WindowAnswer {
        x: window.x.into(),
        y: window.y.into(),
        width: window.width.into(),
        height: window.height.into(),
        state: if found.is_some() { ipc::State::Focused } else { ipc::State::Failed },
        reason: said.as_ref().err().map(|failure| failure.name().to_owned()),
        message: said.as_ref().err().map(ToString::to_string),
        position: found.map(|answer| answer.position.0),
        error_bar: found.and_then(|answer| answer.error_bar),
        confidence: found.and_then(|answer| answer.confidence),
        flags: found
            .into_iter()
            .flat_map(|answer| answer.flags.iter())
            .map(|flag| flag.name().to_owned())
            .collect(),
    }
}
