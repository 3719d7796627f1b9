//! Files that are not what they should be: the message names the file, what it is, and what to do.

use evfocus_core::Geometry;
use evfocus_record::{Evt3Writer, Format, Recording};

use crate::common::{data, event, file, read_file};

fn message(name: &str, content: &[u8]) -> String {
    let (_folder, path) = file(name, content);
    let message = Recording::open(&path, None).unwrap_err().to_string();
    assert!(message.contains(name), "{message}");
    message
}

#[test]
fn foreign_files_are_named() {
    for (name, content, parts) in [
        ("empty.raw", &b""[..], &["empty"][..]),
        ("picture.raw", b"\x89PNG\r\n\x1a\n0000", &["PNG", "EVT3"]),
        ("old.aedat", b"#!AER-DAT3.1\r\n", &["AEDAT 3", "AEDAT4"]),
        ("notes.md", b"Dear diary,\ntoday", &["text", "Dear diary", "t_us,x,y,p"]),
        ("cut.raw", b"% evt 3.0\n% format EVT3;hei", &["breaks off"]),
        ("cut.aedat4", b"#!AER-DAT4", &["broken off"]),
        ("new.raw", b"% evt 2.1\n% end\n", &["EVT 2.1", "set the camera to EVT3"]),
        ("events.dat", b"% Version 2\n% Width 640\n\x0c\x08", &["'evt'", "DAT"]),
        (
            "words.bin",
            b"\xff\x00\x00\x00\x00\x00\x00\x00",
            &["binary data", "name the format", "davis346-words"],
        ),
        ("events.es", b"Event Stream\x02\x00\x00\x01", &["Event Stream", "faery"]),
    ] {
        let message = message(name, content);
        for part in parts {
            assert!(message.contains(part), "{part:?} is missing in {message:?}");
        }
    }
}

#[test]
fn aedat4_headers_that_lie() {
    for (content, part) in [
        (&b"#!AER-DAT4.0\r\n\xff\xff\xff\xff"[..], "larger than any real one"),
        (b"#!AER-DAT4.0\r\n\x10\x00\x00\x00abcd", "ends within its description"),
        (b"#!AER-DAT4.0\r\n\x04\x00\x00\x00abcd", "not readable"),
        (b"#!AER-DAT4.0\r\n\x04", "missing"),
    ] {
        let message = message("broken.aedat4", content);
        assert!(message.contains(part), "{part:?} is missing in {message:?}");
    }
}

#[test]
fn missing_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    let missing = Recording::open(folder.path().join("nothing.raw"), None).unwrap_err().to_string();
    assert!(missing.contains("nothing.raw") && missing.contains("cannot open"), "{missing}");
    let a_folder = Recording::open(folder.path(), None).unwrap_err().to_string();
    assert!(a_folder.contains("directory"), "{a_folder}");
}

#[test]
fn the_content_decides_not_the_name() {
    for (name, format) in [
        ("evt3_hd_1280x720_trigger.raw", Format::Evt3),
        ("davis346_events.aedat4", Format::Aedat4),
        ("davis346_usb_words_made.bin", Format::DavisWords),
    ] {
        let (_folder, path) = file("misnamed.csv", &std::fs::read(data(name)).unwrap());
        assert_eq!(Recording::open(&path, None).unwrap().format(), format, "{name}");
    }
}

#[test]
fn bare_words_are_read_if_their_format_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bare");
    let mut writer = Evt3Writer::create(&path, Geometry { width: 640, height: 480 }).unwrap();
    writer.write([event(5, 1, 2, true)]).unwrap();
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let header = bytes.windows(6).position(|window| window == b"% end\n").unwrap() + 6;
    std::fs::write(&path, &bytes[header..]).unwrap();
    assert!(Recording::open(&path, None).is_err());
    assert_eq!(read_file(&path, Some(Format::Evt3)), [event(5, 1, 2, true)]);
}

#[test]
fn old_headers_have_no_end() {
    let mut content = b"% Date 2020-01-01 00:00:00\n% evt 3.0\n% geometry 640x480\n".to_vec();
    for word in [0x8000_u16, 0x6005, 0x0002, 0x2801] {
        content.extend_from_slice(&word.to_le_bytes());
    }
    let (_folder, path) = file("old.raw", &content);
    assert_eq!(Recording::open(&path, None).unwrap().geometry(), Some(Geometry { width: 640, height: 480 }));
    assert_eq!(read_file(&path, None), [event(5, 1, 2, true)]);
}

#[test]
fn names_of_formats() {
    for format in Format::ALL {
        assert_eq!(format.name().parse(), Ok(format));
    }
    let error = "evt9".parse::<Format>().unwrap_err().to_string();
    assert!(Format::ALL.iter().all(|format| error.contains(format.name())), "{error}");
}
