//! Converts a recording: `convert IN OUT`, where the extension of OUT decides the format: .raw (EVT3), .aedat4 or .csv.

use std::error::Error;
use std::path::Path;

use evfocus_core::{EventBatch, Events};
use evfocus_record::{
    Aedat4Compression, Aedat4Writer, CsvWriter, Evt3Writer, MAX_EVENTS_PER_READ, RecordError, Recording,
    Summary,
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output] = arguments.as_slice() else {
        return Err("usage: convert IN OUT.raw|OUT.aedat4|OUT.csv".into());
    };
    let recording = Recording::open(input, None)?;
    let geometry = match recording.geometry() {
        Some(geometry) => Some(geometry),
        None => Summary::of_file(input, None)?.geometry,
    };
    let geometry = geometry.ok_or("the recording is empty, so the size of its sensor is unknown")?;
    match Path::new(output).extension().and_then(|extension| extension.to_str()) {
        Some("raw") => {
            let mut writer = Evt3Writer::create(output, geometry)?;
            copy(recording, |events| writer.write(events.iter()))?;
            writer.finish()?;
        }
        Some("aedat4") => {
            let mut writer = Aedat4Writer::create(output, geometry, Aedat4Compression::Lz4)?;
            copy(recording, |events| writer.write(events.iter()))?;
            writer.finish()?;
        }
        Some("csv") => {
            let mut writer = CsvWriter::create(output)?;
            copy(recording, |events| writer.write(events.iter()))?;
            writer.finish()?;
        }
        _ => return Err("the output must end in .raw, .aedat4 or .csv".into()),
    }
    Ok(())
}

fn copy(
    mut recording: Recording,
    mut write: impl FnMut(Events<'_>) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    while recording.read(&mut batch)? {
        write(batch.events.as_slice())?;
    }
    Ok(())
}
