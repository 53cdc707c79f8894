//! Gradients by differences, for a [`descend`](super::descend) where there are no others.

use super::Slopes;

/// How derivatives are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Differences {
    /// Between both sides of a point: two values for each coordinate, an error that goes with the square of the distance.
    Central,
    /// Between a point and one neighbour: one value for each coordinate, an error that goes with the distance. For values that are dear.
    OneSided,
}

/// How far from a point its neighbours are, in sides of the cube.
const DIFFERENCE: f64 = 1e-4;

impl Differences {
    /// The values of points of the unit cube, and the gradients of those that count, in the same order. `evaluate` returns the
    /// values of a batch of points; one that is not finite marks an infeasible point. At the bounds differences are one-sided; a
    /// derivative is 0 where every neighbour is infeasible.
    pub fn slopes(
        self,
        points: &[Vec<f64>],
        counts: &dyn Fn(usize, f64) -> bool,
        mut evaluate: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    ) -> Slopes {
        let values = evaluate(points);
        let mut gradients = Vec::with_capacity(points.iter().map(Vec::len).sum());
        for (index, (x, value)) in points.iter().zip(&values).enumerate() {
            match counts(index, *value) {
                true => gradients.extend(self.gradient(x, *value, &mut evaluate)),
                false => gradients.extend(std::iter::repeat_n(0.0, x.len())),
            }
        }
        Slopes { values, gradients }
    }

    fn gradient(self, x: &[f64], value: f64, evaluate: &mut impl FnMut(&[Vec<f64>]) -> Vec<f64>) -> Vec<f64> {
        let moved = |k: usize, step: f64| {
            let mut moved = x.to_vec();
            moved[k] = (moved[k] + step).clamp(0.0, 1.0);
            moved
        };
        if self == Self::OneSided {
            // Towards the middle of the cube, where there is room.
            let step = |k: usize| if x[k] < 0.5 { DIFFERENCE } else { -DIFFERENCE };
            let values = evaluate(&(0..x.len()).map(|k| moved(k, step(k))).collect::<Vec<Vec<f64>>>());
            let slope = |k: usize| Some((values.get(k)? - value) / step(k)).filter(|slope| slope.is_finite());
            return (0..x.len()).map(|k| slope(k).unwrap_or(0.0)).collect();
        }
        let neighbours: Vec<Vec<f64>> =
            (0..x.len()).flat_map(|k| [DIFFERENCE, -DIFFERENCE].map(|step| moved(k, step))).collect();
        let values = evaluate(&neighbours);
        let slope = |k: usize| {
            let side = |index: usize| {
                let (distance, value) = (neighbours.get(index)?[k] - x[k], *values.get(index)?);
                value.is_finite().then_some((distance, value))
            };
            let (above, below) = (side(2 * k).unwrap_or((0.0, value)), side(2 * k + 1).unwrap_or((0.0, value)));
            let distance = above.0 - below.0;
            if distance > 0.0 { (above.1 - below.1) / distance } else { 0.0 }
        };
        (0..x.len()).map(slope).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::optimize::{Polish, descend};

    const SETTINGS: Polish = Polish { steps: 200, tolerance: 1e-14 };

    fn polish(start: &[f64], how: Differences, mut f: impl FnMut(&[f64]) -> f64) -> (Vec<f64>, f64) {
        let mut values = |points: &[Vec<f64>]| points.iter().map(|x| f(x)).collect();
        descend(vec![start.to_vec()], SETTINGS, |points, counts| how.slopes(points, counts, &mut values)).remove(0)
    }

    proptest! {
        /// A convex quadratic over the cube: at the result the gradient points outwards wherever a bound is met, and
        /// vanishes elsewhere.
        #[test]
        fn end_at_a_stationary_point_of_the_cube(
            centre in prop::collection::vec(-0.5..1.5_f64, 4),
            start in prop::collection::vec(0.0..1.0_f64, 4),
        ) {
            let f = |x: &[f64]| -> f64 {
                let d: Vec<f64> = x.iter().zip(&centre).map(|(x, c)| x - c).collect();
                d.iter().enumerate().map(|(k, d)| (1.0 + k as f64) * d * d).sum::<f64>() + 0.5 * d[0] * d[1]
            };
            let (x, value) = polish(&start, Differences::Central, f);
            prop_assert!(value <= f(&start));
            prop_assert!(x.iter().all(|x| (0.0..=1.0).contains(x)));
            for k in 0..4 {
                let moved = |step: f64| {
                    let mut moved = x.clone();
                    moved[k] = (moved[k] + step).clamp(0.0, 1.0);
                    f(&moved)
                };
                prop_assert!(moved(1e-3) >= value - 1e-9 && moved(-1e-3) >= value - 1e-9, "{x:?} {k}");
            }
            // Differences to one side end where that is off by half a step.
            let (_, rougher) = polish(&start, Differences::OneSided, f);
            prop_assert!(rougher <= value + 1e-6, "{rougher} {value}");
        }
    }

    #[test]
    fn reach_a_corner_that_direct_cannot() {
        for how in [Differences::Central, Differences::OneSided] {
            assert_eq!(polish(&[0.5, 0.3, 0.9], how, |x| x.iter().sum()), (vec![0.0; 3], 0.0));
        }
    }

    #[test]
    fn a_cliff_too_steep_for_a_gradient_sends_nobody_to_nowhere() {
        let mut asked = Vec::new();
        let cliff = |x: &[f64]| {
            asked.extend(x.iter().copied());
            if x[0] > 0.5 { 1e308 } else { -1e308 }
        };
        assert_eq!(polish(&[0.5, 0.2], Differences::Central, cliff), (vec![0.5, 0.2], -1e308));
        assert!(asked.iter().all(|x| (0.0..=1.0).contains(x)), "{asked:?}");
    }

    #[test]
    fn an_infeasible_start_stays_where_it_is() {
        let (x, value) = polish(&[0.5], Differences::OneSided, |_| f64::NAN);
        assert!(x == [0.5] && value.is_nan());
    }
}
