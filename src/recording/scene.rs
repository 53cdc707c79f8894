//! Where the arm stands in a view.

/// The place and size of an arm, for cameras and arrows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scene {
    /// Between the base of the arm and its middle.
    pub(super) centre_m: [f64; 3],
    /// Diagonal of the box around the arm.
    pub(super) size_m: f64,
}

impl Default for Scene {
    fn default() -> Self {
        Self { centre_m: [0.0; 3], size_m: 1.0 }
    }
}

impl Scene {
    /// Around the points of an arm, its base first.
    pub(super) fn around(points_m: &[[f64; 3]]) -> Self {
        let finite = || points_m.iter().filter(|point| point.iter().all(|x| x.is_finite()));
        let bound = |axis: usize, start: f64, pick: fn(f64, f64) -> f64| finite().map(|p| p[axis]).fold(start, pick);
        if finite().next().is_none() {
            return Self::default();
        }
        let lower: [f64; 3] = std::array::from_fn(|axis| bound(axis, f64::INFINITY, f64::min));
        let upper: [f64; 3] = std::array::from_fn(|axis| bound(axis, f64::NEG_INFINITY, f64::max));
        let size_m = (0..3).map(|axis| (upper[axis] - lower[axis]).powi(2)).sum::<f64>().sqrt();
        // It swings about its base, which comes first.
        let base = finite().next().copied().unwrap_or_default();
        let centre_m = std::array::from_fn(|axis| 0.5 * base[axis] + 0.25 * (lower[axis] + upper[axis]));
        // An arm of one joint may be a single point.
        Self { centre_m, size_m: if size_m > 1e-3 { size_m } else { 1.0 } }
    }
}
