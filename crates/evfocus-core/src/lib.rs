//! The pure core of evfocus: it decodes what cameras send, counts events, aligns clocks, measures focus, searches for it, and decides what a focus run
//! does next.
//!
//! Not its job: opening devices, waiting, reading clocks, spawning, logging. Time is an argument everywhere. The crate is
//! `no_std` with `alloc`, so the compiler keeps this true.
#![no_std]

extern crate alloc;
#[cfg(test)]
extern crate std;

mod analysis;
mod answer;
mod clock_map;
pub mod controller;
mod counter;
mod curve;
mod damage;
pub mod decode;
mod delay;
mod event;
mod event_list;
mod event_store;
mod flags;
mod hot_pixels;
mod lens_trace;
mod measure;
mod packed_event;
mod quality;
mod report;
pub mod search;
mod sharpness;
mod sweep;
mod units;

pub use analysis::{Analyzer, Question, SweepLimits};
pub use answer::{
    Answer, FocusMap, Prefer, Rules, TileFocus, UnknownPreference, answer, focus_map, is_at_edge,
    window_answers,
};
pub use clock_map::{ClockEvent, ClockMap, ClockMapQuality, NoClockYet};
pub use controller::{Controller, ControllerConfig};
pub use counter::{CounterError, CumulativeCounter, EventCounts};
pub use curve::{CurvePoint, FocusCurve};
pub use damage::Damage;
pub use delay::{Delay, DelayModel};
pub use event::{Event, EventBatch, Geometry, Polarity, Window};
pub use event_list::{EventList, Events};
pub use event_store::EventStore;
pub use flags::{Flag, Flags};
pub use hot_pixels::HotPixels;
pub use lens_trace::{Leg, LensSample, LensTrace, LensTraceError};
pub use measure::{PixelCounts, event_rate};
pub use packed_event::{DoesNotFit, LARGEST_ADDRESS};
pub use quality::SweepQuality;
pub use report::{
    Directions, Failure, FocusPlan, LegReport, Outcome, Phase, RunId, RunReport, Suspicion, Windows,
};
pub use search::{Estimate, Method, SearchError, Searcher};
pub use sharpness::SharpnessMeter;
pub use sweep::{HOLD, Sweep, SweepCapacity, SweepRecorder};
pub use units::{
    CameraMicros, EventRate, HostMicros, LensPosition, LensRange, LensSpeed, Timestamp, UnitError,
};
