//! The server and the client on real sockets.

mod bind;
mod hostile;
mod plain;
mod zlink_client;
