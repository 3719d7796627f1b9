//! The ways out: HTTP over a Unix socket, for a scraper or `curl --unix-socket`, and a file for node_exporter's textfile collector.

use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use evfocus_ipc::server::Socket;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::Metrics;

/// Scrapers served at a time; more are hung up on.
const SCRAPERS: usize = 8;
/// How long a scraper may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// The longest request; a scraper's has a few hundred bytes.
const REQUEST_BYTES: u64 = 8 * 1024;
/// How often the file is written: scrapers look every 15 s or so.
const FILE_INTERVAL: Duration = Duration::from_secs(10);

/// Answers every request on `socket` with the figures, for ever.
#[expect(clippy::infinite_loop, reason = "it ends with its task")]
pub(crate) async fn answer(socket: Socket, metrics: Metrics) {
    let mut scrapers = JoinSet::new();
    loop {
        match socket.listener().accept().await {
            Ok((stream, _)) => {
                while scrapers.try_join_next().is_some() {}
                if scrapers.len() < SCRAPERS {
                    let text = metrics.text();
                    scrapers.spawn(async move {
                        // A scraper that gives up, or is given up, comes back.
                        if let Ok(Err(error)) = timeout(PATIENCE, reply(stream, text)).await {
                            tracing::debug!(%error, "a scraper got no metrics");
                        }
                    });
                }
            }
            Err(error) => {
                tracing::error!(%error, "cannot accept a scraper");
                tokio::time::sleep(PATIENCE).await;
            }
        }
    }
}

/// There is one page, so what is asked for does not matter; but a client that writes wants to be read before it is answered.
async fn reply(mut stream: UnixStream, text: String) -> io::Result<()> {
    let (reader, mut writer) = stream.split();
    let (mut reader, mut request) = (reader.take(REQUEST_BYTES), Vec::new());
    while !request.ends_with(b"\r\n\r\n") && reader.read_buf(&mut request).await? > 0 {}
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        text.len()
    );
    writer.write_all(head.as_bytes()).await?;
    writer.write_all(text.as_bytes()).await
}

/// Writes the figures to the file at `path` now and then, for ever.
#[expect(clippy::infinite_loop, reason = "it ends with its task")]
pub(crate) async fn keep_file(path: PathBuf, metrics: Metrics) {
    let mut failed = false;
    let mut times = tokio::time::interval(FILE_INTERVAL);
    loop {
        times.tick().await;
        let (to, text) = (path.clone(), metrics.text());
        let written = tokio::task::spawn_blocking(move || write(&to, &text)).await;
        let error = match written {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(panic) => Some(panic.to_string()),
        };
        if let Some(error) = &error
            && !failed
        {
            tracing::warn!(path = %path.display(), %error, "the metrics cannot be written; let the daemon write there");
        }
        failed = error.is_some();
    }
}

/// A reader sees all of it or what was there before; everybody may read.
fn write(path: &Path, text: &str) -> io::Result<()> {
    let temporary = path.with_extension("prom.new");
    std::fs::write(&temporary, text)?;
    std::fs::set_permissions(&temporary, std::fs::Permissions::from_mode(0o644))?;
    std::fs::rename(&temporary, path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vitals::Vitals;

    async fn ask(path: &Path, request: &[u8]) -> String {
        let mut stream = UnixStream::connect(path).await.unwrap();
        stream.write_all(request).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        answer
    }

    #[tokio::test]
    async fn a_scraper_is_answered_while_another_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics");
        let server = tokio::spawn(answer(Socket::bind(&path).unwrap(), Metrics::new(Vitals::default())));
        let silent = UnixStream::connect(&path).await.unwrap();
        let answer = ask(&path, b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n").await;
        assert!(
            answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.contains("\nevfocus_events_total 0\n"),
            "{answer}"
        );
        drop(silent);
        server.abort();
    }

    #[test]
    fn the_file_is_whole_and_for_everybody() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("evfocus.prom");
        write(&path, &Metrics::new(Vitals::default()).text()).unwrap();
        let mode = std::fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o644);
        assert!(std::fs::read_to_string(&path).unwrap().ends_with('\n'));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
