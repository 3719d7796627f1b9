//! The daemon's socket with a fake control thread behind it: what each method answers, and when.

#![expect(clippy::panic, reason = "a test's helper")]

#[path = "service/fake.rs"]
mod fake;

use std::time::Duration;

use evfocus_ipc::client::ClientError;
use evfocus_ipc::{Error, FocusRequest, Mode, PauseState, PauseWhen, State, Status};
use fake::{BACKLOG, RANGE, Rig, limits};
use tokio::time::Instant;

#[tokio::test]
async fn the_status_is_what_the_control_thread_last_published() {
    let rig = Rig::start(limits());
    let mut client = rig.client().await;
    assert_eq!(client.status().await.unwrap().lens_range, Some(RANGE));
    rig.fake.change(|status| status.event_rate = 1234.5);
    assert_eq!(client.status().await.unwrap().event_rate.to_bits(), 1234.5_f64.to_bits());
}

#[tokio::test]
async fn a_run_is_followed_to_its_report() {
    let rig = Rig::start(limits());
    let mut run = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    let mut observer = rig.client().await.monitor().await.unwrap();
    while observer.next().await.unwrap().unwrap().state != State::Scanning {}
    for point in 0..3 {
        rig.fake.advance(point);
        let news = run.next().await.unwrap().unwrap();
        assert_eq!((news.run_id, news.done, news.missed), (1, false, 0));
        assert_eq!(news.curve_point.unwrap().t_us, point as i64 * 55_000);
    }
    rig.fake.succeed();
    let last = run.next().await.unwrap().unwrap();
    assert!(last.done);
    let report = last.report.unwrap();
    assert_eq!(report.result.state, State::Focused);
    assert!(run.next().await.unwrap().is_none());

    let mut client = rig.client().await;
    assert_eq!(client.report(None).await.unwrap(), report);
    assert_eq!(client.report(Some(1)).await.unwrap(), report);
    let last_run = client.status().await.unwrap().last_run.unwrap();
    assert_eq!((last_run.id, last_run.state), (1, State::Focused));
}

#[tokio::test]
async fn focusing_twice_is_one_run_with_two_followers() {
    let rig = Rig::start(limits());
    let (first, second) = (rig.client().await, rig.client().await);
    let first = tokio::spawn(async move { first.focus_and_wait(&FocusRequest::default()).await });
    let second = tokio::spawn(async move { second.focus_and_wait(&FocusRequest::default()).await });
    until(|| rig.fake.followers() == 2).await;
    // Both calls are admitted before the run ends: the answers go through the same queue as this one.
    rig.client().await.move_to(300.0).await.unwrap_err();
    rig.fake.succeed();
    let (first, second) = (first.await.unwrap().unwrap(), second.await.unwrap().unwrap());
    assert_eq!(first, second);
    assert_eq!(first.run_id, 1);
}

#[tokio::test]
async fn another_run_and_a_motion_are_refused_during_a_run_and_an_abort_is_not() {
    let rig = Rig::start(limits());
    let mut run = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    let mut client = rig.client().await;
    while client.status().await.unwrap().state != State::Scanning {}

    let other = FocusRequest { method: Some("er-fixed".to_owned()), ..FocusRequest::default() };
    let refused = rig.client().await.focus_and_wait(&other).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::Busy { run_id: 1 })), "{refused}");
    let refused = client.move_to(1000.0).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::Busy { run_id: 1 })), "{refused}");

    assert_eq!(client.abort().await.unwrap(), Some(1));
    let report = run.next().await.unwrap().unwrap().report.unwrap();
    assert_eq!((report.result.state, report.result.reason.as_deref()), (State::Idle, Some("aborted")));
    assert_eq!(client.abort().await.unwrap(), None, "an abort without a run is fine");
}

#[tokio::test]
async fn refusals_are_typed() {
    let rig = Rig::start(limits());
    let mut client = rig.client().await;
    let refused = client.move_to(9999.0).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::OutOfRange { .. })), "{refused}");
    let refused = client.report(Some(77)).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::NoSuchReport { id: Some(77) })), "{refused}");
    client.set_mode(Mode::Manual).await.unwrap();
    assert_eq!(client.status().await.unwrap().mode, Mode::Manual);
    let refused = rig.client().await.focus_and_wait(&FocusRequest::default()).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::WrongMode { .. })), "{refused}");
    client.set_mode(Mode::Continuous).await.unwrap();
    for (when, state) in
        [(PauseWhen::Immediate, PauseState::Paused), (PauseWhen::Deferred, PauseState::Paused)]
    {
        client.pause(when).await.unwrap();
        assert_eq!(client.status().await.unwrap().pause, state);
        client.resume().await.unwrap();
        assert_eq!(client.status().await.unwrap().pause, PauseState::Running);
    }
    client.move_to(1000.0).await.unwrap();
    assert_eq!(client.devices().await.unwrap().len(), 1);
}

#[tokio::test]
async fn a_follower_that_falls_behind_is_told_how_much_it_missed_and_gets_the_end() {
    let rig = Rig::start(limits());
    let mut run = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    let mut client = rig.client().await;
    while client.status().await.unwrap().state != State::Scanning {}
    // On this one thread the server runs only while the test waits.
    for point in 0..BACKLOG as u64 + 10 {
        rig.fake.advance(point);
    }
    rig.fake.succeed();
    let first = run.next().await.unwrap().unwrap();
    assert_eq!(first.missed, 11);
    let mut count = 1;
    while let Some(news) = run.next().await.unwrap() {
        count += 1;
        assert_eq!(news.done, count == BACKLOG);
    }
    assert_eq!(count, BACKLOG);
}

#[tokio::test(start_paused = true)]
async fn the_monitor_sends_changes_at_once_and_a_heartbeat_without_them() {
    let rig = Rig::start(limits());
    let mut monitor = rig.client().await.monitor().await.unwrap();
    assert_eq!(monitor.next().await.unwrap().unwrap().events_lost, 0);
    rig.fake.change(|status| status.events_lost = 5);
    assert_eq!(monitor.next().await.unwrap().unwrap().events_lost, 5);
    // Nothing changes any more.
    assert_eq!(monitor.next().await.unwrap().unwrap().events_lost, 5);
}

#[tokio::test(start_paused = true)]
async fn the_monitor_paces_numbers_and_nothing_else() {
    let rig = Rig::start(limits());
    let tick = Duration::from_millis(20);
    let count = async |change: &dyn Fn(&mut Status, u32)| {
        let mut monitor = rig.client().await.monitor().await.unwrap();
        monitor.next().await.unwrap();
        let mut heard = 0;
        let end = Instant::now() + Duration::from_secs(5);
        let mut ticks = tokio::time::interval(tick);
        let mut number = 0;
        while Instant::now() < end {
            tokio::select! {
                status = monitor.next() => { status.unwrap().unwrap(); heard += 1; }
                _now = ticks.tick() => { number += 1; rig.fake.change(|status| change(status, number)); }
            }
        }
        heard
    };
    let measured = count(&|status, number| {
        status.event_rate = f64::from(number);
        status.uptime_s += 0.02;
    });
    let measured = measured.await;
    assert!((4..=6).contains(&measured), "{measured} in 5 s though only the rate changed");
    let moving = count(&|status, number| status.lens_position = Some(f64::from(number))).await;
    assert!((40..=51).contains(&moving), "{moving} in 5 s while the lens moved");
    let told = count(&|status, number| status.fault = Some(format!("fault {number}"))).await;
    assert!(told >= 240, "{told} of 250 changes of the fault were told");
}

#[tokio::test(start_paused = true)]
async fn news_are_told_at_once_even_just_after_a_number() {
    let rig = Rig::start(limits());
    let mut monitor = rig.client().await.monitor().await.unwrap();
    monitor.next().await.unwrap();
    rig.fake.change(|status| status.lens_position = Some(300.0));
    assert_eq!(monitor.next().await.unwrap().unwrap().lens_position, Some(300.0));
    let told = Instant::now();
    rig.fake.change(|status| status.lens_position = Some(301.0));
    rig.fake.change(|status| status.lens_moving = true);
    let status = monitor.next().await.unwrap().unwrap();
    assert_eq!((status.lens_position, status.lens_moving), (Some(301.0), true));
    assert!(told.elapsed() < Duration::from_millis(50), "{:?}", told.elapsed());
}

#[tokio::test]
async fn a_monitor_that_reads_slowly_gets_the_latest_status_and_not_all() {
    let rig = Rig::start(limits());
    let mut monitor = rig.client().await.monitor().await.unwrap();
    monitor.next().await.unwrap();
    for lost in 1..=1000 {
        rig.fake.change(|status| status.events_lost = lost);
    }
    assert_eq!(monitor.next().await.unwrap().unwrap().events_lost, 1000);
}

#[tokio::test(start_paused = true)]
async fn a_control_thread_that_hangs_is_reported_and_the_status_still_served() {
    let rig = Rig::start(limits());
    rig.fake.hang();
    // More than the queue of commands holds.
    let mut calls = Vec::new();
    for _ in 0..7 {
        let mut client = rig.client().await;
        calls.push(tokio::spawn(async move { client.abort().await }));
    }
    rig.client().await.status().await.unwrap();
    for call in calls {
        let refused = call.await.unwrap().unwrap_err();
        assert!(matches!(refused, ClientError::Refused(Error::NotResponding { .. })), "{refused}");
    }
}

#[tokio::test]
async fn a_control_thread_that_is_gone_is_reported_to_callers_and_followers() {
    let mut rig = Rig::start(limits());
    let mut run = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    let mut client = rig.client().await;
    while client.status().await.unwrap().state != State::Scanning {}
    rig.control.abort();
    drop(rig.fake);
    let ended = run.next().await.unwrap_err();
    assert!(matches!(ended, ClientError::Refused(Error::ShuttingDown {})), "{ended}");
    let refused = client.abort().await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::ShuttingDown {})), "{refused}");
    rig.shutdown.take();
    rig.server.await.unwrap();
    assert!(!rig.path.exists(), "the socket is taken away");
}

#[tokio::test]
async fn a_run_that_ends_without_a_word_is_noticed_at_the_next_one() {
    let rig = Rig::start(limits());
    let mut lost = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    until(|| rig.fake.followers() == 1).await;
    let mut client = rig.client().await;
    while client.status().await.unwrap().state != State::Scanning {}
    rig.fake.lose();
    let mut next = rig.client().await.focus(&FocusRequest::default()).await.unwrap();
    while client.status().await.unwrap().run_id != Some(2) {}
    rig.fake.advance(0);
    assert_eq!(next.next().await.unwrap().unwrap().run_id, 2);
    let ended = lost.next().await.unwrap_err();
    assert!(matches!(ended, ClientError::Refused(Error::RunLost { run_id: 1 })), "{ended}");
}

/// Lets the other tasks run until `condition` holds.
async fn until(condition: impl Fn() -> bool) {
    let holds = async {
        while !condition() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(std::time::Duration::from_secs(30), holds)
        .await
        .unwrap_or_else(|_| panic!("waited in vain"));
}
