//! Seeds as written on the command line. A range has both ends everywhere; what a number alone means, the option's name says:
//! `--seeds 20` asks for 20 runs, those of the seeds 1 to 20, and `--seed 20` for that of seed 20.

use std::ops::RangeInclusive;

/// Seeds that follow each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seeds(RangeInclusive<u64>);

/// More seeds than this are a slip of the finger.
pub const MOST: u64 = 100_000;
/// More runs than this make a folder that nobody downloads.
const MOST_OF_A_PAGE: u64 = 200;
/// Browsers read greater numbers as others.
const GREATEST_OF_A_PAGE: u64 = (1 << 53) - 1;

impl Seeds {
    /// What `--seeds` says: `20` for the seeds 1 to 20, or `101..120`.
    pub fn counted(text: &str) -> Result<Self, String> {
        Self::parse(text, |count| 1..=count)?.at_most(MOST)
    }

    /// What the `--seed` of an exported page says: `20` for that seed, or `1..5`.
    pub fn named(text: &str) -> Result<Self, String> {
        let seeds = Self::parse(text, |seed| seed..=seed)?;
        if *seeds.0.end() > GREATEST_OF_A_PAGE {
            return Err(format!("a page takes seeds up to {GREATEST_OF_A_PAGE}"));
        }
        seeds.at_most(MOST_OF_A_PAGE)
    }

    fn parse(text: &str, alone: impl Fn(u64) -> RangeInclusive<u64>) -> Result<Self, String> {
        let number = |part: &str| {
            part.trim_start_matches('=').parse::<u64>().map_err(|_| format!("`{part}` is not a whole number"))
        };
        let Some((first, last)) = text.split_once("..") else {
            let seeds = alone(number(text)?);
            return if seeds.is_empty() { Err("there must be at least one seed".to_owned()) } else { Ok(Self(seeds)) };
        };
        let (first, last) = (number(first)?, number(last)?);
        if first > last { Err(format!("the range is empty; write {last}..{first}")) } else { Ok(Self(first..=last)) }
    }

    fn at_most(self, most: u64) -> Result<Self, String> {
        if self.count() > most { Err(format!("at most {most} seeds in one go")) } else { Ok(self) }
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

    fn all(seeds: Result<Seeds, String>) -> Result<Vec<u64>, String> {
        seeds.map(|seeds| seeds.iter().collect())
    }

    #[test]
    fn a_count_starts_at_one_and_a_range_has_both_ends() {
        let seeds = |text: &str| all(Seeds::counted(text));
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("101..103"), Ok(vec![101, 102, 103]));
        assert_eq!(seeds("7..7"), Ok(vec![7]));
        for text in ["0", "5..1", "x", "1..", "0..18446744073709551615"] {
            assert!(seeds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_name_is_one_seed_and_a_range_has_both_ends() {
        let seeds = |text: &str| all(Seeds::named(text));
        assert_eq!((seeds("7"), seeds("0"), seeds("3..3")), (Ok(vec![7]), Ok(vec![0]), Ok(vec![3])));
        assert_eq!(seeds("1..5"), Ok(vec![1, 2, 3, 4, 5]));
        for text in ["", "x", "-1", "5..1", "1..", "1..1000", "0..18446744073709551615", "9007199254740992"] {
            assert!(seeds(text).is_err(), "{text}");
        }
    }
}
