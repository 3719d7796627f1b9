//! The cameras' side of USB/IP, by a host that speaks it byte for byte.

mod bad_input;
mod descriptors;
mod host;
mod over_tcp;

use std::time::Duration;

use evfocus_core::EventBatch;
use evfocus_core::decode::DavisWordDecoder;
use hil_sim::usbip::UsbIpError;
use hil_sim::{MotionConfig, UsbFaults, UsbModel};

use host::{Host, setup};

/// Linux's numbers.
const EPIPE: i32 = -32;
const EPROTO: i32 = -71;
const EOVERFLOW: i32 = -75;
const ECONNRESET: i32 = -104;

#[test]
fn requests_reach_the_registers() {
    let mut host = Host::new(UsbModel::Davis346);
    assert_eq!(host.control(setup(0xC0, 0xBF, 6, 0, 4), &[]), Ok(vec![0, 0, 0, 18]), "the logic's version");
    host.write(5, 10, 0xDEAD_BEEF);
    assert_eq!(host.port.register(5, 10), 0xDEAD_BEEF);
    assert_eq!(host.control(setup(0xC0, 0xBF, 5, 10, 4), &[]), Ok(vec![0xDE, 0xAD, 0xBE, 0xEF]));
    assert_eq!(host.control(setup(0xC0, 0x99, 0, 0, 4), &[]), Err(EPIPE), "no such request");
}

#[test]
fn transfers_wait_until_there_is_data_and_end_with_short_packets() {
    let mut host = Host::new(UsbModel::Davis346);
    let asked: Vec<u32> = (0..64).map(|_| host.ask(0x82, 8192).unwrap().0).collect();
    assert_eq!(host.pass(50).unwrap(), [], "the camera does not run");
    host.start();
    let answers = host.pass(400).unwrap();
    let numbers: Vec<u32> = answers.iter().map(|answer| answer.sequence).collect();
    assert_eq!(numbers, asked[..numbers.len()], "in the order in which they were submitted");
    assert!(numbers.len() > 10, "{} transfers", numbers.len());
    for answer in &answers {
        assert_eq!((answer.kind, answer.status, answer.length as usize), (3, 0, answer.data.len()));
        assert!(!answer.data.is_empty() && answer.data.len() <= 8192);
    }
}

#[test]
fn what_the_host_gets_is_what_the_pixels_made() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    let (mut decoder, mut batch) = (DavisWordDecoder::live(), EventBatch::with_capacity(65_536));
    for _ in 0..50 {
        let (_, at_once) = host.ask(0x82, 16384).unwrap();
        for answer in at_once.into_iter().chain(host.pass(1).unwrap()) {
            decoder.decode(&answer.data, &mut batch);
        }
    }
    let tallies = host.port.tallies();
    let tally = tallies.iter().find(|tally| tally.events == 4096).unwrap();
    let first: Vec<_> = batch.events.iter().take(4096).collect();
    assert_eq!(first.iter().filter(|event| event.polarity.is_on()).count() as u64, tally.on);
    assert_eq!(first.iter().map(|event| u64::from(event.x)).sum::<u64>(), tally.x);
    assert_eq!(first.iter().map(|event| u64::from(event.y)).sum::<u64>(), tally.y);
    assert_eq!(first.iter().map(|event| (event.t.0 - first[0].t.0) as u64).sum::<u64>(), tally.t_us);
}

#[test]
fn a_waiting_transfer_can_be_given_back_and_an_ended_one_cannot() {
    let mut host = Host::new(UsbModel::Davis346);
    let (first, _) = host.ask(0x82, 8192).unwrap();
    let (second, _) = host.ask(0x82, 8192).unwrap();
    assert_eq!(host.give_back(first), Ok(ECONNRESET));
    host.start();
    let answers = host.pass(100).unwrap();
    assert_eq!(answers.iter().map(|answer| answer.sequence).collect::<Vec<_>>(), [second]);
    assert_eq!(host.give_back(second), Ok(0));
    assert_eq!(host.give_back(12345), Ok(0), "never submitted");
}

#[test]
fn the_interrupt_endpoint_waits_for_good() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    let (number, _) = host.ask(0x81, 64).unwrap();
    assert_eq!(host.pass(50).unwrap(), []);
    assert_eq!(host.give_back(number), Ok(ECONNRESET));
}

#[test]
fn a_stalled_endpoint_refuses_until_its_halt_is_cleared() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    host.port.set_faults(UsbFaults { stalls: 1, ..UsbFaults::default() });
    let (_, answers) = host.ask(0x82, 8192).unwrap();
    assert_eq!((answers[0].status, answers[0].length), (EPIPE, 0));
    assert_eq!(host.control(setup(0x82, 0, 0, 0x82, 2), &[]), Ok(vec![1, 0]), "halted");
    assert_eq!(host.ask(0x82, 8192).unwrap().1[0].status, EPIPE, "still");
    assert_eq!(host.control(setup(0x02, 1, 0, 0x82, 0), &[]), Ok(vec![]));
    assert_eq!(host.control(setup(0x82, 0, 0, 0x82, 2), &[]), Ok(vec![0, 0]));
    host.ask(0x82, 8192).unwrap();
    let answers = host.pass(100).unwrap();
    assert_eq!(answers[0].status, 0);
}

#[test]
fn a_babbling_device_breaks_the_rules() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    host.port.set_faults(UsbFaults { babble: Some(1), ..UsbFaults::default() });
    assert_eq!(host.ask(0x82, 8192).unwrap().1[0].length, 2000, "anything");
    assert_eq!(host.ask(0x82, 8192).unwrap().1[0].status, EPROTO);
}

#[test]
fn a_packet_longer_than_what_is_left_overflows() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    let (number, _) = host.ask(0x82, 7).unwrap();
    let answers = host.pass(100).unwrap();
    assert_eq!((answers[0].sequence, answers[0].status), (number, EOVERFLOW));
}

#[test]
fn full_packets_go_on_in_the_same_transfer() {
    let mut host = Host::before(UsbModel::Davis346, MotionConfig::moving(3000.0));
    // Pieces of 1024 bytes are full packets.
    host.port.set_faults(UsbFaults { short_packets: Some(512), ..UsbFaults::default() });
    host.start();
    let mut lengths = Vec::new();
    for _ in 0..50 {
        lengths.extend(host.ask(0x82, 2048).unwrap().1.iter().map(|answer| answer.length));
        host.pass(1).unwrap();
    }
    assert!(lengths.iter().any(|length| *length > 1024), "{lengths:?}");
    assert!(!lengths.contains(&1024), "{lengths:?}");
}

#[test]
fn messages_of_the_evk4_are_answered_where_the_host_waits_for_it() {
    let mut host = Host::new(UsbModel::Evk4);
    let (waiting, answers) = host.ask(0x82, 1024).unwrap();
    assert_eq!(answers, [], "nothing was asked yet");
    let answers = host.send(0x02, &[0x79_u32, 0].map(u32::to_le_bytes).concat()).unwrap();
    let answer = answers.iter().find(|answer| answer.sequence == waiting).unwrap();
    assert_eq!(answer.data, [0x79_u32, 4, 0x3_0900].map(u32::to_le_bytes).concat());
    // Twelve bytes into eight.
    host.send(0x02, &[0x79_u32, 0].map(u32::to_le_bytes).concat()).unwrap();
    assert_eq!(host.ask(0x82, 8).unwrap().1[0].status, EOVERFLOW);
}

#[test]
fn slow_requests_are_answered_late_and_can_be_given_back() {
    let mut host = Host::new(UsbModel::Evk4);
    let control_delay = Duration::from_millis(5);
    host.port.set_faults(UsbFaults { control_delay, ..UsbFaults::default() });
    let question = [0x79_u32, 0].map(u32::to_le_bytes).concat();
    assert_eq!(host.send(0x02, &question).unwrap(), []);
    assert_eq!(host.pass(4).unwrap(), []);
    assert_eq!(host.pass(1).unwrap().len(), 1);
    assert_eq!(host.send(0x02, &question).unwrap(), []);
    assert_eq!(host.give_back(3), Ok(0), "not that one");
    assert_eq!(host.give_back(2), Ok(ECONNRESET));
    assert_eq!(host.pass(20).unwrap(), []);
}

#[test]
fn a_pulled_camera_ends_the_connection_and_has_forgotten_all_when_it_is_back() {
    let mut host = Host::new(UsbModel::Davis346);
    host.start();
    host.ask(0x82, 8192).unwrap();
    host.port.pull();
    assert_eq!(host.pass(1), Err(UsbIpError::Unplugged));
    assert!(matches!(host.port.attach(), Err(UsbIpError::Unplugged)));
    host.port.push();
    assert_eq!(host.pass(1), Err(UsbIpError::Unplugged), "the old connection stays dead");
    host.session = host.port.attach().unwrap();
    assert_eq!(host.control(setup(0xC0, 0xBF, 9, 0, 4), &[]), Ok(vec![0; 4]), "does not run");
    host.start();
    host.ask(0x82, 8192).unwrap();
    assert_eq!(host.pass(100).unwrap()[0].status, 0);
}
