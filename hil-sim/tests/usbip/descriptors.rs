//! What the cameras say of themselves.

use hil_sim::UsbModel;

use super::host::{Host, setup};

fn descriptor(host: &mut Host, kind: u16, index: u16, length: u16) -> Result<Vec<u8>, i32> {
    host.control(setup(0x80, 6, kind << 8 | index, 0, length), &[])
}

/// Text of a string descriptor, which is UTF-16.
fn string(host: &mut Host, index: u16) -> String {
    let bytes = descriptor(host, 3, index, 255).unwrap();
    assert_eq!((usize::from(bytes[0]), bytes[1]), (bytes.len(), 3));
    String::from_utf16(
        &bytes[2..].as_chunks().0.iter().map(|unit| u16::from_le_bytes(*unit)).collect::<Vec<_>>(),
    )
    .unwrap()
}

/// The descriptors that make up a configuration, whose lengths must add up.
fn parts(mut configuration: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    while let [length, ..] = configuration {
        let (part, rest) = configuration.split_at(usize::from(*length));
        parts.push(part);
        configuration = rest;
    }
    parts
}

#[test]
fn the_davis346_is_a_superspeed_device_with_its_numbers() {
    let mut host = Host::new(UsbModel::Davis346);
    let device = descriptor(&mut host, 1, 0, 18).unwrap();
    assert_eq!(device, [18, 1, 0, 3, 0, 0, 0, 9, 0x2A, 0x15, 0x1A, 0x84, 6, 0, 1, 2, 3, 1]);
    assert_eq!(descriptor(&mut host, 3, 0, 255).unwrap(), [4, 3, 9, 4]);
    assert_eq!(string(&mut host, 3), "00000001");
    assert_eq!(string(&mut host, 2), "DAVIS346");
    assert_eq!(descriptor(&mut host, 3, 9, 255), Err(-32));
    assert_eq!(descriptor(&mut host, 6, 0, 10), Err(-32), "a qualifier is for USB 2");
}

#[test]
fn every_endpoint_has_its_companion_and_the_power_is_in_units_of_8_ma() {
    for (model, endpoints) in [
        (UsbModel::Davis346, vec![(0x82, 2), (0x81, 3)]),
        (UsbModel::Evk4, vec![(0x82, 2), (0x02, 2), (0x81, 2)]),
    ] {
        let mut host = Host::new(model);
        let head = descriptor(&mut host, 2, 0, 9).unwrap();
        let total = u16::from_le_bytes([head[2], head[3]]);
        let whole = descriptor(&mut host, 2, 0, total).unwrap();
        assert_eq!(whole.len(), usize::from(total));
        assert_eq!(descriptor(&mut host, 2, 0, 4096).unwrap(), whole, "no more than there is");
        let parts = parts(&whole);
        assert!(u16::from(whole[8]) * 8 <= 900, "a port gives 900 mA: {}", whole[8]);
        assert_eq!(parts[1][..2], [9, 4]);
        assert_eq!(usize::from(parts[1][4]), endpoints.len());
        for (index, (address, kind)) in endpoints.into_iter().enumerate() {
            let [endpoint, companion] = parts[2 + 2 * index..][..2] else { panic!("missing") };
            assert_eq!((endpoint[1], endpoint[2], endpoint[3]), (5, address, kind));
            let packet = u16::from_le_bytes([endpoint[4], endpoint[5]]);
            assert_eq!(packet, if kind == 2 { 1024 } else { 64 });
            assert_eq!((companion[0], companion[1]), (6, 48));
            assert!(companion[2] <= 15, "bursts are of 1 to 16 packets");
        }
    }
}

#[test]
fn the_object_store_says_superspeed() {
    let mut host = Host::new(UsbModel::Evk4);
    let store = descriptor(&mut host, 15, 0, 255).unwrap();
    assert_eq!(usize::from(u16::from_le_bytes([store[2], store[3]])), store.len());
    let parts = parts(&store);
    assert_eq!(parts.len() - 1, usize::from(store[4]));
    assert!(parts.iter().any(|part| part[1..3] == [16, 3]));
}

#[test]
fn the_evk4_has_no_serial_number_string() {
    let mut host = Host::new(UsbModel::Evk4);
    assert_eq!(descriptor(&mut host, 1, 0, 18).unwrap()[16], 0);
    assert_eq!((string(&mut host, 1), string(&mut host, 2)), ("Prophesee".to_owned(), "EVK4".to_owned()));
    assert_eq!(descriptor(&mut host, 3, 3, 255), Err(-32));
}

#[test]
fn standard_requests_are_kept() {
    let mut host = Host::new(UsbModel::Davis346);
    assert_eq!(host.control(setup(0x80, 8, 0, 0, 1), &[]), Ok(vec![0]), "not configured");
    assert_eq!(host.control(setup(0x00, 9, 1, 0, 0), &[]), Ok(vec![]));
    assert_eq!(host.control(setup(0x80, 8, 0, 0, 1), &[]), Ok(vec![1]));
    assert_eq!(host.control(setup(0x00, 9, 2, 0, 0), &[]), Err(-32), "no such configuration");
    assert_eq!(host.control(setup(0x01, 11, 0, 0, 0), &[]), Ok(vec![]));
    assert_eq!(host.control(setup(0x01, 11, 1, 0, 0), &[]), Err(-32), "no such setting");
    assert_eq!(host.control(setup(0x80, 0, 0, 0, 2), &[]), Ok(vec![0, 0]));
    assert_eq!(host.control(setup(0x00, 48, 0, 0, 6), &[0; 6]), Ok(vec![]), "times to leave U1 and U2");
}
