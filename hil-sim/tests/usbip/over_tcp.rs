//! The server on a real socket.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;

use evfocus_hal::SystemClock;
use hil_sim::usbip::Server;
use hil_sim::{Rig, RigConfig, UsbModel};

use super::host::{setup, submit};

fn ask(server: &Server, question: &[u8], answer: &mut [u8]) -> TcpStream {
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.write_all(question).unwrap();
    stream.read_exact(answer).unwrap();
    stream
}

const LIST: [u8; 8] = [0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0];

fn import(bus_id: &str) -> Vec<u8> {
    let mut question = vec![0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0];
    question.extend(bus_id.bytes());
    question.resize(40, 0);
    question
}

#[test]
fn a_host_lists_the_camera_takes_it_and_sees_it_pulled() {
    let rig = Rig::new(RigConfig::default(), Arc::new(SystemClock::new())).unwrap();
    let port = rig.plug(UsbModel::Davis346);
    let server = Server::tcp(port.clone(), 0).unwrap();

    let mut list = [0; 12 + 312 + 4];
    ask(&server, &LIST, &mut list);
    assert_eq!(list[..12], [1, 0x11, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1], "one device");
    assert_eq!(list[12 + 256..][..4], *b"1-1\0");
    assert_eq!(list[12 + 288 + 8..][..10], [0, 0, 0, 5, 0x15, 0x2A, 0x84, 0x1A, 0, 6], "SuperSpeed, numbers");
    assert_eq!(list[12 + 312..], [0xFF, 0, 0, 0], "the interface");

    let mut refused = [0; 8];
    ask(&server, &import("1-2"), &mut refused);
    assert_eq!(refused, [1, 0x11, 0, 3, 0, 0, 0, 1]);

    let mut taken = [0; 8 + 312];
    let mut stream = ask(&server, &import(server.bus_id()), &mut taken);
    assert_eq!(taken[..8], [1, 0x11, 0, 3, 0, 0, 0, 0]);
    stream.write_all(&submit(1, 0x80, 4, setup(0xC0, 0xBF, 6, 0, 4), &[])).unwrap();
    let mut answer = [0; 52];
    stream.read_exact(&mut answer).unwrap();
    assert_eq!(answer[48..], [0, 0, 0, 18], "the logic's version");

    stream.write_all(&submit(2, 0x82, 512, [0; 8], &[])).unwrap();
    port.pull();
    assert_eq!(stream.read(&mut answer).unwrap(), 0, "closed");
    let mut empty = [0; 12];
    ask(&server, &LIST, &mut empty);
    assert_eq!(empty[8..], [0; 4], "no device");
    port.push();
    ask(&server, &import("1-1"), &mut taken);
    assert_eq!(taken[7], 0);
}

#[test]
fn a_host_of_another_version_is_sent_away() {
    let rig = Rig::new(RigConfig::default(), Arc::new(SystemClock::new())).unwrap();
    let server = Server::tcp(rig.plug(UsbModel::Evk4), 0).unwrap();
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.write_all(&[0x01, 0x06, 0x80, 0x05, 0, 0, 0, 0]).unwrap();
    assert_eq!(stream.read(&mut [0; 8]).unwrap(), 0, "closed without an answer");
    ask(&server, &LIST, &mut [0; 12]);
}
