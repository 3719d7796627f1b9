//! The state directory when the disk is full, cannot be written, or is somebody else's.

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;

use anyhow::{Context, Result};

use super::daemon::{Daemon, alone, block_on, short, short_both_ways};

#[test]
fn a_full_disk_costs_the_learnt_delay_no_more_than_a_warning() -> Result<()> {
    let folder = tempfile::tempdir()?;
    fs::create_dir_all(folder.path().join("state"))?;
    symlink("/dev/full", folder.path().join("state/rig-delay.json.new"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        daemon.focus(&short_both_ways()).await?;
        let mut client = daemon.client().await?;
        let fault = client.status().await?.fault.context("a fault")?;
        assert!(fault.contains("rig-delay.json") && fault.contains("make room"), "{fault}");
        // It teaches nothing; what the one before has taught finds room now.
        let second = daemon.focus(&short()).await?;
        assert_eq!(second.rig_delay.map(|delay| delay.measurements), Some(1), "from memory");
        assert_eq!(client.status().await?.fault, None);
        Ok(())
    })?;
    assert!(daemon.path("state/rig-delay.json").exists());
    Ok(())
}

#[test]
fn a_full_disk_costs_neither_the_run_nor_the_daemon() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let reports = folder.path().join("state/reports");
    fs::create_dir_all(&reports)?;
    // Every write to this device fails for want of room.
    symlink("/dev/full", reports.join("run-00000001.json.new"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let report = daemon.focus(&short()).await?;
        let mut client = daemon.client().await?;
        let fault = client.status().await?.fault.context("a fault")?;
        assert!(fault.contains("run-00000001.json") && fault.contains("make room"), "{fault}");
        assert_eq!(client.report(Some(1)).await?, report, "from memory");
        let second = daemon.focus(&short()).await?;
        assert_eq!((second.run_id, client.status().await?.fault), (2, None), "the next one finds room");
        Ok(())
    })?;
    assert!(!daemon.reports().join("run-00000001.json").exists(), "half a report");
    Ok(())
}

#[test]
fn a_disk_that_fills_up_in_the_middle_of_a_file_leaves_no_half_of_it() -> Result<()> {
    let _alone = alone();
    // Told by an error, not by a signal, as by a disk.
    let daemon = Daemon::start_after(tempfile::tempdir()?, "trap '' XFSZ;")?;
    let room = |bytes: &str| -> Result<()> {
        let process = daemon.id().to_string();
        let set = Command::new("prlimit").args(["--pid", &process, &format!("--fsize={bytes}:")]).status()?;
        anyhow::ensure!(set.success(), "the limit was not set");
        Ok(())
    };
    block_on(async {
        let mut client = daemon.client().await?;
        let first = daemon.focus(&short()).await?;
        room("1000")?;
        let second = daemon.focus(&short()).await?;
        let fault = client.status().await?.fault.context("a fault")?;
        assert!(fault.contains("run-00000002.json") && fault.contains("make room"), "{fault}");
        assert_eq!(client.report(None).await?, second, "from memory");
        assert_eq!(client.report(Some(1)).await?, first);
        room("unlimited")?;
        daemon.focus(&short()).await?;
        assert_eq!(client.status().await?.fault, None);
        Ok(())
    })?;
    let mut kept: Vec<_> =
        fs::read_dir(daemon.reports())?.map(|entry| Ok(entry?.file_name())).collect::<Result<_>>()?;
    kept.sort();
    assert_eq!(kept, ["run-00000001.json", "run-00000003.json"]);
    Ok(())
}

#[test]
fn a_state_directory_that_cannot_be_made_costs_only_the_files() -> Result<()> {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("state"), "a file")?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let fault = daemon.status().await?.fault.context("a fault")?;
        assert!(fault.contains("state") && fault.contains("--state-dir"), "{fault}");
        let report = daemon.focus(&short()).await?;
        assert_eq!(daemon.client().await?.report(None).await?, report, "from memory");
        Ok(())
    })
}

#[test]
fn a_state_directory_that_may_not_be_written_is_named_with_the_remedy() -> Result<()> {
    // Not even root makes directories here.
    let folder = tempfile::tempdir()?;
    symlink("/sys/kernel", folder.path().join("state"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let fault = daemon.status().await?.fault.context("a fault")?;
        assert!(fault.contains("state") && fault.contains("let the daemon's user write there"), "{fault}");
        Ok(())
    })
}

#[test]
fn two_daemons_do_not_share_a_state_directory() -> Result<()> {
    let first = Daemon::start()?;
    let folder = tempfile::tempdir()?;
    symlink(first.path("state"), folder.path().join("state"))?;
    let second = Daemon::start_in(folder)?;
    block_on(async {
        let fault = second.status().await?.fault.context("a fault")?;
        assert!(fault.contains("another evfocusd") && fault.contains("--state-dir"), "{fault}");
        assert_eq!(first.status().await?.fault, None);
        Ok(())
    })
}

/// Whatever a kill leaves behind of a file that was being written.
#[test]
fn what_a_kill_leaves_of_a_report_harms_no_other() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let first = block_on(daemon.focus(&short()))?;
    let (done, begun) =
        (daemon.reports().join("run-00000001.json"), daemon.reports().join("run-00000002.json.new"));
    let whole = fs::read(done)?;
    let mut daemon = daemon;
    for length in [0, 1, whole.len() / 2, whole.len() - 1, whole.len()] {
        fs::write(&begun, whole.get(..length).unwrap_or_default())?;
        daemon = daemon.kill_and_restart()?;
        let kept = block_on(async { Ok(daemon.client().await?.report(None).await?) })?;
        assert_eq!(kept, first, "with {length} bytes of the next report");
    }
    let second = block_on(daemon.focus(&short()))?;
    assert_eq!(second.run_id, 2);
    assert!(!begun.exists(), "the rest of the attempt is replaced");
    Ok(())
}
