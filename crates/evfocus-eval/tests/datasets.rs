//! The readers of the public data sets, on small files in their layouts made by SciPy and NumPy (`data/datasets.py`).

use std::path::{Path, PathBuf};

use evfocus_core::{CameraMicros, Event, LensPosition, Polarity};
use evfocus_eval::dataset::{Condition, Sequence, ead, elp};

const EVENTS: u16 = 300;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Event `index` of every file, as the script says.
fn event(index: u16) -> Event {
    Event {
        t: CameraMicros(1000 + 10 * i64::from(index)),
        x: 7 * index % 346,
        y: 11 * index % 260,
        polarity: Polarity::from_on(index % 2 == 1),
    }
}

fn events(range: impl Iterator<Item = u16>) -> Vec<Event> {
    range.map(event).collect()
}

fn positions(sequence: &Sequence, times: &[i64]) -> Vec<f64> {
    times
        .iter()
        .filter_map(|&t| sequence.trace.position_at(t as f64).ok())
        .map(|position| position.0)
        .collect()
}

#[test]
fn ead_is_read_whatever_its_numbers_are_stored_as() -> anyhow::Result<()> {
    let dataset = ead::dataset(&data("ead"))?;
    let labels = dataset.entries.iter().map(|entry| (entry.label.name.as_str(), entry.label.condition));
    let expected = [
        ("dark_shake_whole", Some(Condition::DarkDynamic)),
        ("light_static_doubles", Some(Condition::LightStatic)),
    ];
    assert_eq!(labels.collect::<Vec<_>>(), expected);
    for (name, truth) in [("dark_shake_whole", 987.5), ("light_static_doubles", 1234.0)] {
        let path = data("ead").join(name).join("events.mat");
        let sequence = ead::read(&path, truth)?;
        assert_eq!(sequence.events, events(0..EVENTS), "{name}");
        assert_eq!((sequence.geometry.width, sequence.geometry.height), (346, 260));
        assert_eq!(sequence.truths, [truth]);
        assert_eq!(sequence.trace.first(), Some((CameraMicros(1000), LensPosition(220.0))));
        assert_eq!(
            positions(&sequence, &[1000, 2000, 2500, 3000, 3990]),
            [220.0, 720.0, 970.0, 1220.0, 1715.0]
        );
    }
    Ok(())
}

#[test]
fn elp_is_read_as_rows_and_as_records() -> anyhow::Result<()> {
    let dataset = elp::dataset(&data("elp"))?;
    assert_eq!(dataset.entries.len(), 4);
    for name in ["davis/doubles", "davis/big-endian"] {
        let sequence = elp::read(&data("elp").join(name))?;
        // Within the times of info.txt: 1100 to 3500 us.
        assert_eq!(sequence.events, events(10..=250), "{name}");
        assert_eq!(sequence.truths, [0.9], "milliseconds since the start of the sweep");
    }
    let records = elp::read(&data("elp/evk4/records"))?;
    assert_eq!(records.events, events(0..EVENTS));
    assert_eq!(records.truths, [1.5]);
    Ok(())
}

#[test]
fn an_array_stored_by_columns_is_refused_and_not_mixed_up() {
    let error = elp::read(&data("elp/by-columns/one")).unwrap_err().to_string();
    assert!(error.contains("event.npy") && error.contains("N x 4"), "{error}");
}
