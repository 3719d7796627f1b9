//! The XML that describes the streams of a file: `<node name= path=>` within one another, `<attr key=>value</attr>` in them.

use evfocus_core::Geometry;

/// A stream of events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct EventStream {
    /// The number that its packets bear.
    pub(super) id: i32,
    pub(super) geometry: Option<Geometry>,
}

/// The first stream of events that the description names.
pub(super) fn first_event_stream(xml: &str) -> Option<EventStream> {
    let mut found: Option<i32> = None;
    let (mut width, mut height) = (None, None);
    for (path, key, value) in Attributes::new(xml) {
        // "/outInfo/0/" or "/outInfo/0/info/"; dv-gui puts the name of its module before: "/mainloop/Recorder/outInfo/0/".
        let mut parts =
            path.split('/').skip_while(|part| *part != "outInfo").skip(1).filter(|part| !part.is_empty());
        let (Some(id), part) = (parts.next(), parts.next()) else { continue };
        let Ok(id) = id.parse::<i32>() else { continue };
        match (part, key) {
            (None, "typeIdentifier") if value == "EVTS" && found.is_none() => found = Some(id),
            (Some("info"), "sizeX") if found == Some(id) => width = value.parse().ok(),
            (Some("info"), "sizeY") if found == Some(id) => height = value.parse().ok(),
            _ => {}
        }
    }
    let geometry = match (width, height) {
        (Some(width), Some(height)) if width > 0 && height > 0 => Some(Geometry { width, height }),
        _ => None,
    };
    found.map(|id| EventStream { id, geometry })
}

/// The attributes as (path of the node, key, value), in the order of the text. Not a parser of XML at large: it knows what
/// iniVation's software writes, and finds nothing in anything else.
struct Attributes<'a> {
    rest: &'a str,
    path: &'a str,
}

impl<'a> Attributes<'a> {
    fn new(xml: &'a str) -> Self {
        Self { rest: xml, path: "" }
    }
}

impl<'a> Iterator for Attributes<'a> {
    type Item = (&'a str, &'a str, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (_, from_tag) = self.rest.split_once('<')?;
            let (tag, after) = from_tag.split_once('>')?;
            self.rest = after;
            if tag.starts_with("node ") {
                // A node's attributes stand before its children, so the last path seen is theirs.
                self.path = quoted(tag, "path=\"").unwrap_or_default();
            } else if tag.starts_with("attr ")
                && let Some(key) = quoted(tag, "key=\"")
                && let Some((value, _)) = after.split_once('<')
            {
                return Some((self.path, key, value.trim()));
            }
        }
    }
}

fn quoted<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let (_, from_value) = tag.split_once(name)?;
    from_value.split_once('"').map(|(value, _)| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dv_gui_puts_its_modules_before_the_streams() {
        let xml = r#"<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/">
            <node name="0" path="/mainloop/Recorder/outInfo/0/">
                <attr key="typeIdentifier" type="string">FRME</attr>
                <node name="info" path="/mainloop/Recorder/outInfo/0/info/"><attr key="sizeX" type="int">9</attr></node>
            </node>
            <node name="3" path="/mainloop/Recorder/outInfo/3/">
                <attr key="typeIdentifier" type="string">EVTS</attr>
                <node name="info" path="/mainloop/Recorder/outInfo/3/info/">
                    <attr key="sizeX" type="int">346</attr>
                    <attr key="sizeY" type="int">260</attr>
                </node>
            </node></node></dv>"#;
        let geometry = Some(Geometry { width: 346, height: 260 });
        assert_eq!(first_event_stream(xml), Some(EventStream { id: 3, geometry }));
    }

    #[test]
    fn text_that_is_no_description_names_no_stream() {
        for xml in [
            "",
            "<",
            "<node path=\"/outInfo/0/\">",
            "<attr key=\"typeIdentifier\">EVTS</attr>",
            "<node path=\"/outInfo/x/\"><attr key=\"typeIdentifier\">EVTS<",
        ] {
            assert_eq!(first_event_stream(xml), None, "{xml:?}");
        }
    }
}
