//! What a robot has refused: postures that it cannot take, though nothing that was told excludes them.

use super::travel;
use crate::kinematics::JointBox;

/// The radius of the first veto in its neighbourhood, in sides of the unit joint box.
pub const FIRST_RADIUS: f64 = 0.02;
/// The greatest radius: a quarter of every joint's range to either side.
pub const GREATEST_RADIUS: f64 = 0.25;

/// Postures that were vetoed, each with a neighbourhood that is excluded: all that is no further from it than a radius in
/// any joint, each joint's range being 1.
///
/// The first veto of a neighbourhood has a radius of 0.02. One whose neighbourhood would meet that of an earlier one has
/// twice the greatest radius among these, up to 0.25: whoever is refused again and again nearby has met something large,
/// and leaves it in a few steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vetoes(Vec<Veto>);

#[derive(Clone, Debug, PartialEq)]
struct Veto {
    /// In the unit cube of the joint box.
    centre: Vec<f64>,
    radius: f64,
}

impl Vetoes {
    /// Excludes the neighbourhood of a posture (rad or m per joint). Tells its radius.
    pub fn add(&mut self, limits: &JointBox, posture: &[f64]) -> f64 {
        let centre = limits.to_unit(posture);
        let near = self.0.iter().filter(|veto| travel(&veto.centre, &centre) <= veto.radius + FIRST_RADIUS);
        let radius = near.map(|veto| 2.0 * veto.radius).fold(FIRST_RADIUS, f64::max).min(GREATEST_RADIUS);
        self.0.push(Veto { centre, radius });
        radius
    }

    /// Whether a posture lies in the neighbourhood of one that was vetoed.
    pub fn exclude(&self, limits: &JointBox, posture: &[f64]) -> bool {
        if self.0.is_empty() {
            return false;
        }
        let point = limits.to_unit(posture);
        self.0.iter().any(|veto| travel(&veto.centre, &point) <= veto.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_neighbourhood_doubles_where_it_is_refused_again() {
        let limits = JointBox::new(vec![(-1.0, 1.0), (0.0, 0.5)]).expect("limits");
        let mut vetoes = Vetoes::default();
        assert!(!vetoes.exclude(&limits, &[0.0, 0.25]));
        assert_eq!(vetoes.add(&limits, &[0.0, 0.25]), 0.02);
        // Of ranges of 2 rad and 0.5 m.
        assert!(vetoes.exclude(&limits, &[0.039, 0.259]) && !vetoes.exclude(&limits, &[0.041, 0.25]));
        assert!(!vetoes.exclude(&limits, &[0.0, 0.261]));
        assert_eq!(vetoes.add(&limits, &[0.05, 0.25]), 0.04, "next to the first");
        assert_eq!(vetoes.add(&limits, &[0.9, 0.25]), 0.02, "far from both");
        let radii: Vec<f64> = (0..5).map(|_| vetoes.add(&limits, &[0.05, 0.25])).collect();
        assert_eq!(radii, [0.08, 0.16, 0.25, 0.25, 0.25], "up to a bound");
    }
}
