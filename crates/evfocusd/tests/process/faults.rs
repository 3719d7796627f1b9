//! It is killed, and file descriptors run out.

use std::os::unix::net::UnixStream;

use anyhow::Result;
use evfocus_ipc::{FocusRequest, Phase, State};

use super::daemon::{Daemon, alone, block_on, short};

#[test]
fn killed_in_mid_sweep_it_starts_again_with_every_report_and_a_lens_at_rest() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let first = block_on(daemon.focus(&short()))?;
    block_on(daemon.focus_until(&FocusRequest::default(), Phase::Sweeping))?;
    let daemon = daemon.kill_and_restart()?;
    block_on(async {
        let status = daemon.status().await?;
        assert_eq!((status.state, status.lens_moving, status.fault.as_deref()), (State::Idle, false, None));
        assert_eq!(status.last_run.as_ref().map(|run| run.id), Some(first.run_id));
        assert_eq!(daemon.client().await?.report(None).await?, first);
        // The number of the run that was killed is free: it has left nothing.
        assert_eq!(daemon.focus(&short()).await?.run_id, first.run_id + 1);
        Ok(())
    })
}

#[test]
fn without_file_descriptors_it_serves_those_it_has_and_recovers() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start_after(tempfile::tempdir()?, "ulimit -n 24;")?;
    block_on(async {
        let mut early = daemon.client().await?;
        early.status().await?;
        let crowd: Vec<UnixStream> =
            (0..40).map(|_| UnixStream::connect(daemon.socket())).collect::<Result<_, _>>()?;
        for _ in 0..20 {
            early.status().await?;
        }
        drop(crowd);
        daemon.focus(&short()).await?;
        Ok(())
    })
}
