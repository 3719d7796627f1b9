//! The date is set while the daemon runs.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use evfocus_ipc::{FocusRequest, Phase, State};

use super::daemon::{Daemon, alone, block_on, short};

const YEAR_S: i64 = 365 * 86_400;

/// Stands in front of the C library: the date is ahead by the seconds in the file `DATE_AHEAD`. All other clocks go on as they are.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t id, struct timespec *time) {
    int result = syscall(SYS_clock_gettime, id, time);
    FILE *file = id == CLOCK_REALTIME ? fopen(getenv("DATE_AHEAD"), "r") : NULL;
    long ahead = 0;
    if (file && fscanf(file, "%ld", &ahead) == 1) time->tv_sec += ahead;
    if (file) fclose(file);
    return result;
}
"#;

/// Builds [`SHIM`]; the compiler is there, since Rust links with it.
fn build(library: &Path) -> Result<()> {
    let mut compiler = Command::new("cc")
        .args(["-shared", "-fPIC", "-x", "c", "-", "-o"])
        .arg(library)
        .stdin(Stdio::piped())
        .spawn()?;
    compiler.stdin.take().context("standard input")?.write_all(SHIM.as_bytes())?;
    ensure!(compiler.wait()?.success(), "the shim was not built");
    Ok(())
}

#[test]
fn a_date_that_is_set_forth_and_back_in_mid_sweep_changes_nothing_but_dates() -> Result<()> {
    let _alone = alone();
    let folder = tempfile::tempdir()?;
    let (library, ahead) = (folder.path().join("clock.so"), folder.path().join("ahead"));
    build(&library)?;
    let set_date = |seconds: i64| -> Result<()> {
        let new = ahead.with_extension("new");
        fs::write(&new, seconds.to_string())?;
        Ok(fs::rename(&new, &ahead)?)
    };
    set_date(0)?;
    let words = format!("export LD_PRELOAD='{}' DATE_AHEAD='{}';", library.display(), ahead.display());
    let daemon = Daemon::start_after(folder, &words)?;
    block_on(async {
        let before = daemon.focus(&short()).await?;
        let mut run = daemon.client().await?.focus(&FocusRequest::default()).await?;
        let mut during = None;
        while let Some(news) = run.next().await? {
            if news.phase == Phase::Sweeping {
                set_date(YEAR_S)?;
            } else if news.phase == Phase::Returning {
                set_date(-10 * YEAR_S)?;
            }
            during = news.report.or(during);
        }
        let during = during.context("a report")?;
        assert_eq!(during.result.state, State::Focused, "{}", during.result.message);
        assert!((1.0..60.0).contains(&during.elapsed_s), "{} s", during.elapsed_s);
        let moved = (during.started_unix_s - before.started_unix_s) / YEAR_S as f64;
        assert!((-10.1..-9.9).contains(&moved), "the date was not set: {moved} years");
        let uptime = daemon.status().await?.uptime_s;
        assert!((0.0..600.0).contains(&uptime), "{uptime} s");
        assert_eq!(daemon.client().await?.report(None).await?, during);
        Ok(())
    })
}
