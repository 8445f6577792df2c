//! A part of a study: every Nth cell.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Part `index` of `of`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Shard {
    index: usize,
    of: usize,
}

impl Shard {
    /// The cells of this part: dealt in turn, so that costly neighbours go to different parts.
    pub fn deal<T>(self, cells: Vec<T>) -> Vec<T> {
        let first = self.index - 1;
        cells.into_iter().skip(first).step_by(self.of).collect()
    }

    /// The part that has cell `cell` (from 0) of a study in `of` parts.
    pub fn holding(cell: usize, of: usize) -> Self {
        Self {
            index: cell % of + 1,
            of,
        }
    }

    /// How many parts there are.
    pub fn of(self) -> usize {
        self.of
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            Some((0, of)) if of > 0 => Err(format!(
                "parts are counted from 1: the first of {of} is 1/{of} and the last {of}/{of}"
            )),
            _ => {
                Err("write I/N with I from 1 to N, such as 2/8 for the second of eight".to_owned())
            }
        }
    }
}

impl Serialize for Shard {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Shard {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_together_hold_every_cell_once(cells in 0_usize..40, of in 1_usize..9) {
            let mut all = Vec::new();
            for index in 1..=of {
                let shard: Shard = format!("{index}/{of}").parse().unwrap();
                for cell in shard.deal((0..cells).collect()) {
                    prop_assert_eq!(Shard::holding(cell, of), shard);
                    all.push(cell);
                }
            }
            all.sort_unstable();
            prop_assert_eq!(all, (0..cells).collect::<Vec<_>>());
        }
    }

    #[test]
    fn parts_that_do_not_exist_are_refused_with_a_remedy() {
        for (text, word) in [
            ("0/4", "1/4"),
            ("5/4", "from 1 to N"),
            ("2", "I/N"),
            ("1/0", "I/N"),
        ] {
            let refusal = text.parse::<Shard>().unwrap_err();
            assert!(refusal.contains(word), "{text}: {refusal}");
        }
    }
}
