//! Which of many machines' parts a file holds.

use std::fmt;
use std::str::FromStr;

use chiaro::Shard;

/// Some of the parts that a reference was cut into, written `1, 3 of 4`; three or more in a row as `1-3`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shards {
    /// In increasing order, from 1.
    pub numbers: Vec<u32>,
    pub of: u32,
}

impl Shards {
    /// What stands in a file that is no part.
    pub const WHOLE: &str = "whole";

    /// Those of both.
    pub fn add(&mut self, other: &Self) {
        self.numbers.extend(&other.numbers);
        self.numbers.sort_unstable();
    }

    /// Whether nothing is missing.
    pub fn are_all(&self) -> bool {
        self.numbers.len() == self.of as usize
    }
}

impl From<Shard> for Shards {
    fn from(shard: Shard) -> Self {
        Self { numbers: vec![shard.number], of: shard.of }
    }
}

impl fmt::Display for Shards {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, run) in self.numbers.chunk_by(|a, b| a + 1 == *b).enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            match run {
                [one] => write!(f, "{comma}{one}")?,
                [first, last] => write!(f, "{comma}{first}, {last}")?,
                [first, .., last] => write!(f, "{comma}{first}-{last}")?,
                [] => {}
            }
        }
        write!(f, " of {}", self.of)
    }
}

impl FromStr for Shards {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (listed, of) = text.split_once(" of ").ok_or(())?;
        let of = of.parse().map_err(drop)?;
        let mut numbers = Vec::new();
        for run in listed.split(", ") {
            let (first, last) = run.split_once('-').unwrap_or((run, run));
            let (first, last): (u32, u32) = (first.parse().map_err(drop)?, last.parse().map_err(drop)?);
            let increases = first <= last && last <= of && first > numbers.last().copied().unwrap_or(0);
            numbers.extend(if increases { first..=last } else { return Err(()) });
        }
        Ok(Self { numbers, of })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read_as_they_are_written() {
        for text in ["2 of 3", "1, 3 of 4", "1, 2, 4 of 4", "1-3, 5, 7-9 of 12", "1 of 1"] {
            assert_eq!(text.parse::<Shards>().map(|shards| shards.to_string()), Ok(text.to_owned()));
        }
        for wrong in [
            "whole",
            "",
            "0 of 3",
            "4 of 3",
            "2, 1 of 3",
            "1, 1 of 3",
            "3-1 of 3",
            "1-9999999999 of 3",
            "a of b",
        ] {
            assert!(wrong.parse::<Shards>().is_err(), "{wrong}");
        }
        let mut shards: Shards = "1, 3 of 4".parse().unwrap();
        shards.add(&"2, 4 of 4".parse().unwrap());
        assert!(shards.are_all() && shards.to_string() == "1-4 of 4");
    }
}
