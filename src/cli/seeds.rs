//! Seeds as written on the command line. What a number alone means, the option's name says: `--seeds 20` asks for 20 runs, those of the
//! seeds 1 to 20, and `--seed 20` for that of seed 20.

use std::ops::RangeInclusive;

/// Seeds that follow each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seeds(RangeInclusive<u64>);

/// More seeds than this are a slip of the finger.
pub const MOST: u64 = 100_000;

impl Seeds {
    /// What `--seeds` says: `20` for the seeds 1 to 20, or `101..120`.
    pub fn counted(text: &str) -> Result<Self, String> {
        let seeds = Self::parse(text)?;
        if seeds.count() > MOST { Err(format!("at most {MOST} seeds in one go")) } else { Ok(seeds) }
    }

    fn parse(text: &str) -> Result<Self, String> {
        let number = |part: &str| {
            part.trim_start_matches('=').parse::<u64>().map_err(|_| format!("`{part}` is not a whole number"))
        };
        let Some((first, last)) = text.split_once("..") else {
            let seeds = 1..=number(text)?;
            return if seeds.is_empty() { Err("there must be at least one seed".to_owned()) } else { Ok(Self(seeds)) };
        };
        let (first, last) = (number(first)?, number(last)?);
        if first > last { Err(format!("the range is empty; write {last}..{first}")) } else { Ok(Self(first..=last)) }
    }

    /// The seeds in order.
    pub fn iter(&self) -> impl Iterator<Item = u64> + use<> {
        self.0.clone()
    }

    /// The first and the last.
    pub fn ends(&self) -> [u64; 2] {
        [*self.0.start(), *self.0.end()]
    }

    /// The number of seeds.
    pub fn count(&self) -> u64 {
        (self.0.end() - self.0.start()).saturating_add(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_starts_at_one_and_a_range_has_both_ends() {
        let seeds = |text: &str| Seeds::counted(text).map(|seeds| seeds.iter().collect::<Vec<_>>());
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("101..103"), Ok(vec![101, 102, 103]));
        assert_eq!(seeds("7..7"), Ok(vec![7]));
        for text in ["0", "5..1", "x", "1..", "0..18446744073709551615"] {
            assert!(seeds(text).is_err(), "{text}");
        }
    }
}
