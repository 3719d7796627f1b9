//! A file that holds how trials went, a line of JSON each, so that a long series can be stopped and taken up.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::{Ended, Trial};

/// What trials in continuous mode are listed under.
const CONTINUOUS: &str = "(in continuous mode)";

/// How a trial went, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// What it follows from.
    pub seed: u64,
    /// What went wrong.
    pub mishaps: Vec<String>,
    /// How each run ended.
    pub outcomes: Vec<String>,
    /// The invariants that did not hold.
    pub broken: Vec<String>,
    /// Virtual time that it took.
    pub lasted: Duration,
    /// The most that memory grew by, bytes.
    pub grown: u64,
}

impl Row {
    /// That of `trial`, which `ended` so.
    pub fn new(seed: u64, trial: &Trial, ended: Ended) -> Self {
        Self {
            seed,
            mishaps: trial
                .mishaps
                .iter()
                .map(ToString::to_string)
                .chain(trial.is_continuous.then(|| CONTINUOUS.to_owned()))
                .collect(),
            outcomes: ended.outcomes.iter().map(ToString::to_string).collect(),
            broken: ended.broken,
            lasted: ended.lasted,
            grown: ended.grown,
        }
    }

    /// What is broken, in a line.
    pub fn complaint(&self) -> String {
        let mishaps = if self.mishaps.is_empty() { "nothing".to_owned() } else { self.mishaps.join(", ") };
        format!("seed {}, {mishaps}: {}", self.seed, self.broken.join("; "))
    }

    fn to_json(&self) -> Value {
        json!({
            "seed": self.seed,
            "mishaps": self.mishaps,
            "outcomes": self.outcomes,
            "broken": self.broken,
            "lasted_s": self.lasted.as_secs_f64(),
            "grown": self.grown,
        })
    }

    fn from_json(line: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(line).ok()?;
        let words = |name: &str| -> Option<Vec<String>> {
            value.get(name)?.as_array()?.iter().map(|word| Some(word.as_str()?.to_owned())).collect()
        };
        Some(Self {
            seed: value.get("seed")?.as_u64()?,
            mishaps: words("mishaps")?,
            outcomes: words("outcomes")?,
            broken: words("broken")?,
            lasted: Duration::try_from_secs_f64(value.get("lasted_s")?.as_f64()?).ok()?,
            grown: value.get("grown")?.as_u64()?,
        })
    }
}

/// The file, or none.
#[derive(Debug)]
pub struct Record(Option<File>);

impl Record {
    /// The file at `path`, which is made if it is not there, and what it holds. A line that was torn by a stop does not count.
    ///
    /// # Errors
    /// If it cannot be read or written.
    pub fn open(path: Option<&Path>) -> Result<(Self, Vec<Row>)> {
        let Some(path) = path else { return Ok((Self(None), Vec::new())) };
        let open = || -> Result<(Self, Vec<Row>)> {
            let mut file = OpenOptions::new().create(true).append(true).open(path)?;
            let text = std::fs::read_to_string(path)?;
            if !text.is_empty() && !text.ends_with('\n') {
                file.write_all(b"\n")?;
            }
            Ok((Self(Some(file)), text.lines().filter_map(Row::from_json).collect()))
        };
        open().with_context(|| format!("cannot record in {}", path.display()))
    }

    /// Adds a line.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, row: &Row) -> Result<()> {
        let Some(file) = &mut self.0 else { return Ok(()) };
        file.write_all(format!("{}\n", row.to_json()).as_bytes()).context("cannot record a trial")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_comes_back_and_a_torn_one_does_not() {
        let row = Row {
            seed: 7,
            mishaps: vec!["a lens that is silent".to_owned()],
            outcomes: vec!["lens-silent".to_owned()],
            broken: Vec::new(),
            lasted: Duration::from_millis(1500),
            grown: 77,
        };
        let line = row.to_json().to_string();
        assert_eq!(Row::from_json(&line), Some(row));
        assert_eq!(Row::from_json(&line[..line.len() / 2]), None);
    }
}
