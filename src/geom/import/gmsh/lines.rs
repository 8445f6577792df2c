//! Lines of a text file with their numbers, and the words of a line as numbers.

use super::super::error::ImportFault;
use std::str::{FromStr, SplitWhitespace};

/// The lines that are left of a file.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

/// One line, without blanks at its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    /// Its number, from 1.
    pub number: usize,
    /// What it says; never empty.
    pub text: &'a str,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            number: 0,
        }
    }

    /// The next line, whatever is in it.
    fn next_raw(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let (line, rest) = match end {
            Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
            None => (self.rest, &self.rest[self.rest.len()..]),
        };
        self.rest = rest;
        Some(line)
    }

    /// The next line that is neither blank nor a comment; `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<Line<'a>>, ImportFault> {
        while let Some(bytes) = self.next_raw() {
            let number = self.number;
            let Ok(text) = std::str::from_utf8(bytes) else {
                return Err(ImportFault::malformed(
                    format!("line {number}"),
                    "bytes that are no text, as in a binary file",
                ));
            };
            let text = text.trim();
            if !(text.is_empty() || text.starts_with('#') || text.starts_with("//")) {
                return Ok(Some(Line { number, text }));
            }
        }
        Ok(None)
    }

    /// The next line of the section `$name`, which is not at its end yet.
    pub fn within(&mut self, name: &str) -> Result<Line<'a>, ImportFault> {
        let line = self.next()?.ok_or_else(|| self.cut_short(name))?;
        if line.text.starts_with('$') {
            return Err(line.fault(format!(
                "`{}` where ${name} has more to say: a count is wrong, or lines are missing",
                shortened(line.text)
            )));
        }
        Ok(line)
    }

    /// Takes the end of the section `$name`.
    pub fn close(&mut self, name: &str) -> Result<(), ImportFault> {
        let line = self.next()?.ok_or_else(|| self.cut_short(name))?;
        if ends(line.text.as_bytes(), name) {
            return Ok(());
        }
        Err(line.fault(format!(
            "`{}` where ${name} should end: its count is too small, or a line is too much",
            shortened(line.text)
        )))
    }

    /// Passes over the section `$name`.
    pub fn skip(&mut self, name: &str) -> Result<(), ImportFault> {
        while let Some(bytes) = self.next_raw() {
            if ends(bytes.trim_ascii(), name) {
                return Ok(());
            }
        }
        Err(self.cut_short(name))
    }

    /// Refuses a `count` of lines that what is left of the file cannot hold.
    pub fn check_count(
        &self,
        line: &Line<'_>,
        count: usize,
        what: &str,
    ) -> Result<(), ImportFault> {
        // The shortest line is a digit and its end.
        if count <= self.rest.len() / 2 + 1 {
            return Ok(());
        }
        Err(line.fault(format!(
            "{count} {what} are announced and {} bytes follow: the count is wrong or the file is \
             cut short",
            self.rest.len()
        )))
    }

    fn cut_short(&self, name: &str) -> ImportFault {
        ImportFault::malformed(
            format!("line {}", self.number),
            format!("the file ends within ${}: it is cut short", shortened(name)),
        )
    }
}

/// Whether `line` ends the section `$name`; format 1 shouts.
fn ends(line: &[u8], name: &str) -> bool {
    line.get(..4)
        .is_some_and(|head| head.eq_ignore_ascii_case(b"$End"))
        && line[4..].eq_ignore_ascii_case(name.as_bytes())
}

/// `text`, or its beginning.
pub(super) fn shortened(text: &str) -> String {
    const CHARS_MAX: usize = 40;
    match text.char_indices().nth(CHARS_MAX) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

impl<'a> Line<'a> {
    /// What is wrong in this line.
    pub fn fault(&self, problem: impl Into<String>) -> ImportFault {
        ImportFault::malformed(format!("line {}", self.number), problem)
    }

    /// The words of the line.
    pub fn words(&self) -> Words<'a> {
        Words {
            line: *self,
            words: self.text.split_whitespace(),
        }
    }
}

/// What is left of a line.
pub(super) struct Words<'a> {
    line: Line<'a>,
    words: SplitWhitespace<'a>,
}

impl<'a> Words<'a> {
    /// The next word.
    pub fn next(&mut self, what: &str) -> Result<&'a str, ImportFault> {
        let word = self.words.next();
        word.ok_or_else(|| self.line.fault(format!("{what} is missing")))
    }

    /// The next word as a number from 0.
    pub fn whole(&mut self, what: &str) -> Result<u64, ImportFault> {
        self.parsed(what, "number from 0")
    }

    /// The next word as a count of things in memory.
    pub fn count(&mut self, what: &str) -> Result<usize, ImportFault> {
        self.parsed(what, "count")
    }

    /// The next word as a finite number that f32 can square and cube.
    pub fn coordinate(&mut self, what: &str) -> Result<f64, ImportFault> {
        let value: f64 = self.parsed(what, "number")?;
        if value.abs() <= f64::from(super::super::part::COORDINATE_MAX) {
            return Ok(value);
        }
        Err(self.line.fault(format!(
            "{what} is {value}, which is not a number within ±{:e}",
            super::super::part::COORDINATE_MAX
        )))
    }

    fn parsed<T: FromStr>(&mut self, what: &str, kind: &str) -> Result<T, ImportFault> {
        let word = self.next(what)?;
        word.parse().map_err(|_| {
            let word = shortened(word);
            self.line
                .fault(format!("{what} is `{word}`, which is no {kind}"))
        })
    }

    /// All words that are left, which number `N`, as numbers from 0.
    pub fn rest<const N: usize>(mut self, what: &str) -> Result<[u64; N], ImportFault> {
        let mut numbers = [0; N];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = self.whole(&format!("corner {} of {what}", k + 1))?;
        }
        match self.words.count() {
            0 => Ok(numbers),
            more => Err(self.line.fault(format!(
                "{what} has {} corners and should have {N}",
                N + more
            ))),
        }
    }
}
