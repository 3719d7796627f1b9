//! Recorded focus sweeps with their truth: `NAME.raw` (events), `NAME.positions.csv` (lens) and `NAME.truth.json`, and a table
//! `reference.tsv` of what reference implementations answered.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use evfocus_core::{
    CameraMicros, Event, EventBatch, EventList, Geometry, LensPosition, LensTrace, SweepCapacity,
    SweepRecorder,
};
use evfocus_record::{MAX_EVENTS_PER_READ, Recording, positions};

/// The sweeps that come with the repository.
pub fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/sweeps")
}

/// A recorded sweep.
#[derive(Debug)]
pub struct RecordedSweep {
    /// Its name, which says what it shows.
    pub name: String,
    /// The sensor.
    pub geometry: Geometry,
    /// Where focus is.
    pub truth: LensPosition,
    /// All events.
    pub events: Vec<Event>,
    /// Where the lens was.
    pub trace: LensTrace<CameraMicros>,
}

impl RecordedSweep {
    /// Reads `name` in `folder`.
    ///
    /// # Errors
    /// A file that is missing, broken or damaged.
    pub fn read(folder: &Path, name: &str) -> anyhow::Result<Self> {
        let path = folder.join(format!("{name}.raw"));
        let mut recording = Recording::open(&path, None)?;
        let geometry = recording.geometry().context("the recording does not tell the sensor's size")?;
        let mut events = Vec::new();
        let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
        while recording.read(&mut batch)? {
            events.extend(batch.events.iter());
        }
        let trace = positions::read(folder.join(format!("{name}.positions.csv")))?;
        let truth = folder.join(format!("{name}.truth.json"));
        let text = fs::read_to_string(&truth).with_context(|| truth.display().to_string())?;
        let fields: serde_json::Value = serde_json::from_str(&text)?;
        let number =
            |field: &str| fields.get(field).and_then(serde_json::Value::as_f64).context("no such field");
        let expected = number("n_events")?;
        if (events.len() as f64 - expected).abs() > 0.5 {
            bail!("{} holds {} events, not {expected}", path.display(), events.len());
        }
        let truth = LensPosition(number("gt_position")?);
        Ok(Self { name: name.to_owned(), geometry, truth, events, trace })
    }

    /// The names of the sweeps in `folder`, sorted.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn names(folder: &Path) -> anyhow::Result<Vec<String>> {
        let mut names = Vec::new();
        for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let name = entry?.file_name();
            if let Some(name) = name.to_string_lossy().strip_suffix(".raw") {
                names.push(name.to_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// One recorder for each way the lens went, together holding every event.
    pub fn legs(&self) -> Vec<SweepRecorder> {
        let (low, high) = self.trace.extent().unwrap_or_default();
        let legs = self.trace.legs(0.05 * high.distance(low));
        let mut rest = self.events.as_slice();
        let mut recorders = Vec::new();
        for (index, leg) in legs.iter().enumerate() {
            let is_last = index + 1 == legs.len();
            let until = rest.partition_point(|event| is_last || event.t < leg.end);
            let (events, later) = rest.split_at(until);
            recorders.push(self.record(events));
            rest = later;
        }
        recorders
    }

    fn record(&self, events: &[Event]) -> SweepRecorder {
        let capacity = SweepCapacity { events: events.len(), ..SweepCapacity::default() };
        let mut recorder = SweepRecorder::new(self.geometry, capacity);
        if let Some(first) = events.first() {
            recorder.start(first.t);
        }
        let mut list = EventList::with_capacity(events.len());
        assert_eq!(list.append(events.iter().copied()), 0, "a sweep takes no days");
        recorder.feed(list.as_slice());
        recorder
    }
}

/// What the reference implementations answered for one sweep: error in lens counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The sweep.
    pub name: String,
    /// Column names and values, in the order of the file.
    pub columns: Vec<(String, f64)>,
}

impl Reference {
    /// The number in `column`.
    ///
    /// # Errors
    /// A column that the table lacks.
    pub fn get(&self, column: &str) -> anyhow::Result<f64> {
        let found = self.columns.iter().find(|(name, _)| name == column);
        found.map(|&(_, value)| value).with_context(|| format!("no column {column}"))
    }

    /// Reads `reference.tsv` in `folder`.
    ///
    /// # Errors
    /// A table that is missing or not one.
    pub fn read_all(folder: &Path) -> anyhow::Result<Vec<Self>> {
        let text = fs::read_to_string(folder.join("reference.tsv"))?;
        let mut lines = text.lines().map(|line| line.split('\t'));
        let header: Vec<&str> = lines.next().context("an empty table")?.skip(1).collect();
        let mut rows = Vec::new();
        for mut fields in lines {
            let name = fields.next().unwrap_or_default().to_owned();
            let mut columns = Vec::new();
            for (&column, field) in header.iter().zip(fields) {
                columns.push((column.to_owned(), field.parse().with_context(|| format!("{name}: {field}"))?));
            }
            rows.push(Self { name, columns });
        }
        Ok(rows)
    }
}
