//! Setting up the socket, and what clients are told where there is none.

use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener as StdListener;

use evfocus_ipc::client::{Client, ClientError};
use evfocus_ipc::server::{BindError, Socket};

#[tokio::test]
async fn a_live_socket_is_refused_and_a_dead_one_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("evfocus.sock");
    let first = Socket::bind(&path).unwrap();
    let taken = Socket::bind(&path).unwrap_err();
    assert!(matches!(taken, BindError::Taken { .. }), "{taken}");
    drop(first);
    assert!(!path.exists(), "the socket goes away with its owner");

    // A process that dies leaves its socket behind.
    drop(StdListener::bind(&path).unwrap());
    assert!(path.exists());
    assert!(matches!(Client::connect(&path).await, Err(ClientError::Stale { .. })));
    let second = Socket::bind(&path).unwrap();
    assert!(matches!(Socket::bind(&path), Err(BindError::Taken { .. })));
    assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o660);
    let left: Vec<_> = directory.path().read_dir().unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
    drop(second);
}

#[tokio::test]
async fn a_daemon_does_not_remove_the_socket_of_its_successor() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("evfocus.sock");
    let first = Socket::bind(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let second = Socket::bind(&path).unwrap();
    drop(first);
    assert!(path.exists());
    drop(second);
    assert!(!path.exists());
}

#[tokio::test]
async fn what_is_in_the_way_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("file");
    std::fs::write(&file, "precious").unwrap();
    assert!(matches!(Socket::bind(&file), Err(BindError::NotASocket { .. })));
    assert_eq!(std::fs::read(&file).unwrap(), b"precious");

    let missing = directory.path().join("missing/evfocus.sock");
    assert!(matches!(Socket::bind(&missing), Err(BindError::NoDirectory { .. })));
    let long = directory.path().join("x".repeat(200));
    assert!(Socket::bind(&long).unwrap_err().to_string().contains("cannot set up the socket"));
}

#[tokio::test]
async fn a_client_is_told_what_to_do_where_no_daemon_is() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("evfocus.sock");
    let told = Client::connect(&path).await.unwrap_err().to_string();
    assert!(told.contains("is evfocusd running?") && told.contains("evfocus.sock"), "{told}");
}
