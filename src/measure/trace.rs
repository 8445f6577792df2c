//! `trace.json`: where the time of a run went, for Perfetto and `chrome://tracing`.
//!
//! Source: "Trace Event Format", complete events (`X`) and thread names (`M`).

use super::files::{FileError, write_with};
use serde::Serialize;
use serde_json::json;
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

/// One stretch of time on one track.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Span {
    /// What ran.
    pub name: Cow<'static, str>,
    /// What kind of work it was: `simulation`, `gpu`, …
    #[serde(rename = "cat")]
    pub category: &'static str,
    /// Start since the beginning of the run [µs].
    #[serde(rename = "ts")]
    pub start_us: f64,
    /// Duration [µs].
    #[serde(rename = "dur")]
    pub duration_us: f64,
    /// The track it is drawn on.
    #[serde(rename = "tid")]
    pub thread: u32,
}

/// Writes `spans`; `threads` names the tracks.
///
/// # Errors
///
/// [`FileError::Write`].
pub fn write_trace(file: &Path, spans: &[Span], threads: &[(u32, &str)]) -> Result<(), FileError> {
    let names = threads.iter().map(|(thread, name)| {
        json!({
            "ph": "M", "pid": 1, "tid": thread, "name": "thread_name", "args": { "name": name },
        })
    });
    write_with(file, |out| {
        // Event by event: a run of a hundred thousand frames has a million.
        out.write_all(b"{\"displayTimeUnit\":\"ms\",\"traceEvents\":[")?;
        let mut comma: &[u8] = b"";
        for name in names {
            out.write_all(comma)?;
            serde_json::to_writer(&mut *out, &name)?;
            comma = b",";
        }
        for span in spans {
            out.write_all(comma)?;
            let (kind, process) = ("X", 1);
            let event = Event {
                span,
                kind,
                process,
            };
            serde_json::to_writer(&mut *out, &event)?;
            comma = b",";
        }
        out.write_all(b"]}\n")
    })
}

/// A span as the format has it.
#[derive(Serialize)]
struct Event<'a> {
    #[serde(flatten)]
    span: &'a Span,
    #[serde(rename = "ph")]
    kind: &'static str,
    #[serde(rename = "pid")]
    process: u32,
}

#[cfg(test)]
mod tests {
    use super::super::files::{read, tests::Folder};
    use super::*;

    #[test]
    fn spans_become_complete_events_on_named_threads() {
        let folder = Folder::new();
        let file = folder.0.join("trace.json");
        let span = Span {
            name: "refit".into(),
            category: "gpu",
            start_us: 12.5,
            duration_us: 3.0,
            thread: 7,
        };
        write_trace(&file, &[span], &[(7, "GPU")]).unwrap();
        let trace: serde_json::Value = serde_json::from_slice(&read(&file).unwrap()).unwrap();
        let [name, event] = trace["traceEvents"].as_array().unwrap().as_slice() else {
            panic!("two events");
        };
        assert_eq!(
            (&name["ph"], &name["args"]["name"]),
            (&json!("M"), &json!("GPU"))
        );
        assert_eq!((&event["ph"], &event["ts"]), (&json!("X"), &json!(12.5)));
        assert_eq!((&event["dur"], &event["tid"]), (&json!(3.0), &json!(7)));
        assert_eq!(
            (&event["name"], &event["cat"]),
            (&json!("refit"), &json!("gpu"))
        );
    }
}
