//! Text in all the ways that tools write events.

use evfocus_core::Geometry;
use evfocus_record::{RecordError, Recording};

use crate::common::{event, file, read_all, read_file};

fn events(text: &str) -> Vec<evfocus_core::Event> {
    let (_folder, path) = file("events.csv", text.as_bytes());
    read_file(&path, None)
}

/// The line number and the whole message of the error.
fn error(text: &str) -> (u64, String) {
    let (_folder, path) = file("events.csv", text.as_bytes());
    let result = Recording::open(&path, None)
        .and_then(|mut recording| recording.read(&mut evfocus_core::EventBatch::default()));
    let error = result.unwrap_err();
    let RecordError::Line { line, .. } = error else { panic!("{error}") };
    (line, error.to_string())
}

#[test]
fn headers_decide_about_columns_and_units() {
    let expected = [event(1_500_000, 3, 4, true), event(2_000_001, 5, 6, false)];
    for text in [
        "t_us,x,y,p\n1500000,3,4,1\n2000001,5,6,0\n",
        "t,x,y,p\r\n1500000,3,4,1\r\n2000001,5,6,-1\r\n",
        "\u{feff}timestamp,x,y,polarity\n1500000,3,4,true\n2000001,5,6,false",
        "# made by hand\n\nts;x;y;on\n1500000;3;4;True\n2000001;5;6;False\n",
        "timestamp [us], x, y, polarity\n1500000, 3, 4, 1\n2000001, 5, 6, 0\n",
        "t_s x y p\n1.5 3 4 1\n2.000001 5 6 0\n",
        "time,x,y,p\n1.5,3,4,1\n2.000001,5,6,0\n",
        "x,y,p,t\n3,4,1,1500000\n5,6,0,2000001\n",
        "camera,p,t_us,y,x\na,1,1500000,4,3\nb,0,2000001,6,5\n",
    ] {
        assert_eq!(events(text), expected, "{text:?}");
    }
}

#[test]
fn without_a_header_the_lines_decide_if_they_can() {
    let expected = [event(1_500_000, 3, 4, true), event(2_000_001, 5, 6, false)];
    assert_eq!(events("3,4,1,1500000\n5,6,0,2000001\n"), expected);
    assert_eq!(events("1500000,3,4,1\n2000001,5,6,0\n"), expected);
    assert_eq!(events("1.500000 3 4 1\n2.000001 5 6 0\n"), expected);
    let (line, message) = error("1,0,1,1\n1,1,1,1\n");
    assert_eq!(line, 1);
    assert!(
        message.contains("may be x,y,p,t as well as t,x,y,p") && message.contains("begin the file with"),
        "{message}"
    );
}

#[test]
fn unix_seconds_are_exact() {
    let text =
        "t_s,x,y,p\n1589163147.368868,1,2,1\n1589163147.3688685,1,2,1\n-0.5,1,2,1\n1e-3,1,2,1\n3,1,2,1\n";
    let times: Vec<i64> = events(text).iter().map(|event| event.t.0).collect();
    assert_eq!(times, [1_589_163_147_368_868, 1_589_163_147_368_869, -500_000, 1000, 3_000_000]);
}

#[test]
fn faerys_header_tells_the_size() {
    let (_folder, path) = file("faery.csv", b"t,x@640,y@480,on\n5,639,479,1\n");
    let mut recording = Recording::open(&path, None).unwrap();
    assert_eq!(recording.geometry(), Some(Geometry { width: 640, height: 480 }));
    assert_eq!(read_all(&mut recording), [event(5, 639, 479, true)]);
}

#[test]
fn text_is_recognised_whatever_its_name() {
    let (_folder, path) = file("misnamed.raw", b"t_us,x,y,p\n5,1,2,1\n");
    assert_eq!(read_file(&path, None), [event(5, 1, 2, true)]);
}

#[test]
fn errors_name_the_line_and_the_text() {
    for (text, line, parts) in [
        ("t_us,x,y,p\n5,1,2,1\n6,1,two,1\n", 3, &["line 3", "\"two\"", "y coordinate", "6,1,two,1"][..]),
        ("t_us,x,y,p\n5,1,2\n", 2, &["too few fields", "5,1,2"]),
        ("t_us,x,y,p\n5,1,2,7\n", 2, &["\"7\" is no polarity"]),
        ("t_us,x,y,p\n5.5,1,2,1\n", 2, &["whole microseconds"]),
        ("t_s,x,y,p\nnan,1,2,1\n", 2, &["\"nan\"", "seconds"]),
        ("t_us,x,y,p\n5,-1,2,1\n", 2, &["\"-1\"", "x coordinate"]),
        ("t_us,x,p\n5,1,1\n", 1, &["does not name the columns", "t_us,x,p"]),
        ("t_us,x,y,p,x\n5,1,2,1,2\n", 1, &["two columns", "\"x\""]),
        ("t_ms,x,y,p\n5,1,2,1\n", 1, &["microseconds or seconds", "t_ms"]),
        ("hello\n", 1, &["does not name the columns", "hello"]),
        ("t,x@4,y@4,p\n5,4,0,1\n", 2, &["outside of the 4x4 sensor"]),
    ] {
        let (found, message) = error(text);
        assert_eq!(found, line, "{text:?}: {message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is missing in {message:?}");
        }
        assert!(message.contains("events.csv"), "{message}");
    }
}

#[test]
fn an_endless_line_is_refused() {
    let mut text = String::from("t_us,x,y,p\n");
    text.push_str(&"1".repeat(100_000));
    let (line, message) = error(&text);
    assert_eq!(line, 2);
    assert!(message.contains("longer than") && message.len() < 400, "{message}");
}
