//! Files of lens positions, good and bad.

use evfocus_core::{CameraMicros, LensPosition, LensTrace};
use evfocus_record::positions;
use proptest::prelude::*;

use crate::common::file;

#[test]
fn a_good_file() {
    let (_folder, path) = file("lens.csv", b"t_us,position\r\n0,219\r\n1000,220.5\r\n\r\n2500,-3\r\n");
    let trace = positions::read(&path).unwrap();
    let samples: Vec<_> = trace.samples().collect();
    let expected = [(0, 219.0), (1000, 220.5), (2500, -3.0)];
    assert_eq!(samples, expected.map(|(t, p)| (CameraMicros(t), LensPosition(p))));
    assert_eq!(trace.extent(), Some((LensPosition(-3.0), LensPosition(220.5))));
}

#[test]
fn bad_files_are_explained() {
    for (content, parts) in [
        (&b""[..], &["empty", "t_us,position"][..]),
        (b"t_us,position\n", &["only 0 positions"]),
        (b"t_us,position\n0,1\n", &["only 1 positions"]),
        (b"time,pos\n0,1\n", &["line 1", "time,pos", "must be t_us,position"]),
        (b"0,1\n1,2\n", &["line 1", "must be t_us,position"]),
        (b"t_us,position\n0,1\n1,nan\n", &["line 3", "\"nan\"", "1,nan"]),
        (b"t_us,position\n0,inf\n1,2\n", &["line 2", "\"inf\""]),
        (b"t_us,position\n0.5,1\n1,2\n", &["line 2", "\"0.5\"", "whole number"]),
        (b"t_us,position\n0,1\n0,2\n", &["line 3", "does not come after"]),
        (b"t_us,position\n5,1\n3,2\n", &["line 3", "does not come after", "sort"]),
        (b"t_us,position\n5,1,7\n6,2\n", &["line 2", "3 fields"]),
        (b"\x89PNG\r\n\x1a\n", &["line 1", "not the header"]),
    ] {
        let (_folder, path) = file("lens.csv", content);
        let message = positions::read(&path).unwrap_err().to_string();
        for part in parts.iter().chain(&["lens.csv"]) {
            assert!(message.contains(part), "{part:?} is missing in {message:?}");
        }
    }
    let missing = positions::read("no such file").unwrap_err().to_string();
    assert!(missing.contains("no such file") && missing.contains("cannot open"), "{missing}");
}

proptest! {
    /// Writing and reading back changes no sample.
    #[test]
    fn written_positions_come_back(steps in prop::collection::vec((1..i64::from(u32::MAX), -1e9..1e9_f64), 2..50)) {
        let mut trace = LensTrace::with_capacity(steps.len());
        let mut t = -5;
        for (step, position) in steps {
            t += step;
            trace.push(CameraMicros(t), LensPosition(position)).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lens.csv");
        positions::write(&path, &trace).unwrap();
        let read = positions::read(&path).unwrap();
        prop_assert!(read.samples().eq(trace.samples()));
    }
}
