//! The two streams: the status, and the progress of a run.

use std::sync::Arc;
use std::time::Duration;

use evfocus_ipc::server::{CallError, Stream};
use evfocus_ipc::{Error, Progress, Reply, Status};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};
use tokio::time::timeout;

/// The status is sent at least this often. Only writing tells that a client has gone away, and only reading tells the
/// client that the daemon is alive.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// Sends the status now, whenever it changes, and at least once per heartbeat. A slow client gets the latest, not all.
pub(super) async fn status(
    mut status: watch::Receiver<Arc<Status>>,
    stream: &mut Stream<'_>,
) -> Result<Reply, CallError> {
    loop {
        let latest = Arc::clone(&status.borrow_and_update());
        stream.send(&Reply::Status { status: latest }).await?;
        if let Ok(Err(_gone)) = timeout(HEARTBEAT, status.changed()).await {
            return Err(Error::ShuttingDown {}.into());
        }
    }
}

/// Follows run `run_id` until it is done; sends what comes before the end into `stream`, if there is one.
pub(super) async fn progress(
    mut progress: broadcast::Receiver<Arc<Progress>>,
    run_id: u64,
    mut stream: Option<&mut Stream<'_>>,
) -> Result<Reply, CallError> {
    let mut missed = 0;
    loop {
        match progress.recv().await {
            Ok(news) if news.run_id == run_id => {
                let news = with_missed(news, missed);
                missed = 0;
                if news.done {
                    return Ok(Reply::Progress { progress: news });
                }
                if let Some(stream) = &mut stream {
                    stream.send(&Reply::Progress { progress: news }).await?;
                }
            }
            // A later run: the end of ours was among what was missed, or was never sent.
            Ok(news) if news.run_id > run_id => return Err(Error::RunLost { run_id }.into()),
            Ok(_earlier) => {}
            Err(RecvError::Lagged(count)) => missed += count,
            Err(RecvError::Closed) => return Err(Error::ShuttingDown {}.into()),
        }
    }
}

fn with_missed(news: Arc<Progress>, missed: u64) -> Arc<Progress> {
    if missed == 0 { news } else { Arc::new(Progress { missed, ..Progress::clone(&news) }) }
}
