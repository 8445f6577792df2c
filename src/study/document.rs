//! `NAME.json` and `NAME.csv`: the rows of a study, and what they were measured on.

use super::Study;
use super::shard::Shard;
use crate::app::AppError;
use crate::measure::FileError;
use crate::measure::files;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::fmt;
use std::path::Path;

/// What all rows of a run have in common. The names of the fields are the keys of `NAME.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header<P> {
    pub study: Study,
    /// Version of the program.
    pub version: String,
    /// Commit it was built from.
    pub commit: String,
    /// GPU adapter; `"none"` for a study that needs no GPU.
    pub adapter: String,
    /// The machine, or the machines of a merged study.
    pub cpu: String,
    /// Threads it was allowed to use.
    pub threads: usize,
    /// Which part of the study this is; null for the whole of it.
    pub shard: Option<Shard>,
    /// What the cells follow from.
    pub plan: P,
}

impl<P: PartialEq> Header<P> {
    /// In what two runs differ that must not be joined: a word each.
    pub fn differences(&self, other: &Self) -> Vec<&'static str> {
        [
            ("study", self.study != other.study),
            ("version", self.version != other.version),
            ("commit", self.commit != other.commit),
            ("adapter", self.adapter != other.adapter),
            ("settings", self.plan != other.plan),
        ]
        .into_iter()
        .filter_map(|(word, differs)| differs.then_some(word))
        .collect()
    }
}

/// A study with its rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document<P, R> {
    #[serde(flatten)]
    pub header: Header<P>,
    pub rows: Vec<R>,
}

impl<P: Serialize + DeserializeOwned, R: Serialize + DeserializeOwned> Document<P, R> {
    /// As JSON, a row a line.
    pub fn json(&self) -> String {
        let header = serde_json::to_string(&self.header).expect("a header has string keys");
        let rows: Vec<String> = self.rows.iter().map(row_text).collect();
        let open = header.strip_suffix('}').expect("a header is an object");
        format!("{open},\n\"rows\":[\n{}\n]}}\n", rows.join(",\n"))
    }

    /// As CSV: the keys of the rows, then the rows. An absent value is an empty field.
    pub fn csv(&self) -> String {
        let mut lines = csv::Writer::from_writer(Vec::new());
        for (index, row) in self.rows.iter().enumerate() {
            let Fields(fields) = serde_json::from_str(&row_text(row)).expect("a row is an object");
            if index == 0 {
                let keys = fields.iter().map(|(key, _)| key);
                lines.write_record(keys).expect("memory takes all");
            }
            let values = fields.iter().map(|(_, value)| match value {
                Value::Null => String::new(),
                Value::String(text) => text.clone(),
                other => other.to_string(),
            });
            lines.write_record(values).expect("memory takes all");
        }
        let bytes = lines.into_inner().expect("memory takes all");
        String::from_utf8(bytes).expect("rows are text")
    }

    /// Reads `NAME.json`.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] if it can't be read or is no such document.
    pub fn read(file: &Path) -> Result<Self, AppError> {
        let bytes = files::read(file)?;
        serde_json::from_slice(&bytes).map_err(|error| {
            AppError::File(FileError::Content {
                file: file.to_owned(),
                problem: format!(
                    "it holds no study that this version writes: {error}; run the study again"
                ),
            })
        })
    }
}

fn row_text<R: Serialize>(row: &R) -> String {
    serde_json::to_string(row).expect("a row has string keys")
}

/// The fields of a JSON object in the order they stand there.
struct Fields(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Fields {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Fields;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Fields, M::Error> {
                let mut fields = Vec::new();
                while let Some(field) = map.next_entry()? {
                    fields.push(field);
                }
                Ok(Fields(fields))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Row {
        substeps: u32,
        method: String,
        error: Option<f64>,
        why: String,
    }

    fn document() -> Document<u32, Row> {
        let row = |substeps, error, why: &str| Row {
            substeps,
            method: "xpbd".to_owned(),
            error,
            why: why.to_owned(),
        };
        Document {
            header: Header {
                study: Study::Solver,
                version: "1".to_owned(),
                commit: "abc".to_owned(),
                adapter: "none".to_owned(),
                cpu: "a machine".to_owned(),
                threads: 2,
                shard: None,
                plan: 7,
            },
            rows: vec![row(1, Some(0.1), ""), row(2, None, "a, \"b\"")],
        }
    }

    #[test]
    fn json_has_the_fixed_keys_and_reads_back() {
        let document = document();
        let value: Value = serde_json::from_str(&document.json()).expect("it is JSON");
        assert_eq!(value["study"], "solver");
        assert_eq!(value["adapter"], "none");
        assert_eq!(value["rows"][1]["error"], Value::Null);
        let back: Document<u32, Row> = serde_json::from_str(&document.json()).expect("and ours");
        assert_eq!(back, document);
    }

    #[test]
    fn csv_keeps_the_order_of_the_keys_and_quotes_what_needs_it() {
        assert_eq!(
            document().csv(),
            "substeps,method,error,why\n1,xpbd,0.1,\n2,xpbd,,\"a, \"\"b\"\"\"\n"
        );
    }

    #[test]
    fn runs_of_different_commits_or_settings_differ_by_name() {
        let here = document().header;
        let mut there = here.clone();
        there.commit = "def".to_owned();
        there.plan = 8;
        // Another machine may do a part of the work.
        there.cpu = "another machine".to_owned();
        assert_eq!(here.differences(&there), ["commit", "settings"]);
    }
}
