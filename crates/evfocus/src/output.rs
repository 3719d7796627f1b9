//! Standard output and standard error, both of which may go away at any time.

use std::io::{self, IsTerminal, StdoutLock, Write};

use serde::Serialize;

/// Standard output. A reader that has seen enough (`| head`) ends the output, not the program: what is written after that
/// is dropped, and [`is_closed`](Self::is_closed) tells commands that would go on for ever.
#[derive(Debug)]
pub struct Output {
    stdout: StdoutLock<'static>,
    closed: bool,
}

impl Output {
    /// Takes standard output.
    pub fn new() -> Self {
        Self { stdout: io::stdout().lock(), closed: false }
    }

    /// Whether nobody reads any more.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Whether a person looks at it.
    pub fn is_terminal(&self) -> bool {
        self.stdout.is_terminal()
    }

    /// Writes `value` as JSON over several lines.
    pub fn json(&mut self, value: &impl Serialize) -> anyhow::Result<()> {
        serde_json::to_writer_pretty(&mut *self, value)?;
        Ok(writeln!(self)?)
    }

    /// Writes `value` as JSON in one line, for streams.
    pub fn json_line(&mut self, value: &impl Serialize) -> anyhow::Result<()> {
        serde_json::to_writer(&mut *self, value)?;
        writeln!(self)?;
        Ok(self.flush()?)
    }

    fn note<T>(&mut self, result: io::Result<T>, otherwise: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(otherwise)
            }
            other => other,
        }
    }
}

impl Default for Output {
    fn default() -> Self {
        Self::new()
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.closed {
            return Ok(bytes.len());
        }
        let result = self.stdout.write(bytes);
        self.note(result, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.closed {
            return Ok(());
        }
        let result = self.stdout.flush();
        self.note(result, ())
    }
}

/// Tells of `error` on standard error, with its causes as far as they say anything new.
pub fn report_error(error: &anyhow::Error) {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    to_stderr(&format!("error: {text}"));
}

/// Tells on standard error of something odd that does not stop the command.
pub fn warn(text: &str) {
    to_stderr(&format!("warning: {text}"));
}

/// Tells on standard error what goes on, for whoever waits.
pub fn say(text: &str) {
    to_stderr(text);
}

fn to_stderr(line: &str) {
    // Where standard error is gone there is nobody left to tell.
    drop(writeln!(io::stderr(), "{line}"));
}
