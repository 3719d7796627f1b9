//! Hosts that do not keep to the protocol.

use evfocus_hal::Clock;
use hil_sim::UsbModel;
use hil_sim::usbip::UsbIpError;
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::host::{Host, setup, submit, unlink};

/// `bytes` with another big-endian word at `index`.
fn with_word(mut bytes: Vec<u8>, index: usize, word: u32) -> Vec<u8> {
    bytes[index * 4..][..4].copy_from_slice(&word.to_be_bytes());
    bytes
}

#[test]
fn what_is_no_command_ends_the_connection_by_name() {
    let good = submit(1, 0x82, 8192, [0; 8], &[]);
    let cases = [
        (with_word(good.clone(), 0, 7), UsbIpError::UnknownCommand(7)),
        (with_word(good.clone(), 4, 16), UsbIpError::NoSuchEndpoint(16)),
        (with_word(good.clone(), 6, u32::MAX), UsbIpError::TooLong(u32::MAX)),
        (with_word(good.clone(), 8, 8), UsbIpError::Isochronous(8)),
    ];
    for (bytes, error) in cases {
        assert_eq!(Host::new(UsbModel::Davis346).exchange(&bytes), Err(error));
    }
    assert!(Host::new(UsbModel::Davis346).exchange(&with_word(good, 8, u32::MAX)).is_ok(), "not isochronous");
}

#[test]
fn endpoints_that_there_are_not_stall() {
    let mut host = Host::new(UsbModel::Davis346);
    for endpoint in [0x83, 0x8F] {
        assert_eq!(host.ask(endpoint, 512).unwrap().1[0].status, -32);
    }
    assert_eq!(host.send(0x02, &[1, 2, 3]).unwrap()[0].status, -32);
}

#[test]
fn transfers_without_end_are_refused() {
    let mut host = Host::new(UsbModel::Davis346);
    let error = (0..10_000).find_map(|_| host.ask(0x82, 512).err());
    assert_eq!(error, Some(UsbIpError::TooManyTransfers(4096)));
}

#[test]
fn commands_may_be_cut_anywhere() {
    let version = submit(1, 0x80, 4, setup(0xC0, 0xBF, 6, 0, 4), &[]);
    let write = submit(2, 0, 4, setup(0x40, 0xBF, 5, 1, 4), &[1, 2, 3, 4]);
    let commands = [version, write, submit(3, 0x82, 512, [0; 8], &[]), unlink(4, 3)].concat();
    let answers = |pieces: std::slice::Chunks<'_, u8>| {
        let mut host = Host::new(UsbModel::Davis346);
        let mut answers = Vec::new();
        for piece in pieces {
            host.session.receive(piece, &mut answers).unwrap();
        }
        answers
    };
    let whole = answers(commands.chunks(commands.len()));
    assert_eq!(whole.len(), 4 * 48 + 4 - 48, "three transfers, of which one was given back");
    for size in [1, 7, 47, 48, 49] {
        assert_eq!(answers(commands.chunks(size)), whole, "in pieces of {size}");
    }
}

#[test]
fn no_bytes_make_it_panic_or_hang() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
    for round in 0..2000 {
        let model = if round % 2 == 0 { UsbModel::Davis346 } else { UsbModel::Evk4 };
        let mut host = Host::new(model);
        let mut answers = Vec::new();
        for _ in 0..20 {
            // Whole commands with some of their words replaced, so that not all end at the first check.
            let mut bytes =
                submit(random.random(), random.random(), random.random_range(0..3000), [0; 8], &[]);
            random.fill_bytes(&mut bytes[40..]);
            if random.random_ratio(1, 10) {
                let word = random.random_range(0..12);
                bytes = with_word(bytes, word, random.random());
            }
            bytes[3] = random.random_range(1..3);
            bytes.resize(48 + random.random_range(0..100), 0x55);
            host.clock.sleep_until(host.clock.now() + std::time::Duration::from_millis(3));
            let ended = host.session.receive(&bytes, &mut answers);
            if ended.is_err() || host.session.advance(&mut answers).is_err() {
                break;
            }
        }
        assert!(answers.len() < 1 << 20, "{} bytes", answers.len());
    }
}
