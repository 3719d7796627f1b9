//! How often a client may call.

use std::time::Duration;

use tokio::time::{Instant, sleep_until};

/// As many calls may be made at once as fit into this.
const BURST: Duration = Duration::from_secs(1);

/// Admits calls at a steady rate, and bursts of a second's worth.
#[derive(Debug)]
pub(super) struct Rate {
    interval: Duration,
    /// When the calls so far would be over if they were evenly spread.
    spread_until: Instant,
}

impl Rate {
    /// At most `calls_per_s` in the long run.
    pub(super) fn new(calls_per_s: u32) -> Self {
        Self { interval: Duration::from_secs(1) / calls_per_s.max(1), spread_until: Instant::now() }
    }

    /// Waits until the next call may be served.
    pub(super) async fn admit(&mut self) {
        let now = Instant::now();
        self.spread_until = self.spread_until.max(now) + self.interval;
        if let Some(admitted) = self.spread_until.checked_sub(BURST)
            && admitted > now
        {
            sleep_until(admitted).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_burst_is_admitted_at_once_and_a_flood_at_the_rate() {
        let mut rate = Rate::new(100);
        let began = Instant::now();
        for _ in 0..100 {
            rate.admit().await;
        }
        assert_eq!(began.elapsed(), Duration::ZERO);
        for _ in 0..100 {
            rate.admit().await;
        }
        assert!((990..=1010).contains(&began.elapsed().as_millis()), "{:?}", began.elapsed());
        tokio::time::advance(Duration::from_secs(10)).await;
        let rested = Instant::now();
        for _ in 0..100 {
            rate.admit().await;
        }
        assert_eq!(
            rested.elapsed(),
            Duration::ZERO,
            "a client that rests may burst again, and no more than that"
        );
    }
}
