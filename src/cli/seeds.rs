//! Seeds as written on the command line.

use std::{ops::RangeInclusive, str::FromStr};

/// `20` for the seeds 1 to 20, or `101..120` for a range with both ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seeds(RangeInclusive<u64>);

impl Seeds {
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

/// The most seeds; more are a slip of the finger.
pub const MOST: u64 = 100_000;

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| {
            part.trim_start_matches('=').parse::<u64>().map_err(|_| format!("`{part}` is not a whole number"))
        };
        let (first, last) = match text.split_once("..") {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (1, number(text)?),
        };
        if first > last {
            return Err(match text.split_once("..") {
                Some(_) => format!("the range is empty; write {last}..{first}"),
                None => "there must be at least one seed".to_owned(),
            });
        }
        let seeds = Self(first..=last);
        if seeds.count() > MOST { Err(format!("at most {MOST} seeds in one go")) } else { Ok(seeds) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_starts_at_one_and_a_range_has_both_ends() {
        let seeds = |text: &str| text.parse::<Seeds>().map(|seeds| seeds.iter().collect::<Vec<_>>());
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("101..103"), Ok(vec![101, 102, 103]));
        assert_eq!(seeds("7..7"), Ok(vec![7]));
        assert!(seeds("0").is_err() && seeds("5..1").is_err() && seeds("x").is_err() && seeds("1..").is_err());
        assert!(seeds("0..18446744073709551615").is_err());
    }
}
