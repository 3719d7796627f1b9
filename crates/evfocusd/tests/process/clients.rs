//! Clients that come in crowds, talk nonsense, or are stopped.

use std::io::Write;
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

use super::daemon::{Daemon, alone, block_on, kill, short};

#[test]
fn five_hundred_clients_take_no_place_that_is_not_theirs() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let crowd: Vec<UnixStream> =
        (0..500).map(|_| UnixStream::connect(daemon.socket())).collect::<Result<_, _>>()?;
    block_on(async {
        let refused = daemon.client().await?.status().await.err().context("one too many")?;
        assert!(refused.to_string().contains("64 clients"), "{refused}");
        drop(crowd);
        // Those that hung up give their places back as soon as the daemon looks.
        for _ in 0..100 {
            if daemon.status().await.is_ok() {
                break;
            }
        }
        daemon.focus(&short()).await?;
        Ok(())
    })
}

#[test]
fn garbage_and_floods_during_a_run_change_nothing_of_it() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let socket = daemon.socket();
    let shouting = std::thread::spawn(move || {
        for round in 0..60_u32 {
            let Ok(mut stream) = UnixStream::connect(&socket) else { continue };
            let noise = match round % 4 {
                0 => vec![0xff; 200_000],
                1 => b"{\"method\":\"org.evfocus.Controller.GetStatus\"}\0".repeat(500),
                2 => b"{\"method\":\"org.evfocus.Controller.MoveTo\",\"parameters\":{\"position\":1e400}}\0"
                    .to_vec(),
                _ => vec![b'['; 60_000],
            };
            // It hangs up when it has had enough.
            stream.write_all(&noise).unwrap_or_default();
        }
    });
    let report = block_on(daemon.focus(&short()))?;
    assert_eq!(report.events.lost, 0, "the control path has lost nothing to it");
    assert!(shouting.join().is_ok());
    Ok(())
}

#[test]
fn a_client_that_is_stopped_delays_nobody_and_is_answered_when_it_goes_on() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    block_on(daemon.focus(&short()))?;
    let mut stream = UnixStream::connect(daemon.socket())?;
    let mut reader =
        Command::new("cat").stdin(OwnedFd::from(stream.try_clone()?)).stdout(Stdio::null()).spawn()?;
    kill("-STOP", reader.id())?;
    // More than fits between the two.
    stream.write_all(&b"{\"method\":\"org.evfocus.Controller.GetReport\"}\0".repeat(100))?;
    // No more questions: with the last answer the connection ends.
    stream.shutdown(Shutdown::Write)?;
    block_on(async {
        daemon.focus(&short()).await?;
        assert_eq!(daemon.status().await?.fault, None);
        Ok(())
    })?;
    kill("-CONT", reader.id())?;
    assert!(reader.wait()?.success());
    block_on(daemon.status())?;
    Ok(())
}

#[test]
fn many_moves_at_once_cost_neither_the_lens_nor_the_stop() -> Result<()> {
    let daemon = Daemon::start()?;
    block_on(async {
        let mut clients = Vec::new();
        for _ in 0..50 {
            clients.push(daemon.client().await?);
        }
        let mut moves = tokio::task::JoinSet::new();
        for (index, mut client) in clients.into_iter().enumerate() {
            moves.spawn(async move { client.move_to(1000.0 + index as f64 * 10.0).await });
        }
        while let Some(moved) = moves.join_next().await {
            moved??;
        }
        let mut client = daemon.client().await?;
        client.abort().await?;
        daemon.focus(&short()).await?;
        Ok(())
    })
}
