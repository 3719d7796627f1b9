//! What the daemon costs and how soon it answers, on this machine: `cargo run --release -p evfocusd --example numbers -- EVFOCUSD`, where
//! EVFOCUSD is the program, `target/release/evfocusd` unless given.

#![expect(clippy::print_stdout, reason = "this is what the program is for")]
#![expect(clippy::disallowed_methods, reason = "it measures time")]

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use evfocus_ipc::client::Client;
use evfocus_ipc::{FocusRequest, State};

/// How long the daemon is watched at rest.
const REST: Duration = Duration::from_secs(10);
/// Calls that are timed; fewer than a second's worth of what a client may make.
const CALLS: usize = 900;
/// Clock ticks of the kernel's accounts, a second.
const TICKS: f64 = 100.0;

struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        self.0.kill().unwrap_or_default();
        self.0.wait().map(drop).unwrap_or_default();
    }
}

fn main() -> Result<()> {
    let program = std::env::args().nth(1).unwrap_or_else(|| "target/release/evfocusd".to_owned());
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("socket");
    let began = Instant::now();
    let mut daemon = Daemon(
        Command::new(&program)
            .args(["--socket".as_ref(), socket.as_os_str()])
            .args(["--state-dir".as_ref(), folder.path().join("state").as_os_str()])
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| program.clone())?,
    );
    let mut log = BufReader::new(daemon.0.stderr.take().context("standard error")?);
    let mut seen = String::new();
    while !seen.contains(" ready ") {
        if log.read_line(&mut seen)? == 0 {
            bail!("not ready: {seen}");
        }
    }
    println!("start to ready      {:.0} ms", began.elapsed().as_secs_f64() * 1e3);
    std::thread::spawn(move || std::io::copy(&mut log, &mut std::io::sink()));

    let id = daemon.0.id();
    let before = ticks(id)?;
    std::thread::sleep(REST);
    println!("memory at rest      {} KiB resident", resident_kib(id)?);
    for ((thread, after), (_, before)) in ticks(id)?.into_iter().zip(before) {
        let share = 100.0 * (after - before) / TICKS / REST.as_secs_f64();
        println!("at rest             {share:5.2} % of a core  {thread}");
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(calls(&socket, "idle"))?;
    let run = std::thread::spawn({
        let socket = socket.clone();
        move || -> Result<State> {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
            runtime.block_on(async {
                let request = FocusRequest { speed: Some("accurate".to_owned()), ..FocusRequest::default() };
                Ok(Client::connect(&socket).await?.focus_and_wait(&request).await?.result.state)
            })
        }
    });
    runtime.block_on(async {
        while Client::connect(&socket).await?.status().await?.state != State::Scanning {}
        calls(&socket, "in a sweep").await
    })?;
    let state = run.join().map_err(|_| anyhow::anyhow!("the run came to grief"))??;
    println!("the run             {state}; memory {} KiB resident", resident_kib(id)?);
    Ok(())
}

/// Times status calls.
async fn calls(socket: &Path, when: &str) -> Result<()> {
    let mut client = Client::connect(socket).await?;
    let mut times = Vec::with_capacity(CALLS);
    for _ in 0..CALLS {
        let began = Instant::now();
        client.status().await?;
        times.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times.get((share * (CALLS - 1) as f64) as usize).copied().unwrap_or_default();
    println!("status, {when:<11} p50 {:.3} ms, p99 {:.3} ms, max {:.3} ms", at(0.5), at(0.99), at(1.0));
    Ok(())
}

/// Processor time of each thread so far; the camera's thread has the simulation in it.
fn ticks(id: u32) -> Result<Vec<(String, f64)>> {
    let mut threads = Vec::new();
    for task in fs::read_dir(format!("/proc/{id}/task"))? {
        let path = task?.path();
        let name = fs::read_to_string(path.join("comm"))?.trim().to_owned();
        let stat = fs::read_to_string(path.join("stat"))?;
        let fields: Vec<&str> = stat.rsplit(") ").next().unwrap_or_default().split(' ').collect();
        let field = |index: usize| fields.get(index).and_then(|text| text.parse::<f64>().ok());
        threads.push((name, field(11).context("utime")? + field(12).context("stime")?));
    }
    Ok(threads)
}

fn resident_kib(id: u32) -> Result<u64> {
    let status = fs::read_to_string(format!("/proc/{id}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("VmRSS")?;
    Ok(line.split_whitespace().next().context("a number")?.parse()?)
}
