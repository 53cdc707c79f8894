//! Many bounded local searches side by side, where gradients are to be had.
//!
//! Each takes the steps of [`polish`](super::polish()),
//!
//! ```text
//! x ← clamp(x − t B g, 0, 1)
//! ```
//!
//! −B g told by `quasi_newton.rs` likewise, but with t from backtracking (Armijo 1966), and all that still descend ask for their
//! next values together, so that an objective can evaluate them side by side.

use nalgebra::{DMatrix, DVector};

use super::{
    Polish,
    quasi_newton::{Aim, aim, lengthened, updated},
};

/// Values of a batch of points, and the gradient of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slopes {
    /// One a point; one that is not finite marks an infeasible point.
    pub values: Vec<f64>,
    /// Derivatives by the coordinates of the cube, n for each point.
    pub gradients: Vec<f64>,
}

/// Of what a step promises to first order, how much it must keep.
const KEPT: f64 = 1e-4;
/// The shortest fraction of a step that is tried: of Newton's, and of the steepest, whose length knows nothing of the valley.
const SHORTEST: [f64; 2] = [1e-4, 1e-9];
/// The least of a step that is kept when it is drawn back, of either.
const LEAST: [f64; 2] = [0.1, 1e-4];

/// The minima over the unit cube that descents from `starts` reach, with their values, in the same order. `evaluate` is asked
/// for batches of points, at most one for each start. No result is worse than its start.
pub fn descend(
    starts: Vec<Vec<f64>>,
    settings: Polish,
    mut evaluate: impl FnMut(&[Vec<f64>]) -> Slopes,
) -> Vec<(Vec<f64>, f64)> {
    let mut descents: Vec<Descent> = starts.into_iter().map(Descent::new).collect();
    let mut going: Vec<usize> = (0..descents.len()).collect();
    while !going.is_empty() {
        let trials: Vec<Vec<f64>> = going.iter().map(|index| descents[*index].trial.as_slice().to_vec()).collect();
        let Slopes { values, gradients } = evaluate(&trials);
        let mut found = values.iter().zip(gradients.chunks_exact(trials[0].len().max(1)));
        going.retain(|index| {
            found.next().is_some_and(|(value, gradient)| descents[*index].go_on(*value, gradient, settings))
        });
    }
    descents.into_iter().map(|descent| (descent.x.as_slice().to_vec(), descent.value)).collect()
}

/// One of them.
struct Descent {
    x: DVector<f64>,
    /// Infinite until it is known.
    value: f64,
    gradient: DVector<f64>,
    /// 1 for coordinates that are not pressed against a bound.
    free: DVector<f64>,
    inverse_hessian: Option<DMatrix<f64>>,
    direction: DVector<f64>,
    /// Whether that is Newton's, or the steepest.
    is_newton: bool,
    length: f64,
    /// What is asked for next.
    trial: DVector<f64>,
    steps: usize,
    /// Steps in a row that gained next to nothing.
    idle: usize,
}

impl Descent {
    fn new(start: Vec<f64>) -> Self {
        let x = DVector::from_vec(start).map(|x| x.clamp(0.0, 1.0));
        let nothing = DVector::zeros(x.len());
        Self {
            trial: x.clone(),
            x,
            value: f64::INFINITY,
            gradient: nothing.clone(),
            free: nothing.clone(),
            inverse_hessian: None,
            direction: nothing,
            is_newton: false,
            length: 1.0,
            steps: 0,
            idle: 0,
        }
    }

    /// Takes what was found at the trial; whether there is another.
    fn go_on(&mut self, value: f64, gradient: &[f64], settings: Polish) -> bool {
        if self.value == f64::INFINITY {
            (self.value, self.gradient) = (value, DVector::from_column_slice(gradient));
            return value.is_finite() && settings.steps > 0 && self.aim();
        }
        let moved = &self.trial - &self.x;
        let promised = self.gradient.dot(&moved);
        if !(promised < 0.0 && value <= self.value + KEPT * promised) {
            return self.draw_back(value, promised, settings);
        }
        let gained = self.value - value;
        let gradient = DVector::from_column_slice(gradient);
        // Coordinates that were held tell nothing of the curvature along the others.
        let change = (&gradient - &self.gradient).component_mul(&self.free);
        let before = self.inverse_hessian.take();
        let is_valley = moved.dot(&change) > 0.0;
        self.inverse_hessian =
            if is_valley { updated(before, &moved, &change) } else { lengthened(before, &moved, &gradient) };
        (self.value, self.gradient) = (value, gradient);
        self.x.copy_from(&self.trial);
        self.steps += 1;
        // One step may gain little because B is poor yet.
        let is_idle = gained <= settings.tolerance * value.abs() && self.is_newton;
        self.idle = if is_idle { self.idle + 1 } else { 0 };
        self.idle < 2 && self.steps < settings.steps && self.aim()
    }

    /// A shorter step; once more along the gradient before giving up.
    fn draw_back(&mut self, value: f64, promised: f64, settings: Polish) -> bool {
        let drawn = self.length;
        let kind = usize::from(!self.is_newton);
        // Where a parabola through what is known is least; what is infeasible tells nothing of it.
        let least = -0.5 * promised / (value - self.value - promised);
        self.length *= if value.is_finite() && least.is_finite() { least.clamp(LEAST[kind], 0.5) } else { 0.25 };
        // Not where even the slope promises less than would count.
        let is_worth_it = -promised * self.length / drawn > settings.tolerance * self.value.abs();
        if is_worth_it && self.length >= SHORTEST[kind] {
            self.ask();
            return true;
        }
        self.is_newton && {
            self.inverse_hessian = None;
            self.aim()
        }
    }

    /// Where to go from here; `false` if nothing is lower nearby.
    fn aim(&mut self) -> bool {
        let aim = aim(self.x.as_slice(), &self.gradient, self.inverse_hessian.as_ref());
        let Some(Aim { direction, free, is_newton }) = aim else { return false };
        (self.direction, self.free, self.is_newton) = (direction, free, is_newton);
        self.length = 1.0;
        self.ask();
        true
    }

    fn ask(&mut self) {
        self.trial = (&self.x + &self.direction * self.length).map(|x| x.clamp(0.0, 1.0));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SETTINGS: Polish = Polish { steps: 200, tolerance: 1e-14 };

    proptest! {
        /// Quadratics over the cube, convex in one half of the cases: at the result the gradient points outwards wherever a
        /// bound is met, and vanishes elsewhere; others that descend beside it change nothing.
        #[test]
        fn end_at_stationary_points_of_the_cube(
            centre in prop::collection::vec(-0.5..1.5_f64, 4),
            starts in prop::collection::vec(prop::collection::vec(0.0..1.0_f64, 4), 1..5),
            last in -2.0..2.0_f64,
        ) {
            let weights = [1.0, 2.0, 3.0, last];
            let slopes = |x: &[f64]| {
                let d: Vec<f64> = x.iter().zip(&centre).map(|(x, c)| x - c).collect();
                let value: f64 = d.iter().zip(weights).map(|(d, w)| w * d * d).sum();
                let mut gradient: Vec<f64> = d.iter().zip(weights).map(|(d, w)| 2.0 * w * d).collect();
                gradient[0] += 0.5 * d[1];
                gradient[1] += 0.5 * d[0];
                (value + 0.5 * d[0] * d[1], gradient)
            };
            let batch = |points: &[Vec<f64>]| {
                let (values, gradients): (Vec<f64>, Vec<Vec<f64>>) = points.iter().map(|x| slopes(x)).unzip();
                Slopes { values, gradients: gradients.concat() }
            };
            let found = descend(starts.clone(), SETTINGS, batch);
            for (start, (x, value)) in starts.iter().zip(&found) {
                prop_assert!(*value <= slopes(start).0 && *value == slopes(x).0);
                prop_assert!(x.iter().all(|x| (0.0..=1.0).contains(x)));
                for (x, slope) in x.iter().zip(slopes(x).1) {
                    let pressed = (*x <= 0.0 && slope >= 0.0) || (*x >= 1.0 && slope <= 0.0);
                    prop_assert!(pressed || slope.abs() < 1e-5, "{x} {slope}");
                }
                prop_assert_eq!(&descend(vec![start.clone()], SETTINGS, batch)[0], &(x.clone(), *value));
            }
        }
    }

    #[test]
    fn nobody_leaves_what_is_feasible() {
        let evaluate = |points: &[Vec<f64>]| Slopes {
            values: points.iter().map(|x| if x[0] > 0.7 { f64::NAN } else { -x[0] }).collect(),
            gradients: vec![-1.0; points.len()],
        };
        let found = descend(vec![vec![0.2], vec![0.9]], SETTINGS, evaluate);
        assert!((0.69..=0.7).contains(&found[0].0[0]), "{found:?}");
        assert!(found[1].0 == [0.9] && found[1].1.is_nan());
        assert!(descend(Vec::new(), SETTINGS, |_| unreachable!("nobody asks")).is_empty());
    }
}
