//! What a posture violates, said so that a person can mend it.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

/// Why a posture is not feasible. Lengths are in metres, positions in rad or m as the kind of the joint says.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Violation {
    /// Outside the limits that a constraint sets a joint.
    #[error(
        "joint `{joint}` would be at {position:.4}, outside its constrained limits {lower:.4} and {upper:.4} (rad or m)"
    )]
    Limits {
        /// The joint.
        joint: String,
        /// Where it would be.
        position: f64,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
    },
    /// Further than one movement may go.
    #[error(
        "joint `{joint}` would move by {by:.4}, more than the greatest travel of {greatest:.4} (rad or m) in one movement"
    )]
    Travel {
        /// The joint.
        joint: String,
        /// How far it would move.
        by: f64,
        /// How far it may.
        greatest: f64,
    },
    /// No member of the list of what is allowed.
    #[error("it is not in the list of allowed postures")]
    NotAllowed,
    /// In the neighbourhood of a posture that was vetoed.
    #[error("it lies next to a posture that the robot has refused")]
    Vetoed,
    /// Too low.
    #[error("`{part}` would be at a height of {height:.4} m, below the least of {least:.4} m")]
    Height {
        /// The link origin or target.
        part: String,
        /// How high it would be.
        height: f64,
        /// How high it must be.
        least: f64,
    },
    /// Inside a forbidden box.
    #[error("`{part}` would be inside the box `{obstacle}`")]
    Inside {
        /// The link origin or target.
        part: String,
        /// The box.
        obstacle: String,
    },
    /// A link crosses a forbidden box.
    #[error("the link to `{part}` would cross the box `{obstacle}`")]
    Crosses {
        /// The link origin or target that the link leads to.
        part: String,
        /// The box.
        obstacle: String,
    },
    /// Two links too near to one another.
    #[error(
        "{} and {} would be {distance:.3} m apart, nearer than the clearance of {least:.3} m between links",
        parts[0],
        parts[1]
    )]
    Near {
        /// What people call the two.
        parts: [String; 2],
        /// How far they would be apart.
        distance: f64,
        /// How far they must be.
        least: f64,
    },
}

impl Violation {
    /// The constraint that is violated, as a scenario file names it.
    pub fn constraint(&self) -> String {
        match self {
            Self::Limits { joint, .. } => format!("the limits of `{joint}`"),
            Self::Travel { .. } => "the greatest travel".to_owned(),
            Self::NotAllowed => "the list of allowed postures".to_owned(),
            Self::Vetoed => "what the robot has refused".to_owned(),
            Self::Height { .. } => "the minimum height".to_owned(),
            Self::Near { .. } => "the clearance between links".to_owned(),
            Self::Inside { obstacle, .. } | Self::Crosses { obstacle, .. } => format!("the box `{obstacle}`"),
        }
    }
}

/// Why no posture is feasible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Infeasible {
    /// Every posture that was tried violates something.
    #[error("{0}")]
    Tried(Tally),
    /// A joint stands where one movement does not bring it back within its limits.
    #[error(
        "joint `{joint}` stands at {position:.4}, outside its constrained limits {lower:.4} and {upper:.4}, and the greatest \
         travel of {greatest:.4} (rad or m) does not bring it back"
    )]
    Stranded {
        /// The joint.
        joint: String,
        /// Where it stands.
        position: f64,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
        /// How far it may move at once.
        greatest: f64,
    },
}

/// Of postures that were tried, how many each constraint excludes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    tried: usize,
    excluded: BTreeMap<String, usize>,
    within_reach: bool,
}

impl Tally {
    /// Of nothing tried yet; `within_reach` if all that is tried is in reach of where the robot stands.
    pub(super) fn new(within_reach: bool) -> Self {
        Self { within_reach, ..Self::default() }
    }

    /// One more posture, which violates all these.
    pub(super) fn count(&mut self, violations: &[Violation]) {
        self.tried += 1;
        let names: BTreeSet<String> = violations.iter().map(Violation::constraint).collect();
        names.into_iter().for_each(|name| *self.excluded.entry(name).or_default() += 1);
    }

    /// The constraints that each exclude everything, or else none; and all that exclude anything, the one that excludes most
    /// first.
    fn culprits(&self) -> (Vec<&str>, Vec<&str>) {
        let mut all: Vec<(&str, usize)> = self.excluded.iter().map(|(name, count)| (name.as_str(), *count)).collect();
        all.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let alone = all.iter().filter(|(_, count)| *count == self.tried).map(|(name, _)| *name).collect();
        (alone, all.into_iter().map(|(name, _)| name).collect())
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reach = if self.within_reach { " within the greatest travel" } else { "" };
        match self.tried {
            1 => write!(f, "the only posture tried{reach} is excluded by ")?,
            tried => write!(f, "all {tried} postures tried{reach} are excluded by ")?,
        }
        match self.culprits() {
            (alone, _) if alone.len() > 1 => write!(f, "each of {}", alone.join(" and ")),
            (alone, _) if alone.len() == 1 => f.write_str(alone[0]),
            (_, all) => write!(f, "{} together", all.join(" and ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_excludes_everything_is_named_alone() {
        let height = || Violation::Height { part: "hand".to_owned(), height: 0.1, least: 0.2 };
        let inside = || Violation::Inside { part: "hand".to_owned(), obstacle: "pillar".to_owned() };
        let crosses = || Violation::Crosses { part: "elbow".to_owned(), obstacle: "pillar".to_owned() };
        let said = |within_reach: bool, postures: &[&[Violation]]| {
            let mut tally = Tally::new(within_reach);
            postures.iter().for_each(|violations| tally.count(violations));
            tally.to_string()
        };
        assert_eq!(
            said(false, &[&[height()], &[height()], &[inside(), crosses()]]),
            "all 3 postures tried are excluded by the minimum height and the box `pillar` together"
        );
        assert_eq!(
            said(true, &[&[height()], &[inside(), height()]]),
            "all 2 postures tried within the greatest travel are excluded by the minimum height"
        );
        assert_eq!(
            said(false, &[&[height(), inside()]]),
            "the only posture tried is excluded by each of the box `pillar` and the minimum height"
        );
    }
}
