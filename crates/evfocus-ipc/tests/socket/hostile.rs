//! Clients that misbehave, on a real socket, and one that does not and must not notice. Nothing here sleeps: the tests
//! wait for the server to answer or to hang up, and each has a time limit as a guard.

#![expect(clippy::panic, reason = "a test's helper")]

use std::future::Future;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::plain::{hear, hear_one, limits, say, serve};
use evfocus_ipc::client::{Client, ClientError};
use evfocus_ipc::server::Limits;
use evfocus_ipc::{Error, FocusRequest};
use tokio::io::AsyncWriteExt;
use tokio::net::UnixStream;

async fn guarded<T>(test: impl Future<Output = T>) -> T {
    tokio::time::timeout(Duration::from_secs(30), test).await.unwrap_or_else(|_| panic!("the test hangs"))
}

#[tokio::test]
async fn garbage_closes_the_connection() {
    let served = serve(limits());
    let mut polite = served.client().await;
    for garbage in [
        &b"\0"[..],
        b"GET / HTTP/1.1\r\n\r\n\0",
        b"\xff\xfe\0",
        b"[]\0",
        b"{}\0",
        b"{\"method\": 7}\0",
        b"{\"method\": \"org.evfocus.Controller.GetStatus\", \"parameters\": []}\0",
        b"{\"method\": \"org.evfocus.Controller.MoveTo\", \"parameters\": {\"position\": 1e999}}\0",
    ] {
        let mut stream = say(&served.path, garbage).await;
        assert_eq!(guarded(hear(&mut stream)).await, "", "{}", garbage.escape_ascii());
        polite.status().await.unwrap();
    }
    let nested =
        [b"{\"method\": \"x\", \"parameters\": {\"a\": ".as_slice(), &b"[".repeat(20_000), b"\0"].concat();
    assert_eq!(guarded(hear(&mut say(&served.path, &nested).await)).await, "");
    polite.status().await.unwrap();
}

#[tokio::test]
async fn half_a_call_and_then_nothing_is_given_up_on_but_an_idle_client_is_not() {
    let served = serve(limits());
    let mut idle = served.client().await;
    let mut half = say(&served.path, b"{\"method\": \"org.evf").await;
    assert_eq!(guarded(hear(&mut half)).await, "");
    let mut half = say(&served.path, b"{\"method\": \"org.varlink.service.GetInfo\"}\0{").await;
    assert!(guarded(hear(&mut half)).await.contains("product"), "the call before is answered");
    idle.status().await.unwrap();
}

#[tokio::test]
async fn sixty_four_mebibytes_without_an_end_are_cut_off_early() {
    let served = serve(Limits { call_time: Duration::from_secs(20), ..limits() });
    let mut polite = served.client().await;
    let mut flood = UnixStream::connect(&served.path).await.unwrap();
    let chunk = vec![b'x'; 64 * 1024];
    let mut written = 0_usize;
    let error = guarded(async {
        loop {
            match flood.write(&chunk).await {
                Ok(bytes) => written += bytes,
                Err(error) => break error,
            }
            assert!(written < 64 << 20, "all of it was taken");
        }
    })
    .await;
    assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe);
    // The longest call and what fits into the kernel's buffers.
    assert!(written < 1 << 20, "{written} bytes were taken");
    polite.status().await.unwrap();
}

#[tokio::test]
async fn a_follower_that_does_not_read_is_disconnected_and_delays_nobody() {
    let served = serve(limits());
    let mut polite = served.client().await;
    let _deaf =
        say(&served.path, b"{\"method\": \"org.evfocus.Controller.Monitor\", \"more\": true}\0").await;
    // While the server waits for it, others are served.
    guarded(async {
        while served.service.sent.load(Ordering::Relaxed) == 0 {
            polite.status().await.unwrap();
        }
        let mut sent = 0;
        let mut unchanged = 0;
        while unchanged < 100 {
            polite.status().await.unwrap();
            let now = served.service.sent.load(Ordering::Relaxed);
            unchanged = if now == sent { unchanged + 1 } else { 0 };
            sent = now;
        }
        // A stream is as long as the kernel's buffer: nothing piles up in the server.
        assert!(sent < 200, "{sent} statuses of 10 kB were written to nobody");
    })
    .await;
    // It is disconnected once it has been deaf for too long: its place is free again.
    guarded(async {
        let mut clients = Vec::new();
        while clients.len() < limits().clients - 1 {
            let mut client = served.client().await;
            if client.status().await.is_ok() {
                clients.push(client);
            }
        }
    })
    .await;
}

#[tokio::test]
async fn a_client_that_never_stops_calling_does_not_keep_others_waiting() {
    let served = serve(limits());
    let mut polite = served.client().await;
    let flood = UnixStream::connect(&served.path).await.unwrap();
    let (mut from, mut to) = flood.into_split();
    let calls = b"{\"method\": \"org.evfocus.Controller.GetStatus\"}\0".repeat(1000);
    let writing = tokio::spawn(async move { while to.write_all(&calls).await.is_ok() {} });
    let reading = tokio::spawn(async move { tokio::io::copy(&mut from, &mut tokio::io::sink()).await });
    guarded(async {
        for _ in 0..200 {
            polite.status().await.unwrap();
        }
    })
    .await;
    assert!(!writing.is_finished() && !reading.is_finished(), "the flood goes on all the while");
    writing.abort();
    reading.abort();
}

#[tokio::test]
async fn one_way_calls_are_answered_with_silence() {
    let served = serve(limits());
    let mut stream = say(
        &served.path,
        b"{\"method\": \"org.evfocus.Controller.MoveTo\", \"parameters\": {\"position\": 9}, \"oneway\": true}\0\
          {\"method\": \"org.evfocus.Controller.Abort\"}\0",
    )
    .await;
    let reply = guarded(hear_one(&mut stream)).await;
    assert_eq!(reply, serde_json::json!({ "parameters": { "run_id": null } }));
}

#[tokio::test]
async fn streams_that_nobody_wants_to_hear_take_no_place() {
    let served = serve(limits());
    let mut polite = served.client().await;
    for _ in 0..limits().clients {
        for method in ["Monitor", "Focus"] {
            let call = format!(
                "{{\"method\": \"org.evfocus.Controller.{method}\", \"more\": true, \"oneway\": true}}\0"
            );
            let mut stream = say(&served.path, call.as_bytes()).await;
            assert_eq!(guarded(hear(&mut stream)).await, "", "{method} is hung up on");
        }
    }
    assert_eq!(served.service.sent.load(Ordering::Relaxed), 0);
    guarded(polite.status()).await.unwrap();
    guarded(async { while served.client().await.status().await.is_err() {} }).await;
}

#[tokio::test]
async fn wrong_calls_are_answered_with_typed_errors_and_the_connection_goes_on() {
    let served = serve(limits());
    let mut stream = UnixStream::connect(&served.path).await.unwrap();
    for (call, error, parameter, value) in [
        (
            r#""org.evfocus.Controller.Fokus""#,
            "org.varlink.service.MethodNotFound",
            "method",
            "org.evfocus.Controller.Fokus",
        ),
        (
            r#""org.example.Other.Get""#,
            "org.varlink.service.InterfaceNotFound",
            "interface",
            "org.example.Other",
        ),
        (r#""GetStatus""#, "org.varlink.service.InterfaceNotFound", "interface", ""),
        (
            r#""org.varlink.service.GetNothing""#,
            "org.varlink.service.MethodNotFound",
            "method",
            "org.varlink.service.GetNothing",
        ),
        (
            r#""org.varlink.service.GetInterfaceDescription""#,
            "org.varlink.service.InvalidParameter",
            "parameter",
            "interface",
        ),
        (
            r#""org.evfocus.Controller.GetStatus", "upgrade": true"#,
            "org.varlink.service.InvalidParameter",
            "parameter",
            "upgrade",
        ),
        (
            r#""org.evfocus.Controller.MoveTo", "parameters": {"position": "far"}"#,
            "org.evfocus.Controller.InvalidArgument",
            "name",
            "position",
        ),
        (
            r#""org.evfocus.Controller.SetMode", "parameters": {"mode": "turbo"}"#,
            "org.evfocus.Controller.InvalidArgument",
            "name",
            "mode",
        ),
    ] {
        stream.write_all(format!("{{\"method\": {call}}}\0").as_bytes()).await.unwrap();
        let reply = guarded(hear_one(&mut stream)).await;
        assert_eq!(reply["error"], error, "{call}");
        assert_eq!(reply["parameters"][parameter], value, "{call}");
    }
    stream.write_all(b"{\"method\": \"org.evfocus.Controller.Monitor\"}\0").await.unwrap();
    assert_eq!(guarded(hear_one(&mut stream)).await["error"], "org.varlink.service.ExpectedMore");
}

#[tokio::test]
async fn storms_of_clients_pass() {
    let served = serve(limits());
    let mut polite = served.client().await;
    for round in 0..500 {
        let stream = UnixStream::connect(&served.path).await.unwrap();
        drop(stream);
        let mut stream = UnixStream::connect(&served.path).await.unwrap();
        // Refused with a broken pipe if it is one too many.
        drop(stream.write_all(b"{\"method\": \"org.evfocus.Controller.GetSta").await);
        drop(stream);
        if round % 50 == 0 {
            guarded(polite.status()).await.unwrap();
        }
    }
    guarded(polite.status()).await.unwrap();
}

#[tokio::test]
async fn a_client_too_many_is_told_so_and_a_place_that_is_given_up_is_taken_again() {
    let served = serve(limits());
    let mut clients = Vec::new();
    for _ in 0..limits().clients {
        let mut client = served.client().await;
        client.status().await.unwrap();
        clients.push(client);
    }
    let refused = guarded(served.client().await.status()).await.unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Error::TooManyClients { limit: 8 })), "{refused}");
    clients.pop();
    guarded(async {
        // The server has to notice first.
        while served.client().await.status().await.is_err() {}
    })
    .await;
}

#[tokio::test]
async fn clients_are_let_go_at_shutdown_even_those_that_wait_for_an_answer() {
    let mut served = serve(Limits { grace: Duration::from_millis(50), ..limits() });
    let mut idle = served.client().await;
    idle.status().await.unwrap();
    let client = served.client().await;
    let waiting = tokio::spawn(async move { client.focus_and_wait(&FocusRequest::default()).await });
    let path = served.path.clone();
    served.shutdown.take();
    guarded(served.server).await.unwrap();
    assert!(matches!(guarded(waiting).await.unwrap(), Err(ClientError::Closed)));
    assert!(matches!(idle.status().await, Err(ClientError::Closed)));
    assert!(!path.exists(), "the socket is gone");
    assert!(matches!(Client::connect(&path).await, Err(ClientError::NotRunning { .. })));
}
