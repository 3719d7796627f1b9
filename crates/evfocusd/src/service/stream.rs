//! The two streams: the status, and the progress of a run.

use std::sync::Arc;
use std::time::Duration;

use evfocus_ipc::server::{CallError, Stream};
use evfocus_ipc::{Error, Progress, Reply, Status};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, timeout_at};

/// The status is sent at least this often. Only writing tells that a client has gone away, and only reading tells the
/// client that the daemon is alive.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// The least time from one status to the next if all that has changed are [quantities](differ_in_quantities), which
/// change all the time: what an eye can follow.
const PACE: Duration = Duration::from_millis(100);

/// Sends the status now, whenever it changes, and at least once per heartbeat. Quantities that change are paced, and what is
/// measured anew all the time is no change at all. A slow client gets the latest, not all.
pub(super) async fn status(
    mut status: watch::Receiver<Arc<Status>>,
    stream: &mut Stream<'_>,
) -> Result<Reply, CallError> {
    let mut sent = Arc::clone(&status.borrow_and_update());
    loop {
        stream.send(&Reply::Status { status: Arc::clone(&sent) }).await?;
        sent = next(&mut status, &sent).await?;
    }
}

/// The status to be sent after `sent`, when it is time.
async fn next(status: &mut watch::Receiver<Arc<Status>>, sent: &Status) -> Result<Arc<Status>, Error> {
    let since = Instant::now();
    loop {
        let latest = Arc::clone(&status.borrow_and_update());
        let due = if differ_in_words(&latest, sent) {
            since
        } else if differ_in_quantities(&latest, sent) {
            since + PACE
        } else {
            since + HEARTBEAT
        };
        if due <= Instant::now() {
            return Ok(latest);
        }
        if let Ok(Err(_gone)) = timeout_at(due, status.changed()).await {
            return Err(Error::ShuttingDown {});
        }
    }
}

/// Whether anything but numbers is new: a field that this does not know of counts as well.
fn differ_in_words(one: &Status, other: &Status) -> bool {
    let words = |status: &Status| Status {
        lens_position: None,
        events_lost: 0,
        event_rate: 0.0,
        uptime_s: 0.0,
        sharpness: None,
        ..status.clone()
    };
    words(one) != words(other)
}

fn differ_in_quantities(one: &Status, other: &Status) -> bool {
    let quantities = |status: &Status| (status.lens_position, status.events_lost, status.sharpness);
    quantities(one) != quantities(other)
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
