//! Crowds of clients of the worst manners, drawn from a seed, in virtual time: whatever they do, whoever asks for the status is
//! told within 100 ms.

#[path = "service/fake.rs"]
#[expect(dead_code, reason = "the fake of the service's tests can do more than is needed here")]
mod fake;

use std::io;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use evfocus_ipc::server::Limits;
use fake::Rig;
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::task::JoinSet;
use tokio::time::{Instant, interval, sleep};

const CROWDS: u64 = 60;
/// For how long a crowd makes trouble: longer than the daemon's patience with whoever does not read.
const TROUBLE: Duration = Duration::from_secs(7);
const ANSWERED_WITHIN: Duration = Duration::from_millis(100);

/// What a client may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Manners {
    /// Bytes that are no call.
    Garbage,
    /// A call that never ends, slowly or fast.
    Endless,
    /// Half a call, and then nothing.
    Half,
    /// Calls, and never reads an answer.
    Deaf,
    /// Calls as fast as it is answered.
    Hasty,
    /// Follows everything, and never reads it.
    Follower,
    /// Orders of all kinds.
    Bossy,
    /// Comes and goes.
    Fickle,
}

const ALL: [Manners; 8] = [
    Manners::Garbage,
    Manners::Endless,
    Manners::Half,
    Manners::Deaf,
    Manners::Hasty,
    Manners::Follower,
    Manners::Bossy,
    Manners::Fickle,
];

fn call(method: &str) -> Vec<u8> {
    format!("{{\"method\":\"org.evfocus.Controller.{method}\"}}\0").into_bytes()
}

/// Behaves so until the server has had enough, or for ever.
async fn behave(manners: Manners, path: &Path, draw: &mut Xoshiro256PlusPlus) -> io::Result<()> {
    let mut stream = UnixStream::connect(path).await?;
    match manners {
        Manners::Garbage => {
            let noise: Vec<u8> = (0..draw.random_range(1..70_000)).map(|_| draw.random()).collect();
            stream.write_all(&noise).await?;
        }
        Manners::Endless => {
            let (piece, pause) = (vec![b'['; draw.random_range(1..5000)], draw.random_range(0..50));
            loop {
                stream.write_all(&piece).await?;
                sleep(Duration::from_millis(pause)).await;
            }
        }
        Manners::Half => stream.write_all(b"{\"method\":\"org.evfocus.").await?,
        Manners::Deaf => stream.write_all(&call("GetStatus").repeat(20_000)).await?,
        Manners::Hasty => {
            let mut answers = vec![0; 65_536];
            loop {
                stream.write_all(&call("GetStatus").repeat(draw.random_range(1..200))).await?;
                if stream.read(&mut answers).await? == 0 {
                    break;
                }
            }
        }
        Manners::Follower => {
            let more = b"{\"method\":\"org.evfocus.Controller.Monitor\",\"more\":true}\0";
            stream.write_all(more).await?;
        }
        Manners::Bossy => {
            let orders =
                ["Focus", "Abort", "Pause", "Resume", "Reload", "ListDevices", "GetReport", "Calibrate"];
            let mut answers = vec![0; 65_536];
            loop {
                stream.write_all(&call(orders.choose(draw).copied().unwrap_or("Abort"))).await?;
                if draw.random_bool(0.5) && stream.read(&mut answers).await? == 0 {
                    break;
                }
            }
        }
        Manners::Fickle => return Ok(()),
    }
    // It stays until it is hung up on.
    while stream.read(&mut [0; 16]).await? > 0 {
        sleep(Duration::from_secs(3)).await;
    }
    Ok(())
}

/// The longest that the status took to come while the crowd of `seed` made trouble.
async fn longest(seed: u64) -> Result<Duration> {
    let rig = Rig::start(Limits::default());
    let mut polite = rig.client().await;
    polite.status().await?;
    let mut draw = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut crowd = JoinSet::new();
    for _ in 0..draw.random_range(1..80) {
        let manners = ALL.choose(&mut draw).copied().context("there are manners")?;
        let (path, mut draw) = (rig.path.clone(), draw.fork());
        crowd.spawn(async move {
            loop {
                sleep(Duration::from_millis(draw.random_range(0..2000))).await;
                // Hung up on, or turned away: it comes again.
                behave(manners, &path, &mut draw).await.unwrap_or_default();
            }
        });
    }
    // Without it, time would leap to whatever comes next while bytes are under way.
    crowd.spawn(async {
        let mut ticks = interval(Duration::from_millis(1));
        loop {
            ticks.tick().await;
        }
    });
    if draw.random_bool(0.3) {
        rig.fake.hang();
    }
    let (end, mut longest) = (Instant::now() + TROUBLE, Duration::ZERO);
    while Instant::now() < end {
        rig.fake.change(|status| status.event_rate += 1.0);
        let asked = Instant::now();
        polite.status().await?;
        longest = longest.max(asked.elapsed());
        sleep(Duration::from_millis(draw.random_range(1..60))).await;
    }
    Ok(longest)
}

#[tokio::test(start_paused = true)]
async fn whoever_asks_for_the_status_is_told_whatever_others_do() -> Result<()> {
    let mut worst = Duration::ZERO;
    for seed in 1..=CROWDS {
        let longest = longest(seed).await.with_context(|| format!("seed {seed}"))?;
        ensure!(longest <= ANSWERED_WITHIN, "seed {seed}: {longest:?}");
        worst = worst.max(longest);
    }
    println!("{CROWDS} crowds; the status took {worst:?} at the most");
    Ok(())
}
