//! Covariances as ellipsoids.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// The size of the ellipsoids of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub enum EllipsoidSize {
    /// One standard deviation along each principal axis.
    #[default]
    #[serde(rename = "1-sigma")]
    OneSigma,
    /// Two standard deviations along each principal axis.
    #[serde(rename = "2-sigma")]
    TwoSigma,
    /// The ellipsoid that holds 95 % of the normal distribution.
    #[serde(rename = "95-percent")]
    NinetyFivePercent,
}

impl EllipsoidSize {
    /// All sizes, the smallest first.
    pub const ALL: [Self; 3] = [Self::OneSigma, Self::TwoSigma, Self::NinetyFivePercent];

    /// The name of the size in requests and among a command's options, as `1-sigma`.
    pub fn name(self) -> &'static str {
        match self {
            Self::OneSigma => "1-sigma",
            Self::TwoSigma => "2-sigma",
            Self::NinetyFivePercent => "95-percent",
        }
    }

    /// Half-sizes in standard deviations, for a covariance of this rank (1 to 3).
    ///
    /// 95 % of a normal distribution in k dimensions lie within √χ²ₖ,₀.₉₅ standard deviations: 1.960, 2.448 and 2.795.
    pub fn sigmas(self, rank: usize) -> f64 {
        // Quantiles of χ² at 0.95 with 1, 2 and 3 degrees of freedom.
        const CHI_SQUARED_95: [f64; 3] = [3.841_458_820_694_124, 5.991_464_547_107_979, 7.814_727_903_251_179];
        match self {
            Self::OneSigma => 1.0,
            Self::TwoSigma => 2.0,
            Self::NinetyFivePercent => CHI_SQUARED_95[rank.clamp(1, 3) - 1].sqrt(),
        }
    }

    /// The size as text for labels and notes.
    pub fn label(self) -> &'static str {
        match self {
            Self::OneSigma => "1σ",
            Self::TwoSigma => "2σ",
            Self::NinetyFivePercent => "95 %",
        }
    }
}

/// The thickness of a direction without variance, as a part of the largest half-size: a disc that can be seen edge-on.
const FLATNESS: f64 = 0.02;

/// The part of the largest eigenvalue below which one counts as zero: what rounding leaves of a rank-2 covariance.
const NO_VARIANCE: f64 = 1e-9;

/// The ellipsoid drawn for a covariance.
#[derive(Clone, Debug)]
pub(super) struct Ellipsoid {
    /// Multiples of the standard deviations along the axes, largest first at the first step.
    pub(super) half_sizes: [f64; 3],
    /// The rotation of x, y, z onto the axes.
    pub(super) rotation: UnitQuaternion<f64>,
}

/// The axes that an ellipsoid had at the last step. Eigenvalues change their order and eigenvectors their signs, so an
/// ellipsoid would otherwise flip between steps that hardly differ.
#[derive(Clone, Debug, Default)]
pub(super) struct Axes(Option<Matrix3<f64>>);

impl Axes {
    /// The ellipsoid of a covariance whose half-sizes are multiplied by `scale`; `None` if it is not finite.
    pub(super) fn ellipsoid(
        &mut self,
        covariance: &[[f64; 3]; 3],
        size: EllipsoidSize,
        scale: f64,
    ) -> Option<Ellipsoid> {
        let matrix = Matrix3::from_fn(|row, column| 0.5 * (covariance[row][column] + covariance[column][row]));
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::try_new(matrix, f64::EPSILON, 100)?;
        let (order, axes) = self.in_order(&eigen);
        self.0 = Some(axes);
        let variances = order.map(|index| eigen.eigenvalues[index].max(0.0));
        let largest = variances.iter().copied().fold(0.0, f64::max);
        let rank = variances.iter().filter(|variance| **variance > NO_VARIANCE * largest).count();
        let sigmas = size.sigmas(rank);
        let half_sizes = variances.map(|variance| {
            let shown = if variance > NO_VARIANCE * largest { variance.sqrt() } else { FLATNESS * largest.sqrt() };
            sigmas * scale * shown
        });
        Some(Ellipsoid {
            half_sizes,
            rotation: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
        })
    }

    /// The order of the eigenvectors, and the right-handed frame of them, that is closest to the last one.
    fn in_order(&self, eigen: &SymmetricEigen<f64, nalgebra::Const<3>>) -> ([usize; 3], Matrix3<f64>) {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let vectors = &eigen.eigenvectors;
        let order = match &self.0 {
            Some(last) => {
                let closeness = |order: &[usize; 3]| -> f64 {
                    (0..3).map(|i| last.column(i).dot(&vectors.column(order[i])).abs()).sum()
                };
                ORDERS.into_iter().max_by(|a, b| closeness(a).total_cmp(&closeness(b))).unwrap_or(ORDERS[0])
            }
            None => {
                let mut order = ORDERS[0];
                order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
                order
            }
        };
        let mut axes = Matrix3::from_fn(|row, column| vectors[(row, order[column])]);
        let last = self.0.unwrap_or(axes);
        let closeness = |axes: &Matrix3<f64>, i: usize| last.column(i).dot(&axes.column(i));
        for i in 0..3 {
            if closeness(&axes, i) < 0.0 {
                axes.column_mut(i).neg_mut();
            }
        }
        if axes.determinant() < 0.0 {
            // An ellipsoid does not mind; turn the axis that says least about the last frame.
            let least = (0..3).min_by(|&i, &j| closeness(&axes, i).total_cmp(&closeness(&axes, j))).unwrap_or(2);
            axes.column_mut(least).neg_mut();
        }
        (order, axes)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, Vector3};

    use super::{EllipsoidSize::OneSigma, *};

    /// A size is called the same in requests and among options.
    #[test]
    fn names_are_those_of_requests() {
        for size in EllipsoidSize::ALL {
            assert_eq!(serde_json::to_value(size).expect("JSON"), size.name());
        }
    }

    fn rows(matrix: Matrix3<f64>) -> [[f64; 3]; 3] {
        matrix.transpose().into()
    }

    fn turned(variances: [f64; 3], angle: f64) -> [[f64; 3]; 3] {
        let turn = Rotation3::new(Vector3::new(0.3, -0.5, 0.7) * angle).into_inner();
        rows(turn * Matrix3::from_diagonal(&variances.into()) * turn.transpose())
    }

    #[test]
    fn is_the_covariance_again() {
        let covariance = turned([0.04, 0.01, 0.0025], 1.0);
        let ellipsoid = Axes::default().ellipsoid(&covariance, OneSigma, 1.0).unwrap();
        let axes = ellipsoid.rotation.to_rotation_matrix().into_inner();
        let variances = Vector3::from(ellipsoid.half_sizes).map(|half| half.powi(2));
        let again = axes * Matrix3::from_diagonal(&variances) * axes.transpose();
        assert!((again - Matrix3::from_fn(|i, j| covariance[i][j])).amax() < 1e-12);
        assert!((ellipsoid.half_sizes[0] - 0.2).abs() < 1e-12);
    }

    #[test]
    fn rank_two_is_a_disc() {
        let ellipsoid = Axes::default().ellipsoid(&turned([0.04, 0.01, 0.0], 2.0), OneSigma, 0.5).unwrap();
        let [a, b, c] = ellipsoid.half_sizes;
        assert!((a - 0.1).abs() < 1e-9 && (b - 0.05).abs() < 1e-9 && (c - 0.002).abs() < 1e-9);
    }

    #[test]
    fn does_not_flip_when_eigenvalues_cross() {
        let mut axes = Axes::default();
        let mut last: Option<UnitQuaternion<f64>> = None;
        for step in 0..200 {
            // At no step two are equal: a circle has no axes.
            let t = f64::from(step) / 199.0;
            let ellipsoid =
                axes.ellipsoid(&turned([0.04, 0.01 + 0.06 * t, 0.03 - 0.02 * t], 2.0 * t), OneSigma, 1.0).unwrap();
            if let Some(last) = last {
                assert!(ellipsoid.rotation.angle_to(&last) < 0.05, "step {step}");
            }
            assert!((ellipsoid.rotation.norm() - 1.0).abs() < 1e-9);
            last = Some(ellipsoid.rotation);
        }
    }

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        assert!(Axes::default().ellipsoid(&[[f64::NAN; 3]; 3], OneSigma, 1.0).is_none());
        assert_eq!(Axes::default().ellipsoid(&[[0.0; 3]; 3], OneSigma, 1.0).unwrap().half_sizes, [0.0; 3]);
    }

    #[test]
    fn ninety_five_percent_lie_within() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for (rank, variances) in [(1, [0.3, 0.0, 0.0]), (2, [0.3, 0.1, 0.0]), (3, [0.3, 0.1, 0.05])] {
            let ellipsoid =
                Axes::default().ellipsoid(&turned(variances, 0.8), EllipsoidSize::NinetyFivePercent, 1.0).unwrap();
            let within = (0..20_000)
                .filter(|_| {
                    // A sample along each principal axis.
                    let along = |i: usize, rng: &mut rand_chacha::ChaCha8Rng| {
                        if i < rank {
                            rng.sample::<f64, _>(rand_distr::StandardNormal) * variances[i].sqrt()
                        } else {
                            0.0
                        }
                    };
                    (0..3).map(|i| (along(i, &mut rng) / ellipsoid.half_sizes[i]).powi(2)).sum::<f64>() <= 1.0
                })
                .count();
            assert!((within as f64 / 20_000.0 - 0.95).abs() < 0.01, "rank {rank}: {within} of 20000");
        }
    }
}
