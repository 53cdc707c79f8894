//! Jumps: the ways in which a body may change at once.
//!
//! A changed body is `x' = x ⊕ B η`, `η ~ N(0, Q)`: B (m × p) spans the tangent directions that change together.
//!
//! | jump | p | columns of B |
//! |---|---|---|
//! | one block | its dimension | its coordinates: one axis bent, a marker knocked, a camera moved |
//! | an axis in place | that of its direction, or of its point | these: one axis turned, or one shifted |
//! | a joint mounted anew | that of its axis, and 6 | its axis, and a rigid motion of all that is behind it |
//! | the whole body | m | all |
//!
//! Q comes from the *original* prior, however often the body has changed: its covariance, with half its deviations; besides with
//! several times as large ones where the prior is so narrow that a collision would exceed it, and with a quarter of these where it
//! is wide. A change that is as large as Q says is noticed sooner than one for which Q is far too wide (Occam's factor).

use nalgebra::{Cholesky, DMatrix, Dyn, Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::{
    elementary::ln,
    kinematics::Joint,
    model::{Block, Layout, Quantity, State},
};

/// A way in which a body may change.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    /// B (m × p).
    pub directions: DMatrix<f64>,
    /// Q (p × p).
    pub covariance: DMatrix<f64>,
    /// Q⁻¹.
    pub information: DMatrix<f64>,
    /// ln det Q.
    pub log_determinant: f64,
    /// The logarithm of its share among all ways to change.
    pub log_share: f64,
    /// Whether this jump may be taken for the change once it is being learned. To notice a change, a small jump or one of
    /// few coordinates may be the most telling; the other coordinates may have changed as well, and need room.
    pub has_room: bool,
}

/// The variance of what changes, in variances of the original prior.
const VARIANCE: f64 = 0.25;
/// The sizes of a change that are tried, in such deviations: smaller ones where the prior is wide, larger ones where it
/// is narrow.
const SIZES: [f64; 5] = [0.25, 1.0, 4.0, 16.0, 64.0];
/// The deviations of an angle (rad) and of a length (m) beyond which no larger change is tried, and below which no smaller
/// one.
const WIDEST: f64 = 0.5;
const NARROWEST: f64 = 0.05;
/// The share of changes that change the body as a whole.
const WHOLE: f64 = 0.2;

/// ln det A, from the Cholesky root of A.
pub(super) fn log_determinant(root: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * root.l_dirty().diagonal().map(ln).sum()
}

/// All jumps from `state`; `prior` is the original prior's covariance in the chart there.
pub(super) fn jumps(state: &State, layout: &Layout, prior: &DMatrix<f64>) -> Vec<Jump> {
    let m = layout.dimension();
    let mut spaces: Vec<(DMatrix<f64>, DMatrix<f64>, bool)> = Vec::new();
    let identity = DMatrix::<f64>::identity(m, m);
    let of_block = |range: &std::ops::Range<usize>| {
        let (start, size) = (range.start, range.len());
        (identity.columns(start, size).into_owned(), prior.view((start, start), (size, size)) * VARIANCE)
    };
    for (block, range) in layout.blocks() {
        let (directions, covariance) = of_block(&range);
        if let Block::Axis(joint) = block
            && let Some(behind) = motions_behind(state, layout, joint)
        {
            let size = range.len();
            let mut both = DMatrix::zeros(m, size + 6);
            both.columns_mut(0, size).copy_from(&directions);
            both.columns_mut(size, 6).copy_from(&behind);
            let [length, angle] = typical(layout, prior);
            let mut spread = DMatrix::zeros(size + 6, size + 6);
            spread.view_mut((0, 0), (size, size)).copy_from(&covariance);
            for k in 0..6 {
                spread[(size + k, size + k)] = VARIANCE * if k < 3 { length } else { angle };
            }
            spaces.push((both, spread, true));
        }
        if matches!(block, Block::Axis(_)) {
            for quantity in [Quantity::Angle, Quantity::Length] {
                let part: Vec<usize> = range.clone().filter(|k| layout.quantities()[*k] == quantity).collect();
                if !part.is_empty() && part.len() < range.len() {
                    let inner: Vec<usize> = part.iter().map(|k| k - range.start).collect();
                    let covariance = covariance.select_columns(&inner).select_rows(&inner);
                    spaces.push((identity.select_columns(&part), covariance, false));
                }
            }
        }
        spaces.push((directions, covariance, true));
    }
    let share = ln((1.0 - WHOLE) / spaces.len().max(1) as f64);
    let mut jumps: Vec<Jump> = Vec::new();
    let mut offer = |directions: &DMatrix<f64>, covariance: &DMatrix<f64>, log_share: f64, is_whole: bool| {
        for factor in SIZES {
            let widened = covariance * (factor * factor);
            let widest = widened.diagonal().iter().fold(0.0_f64, |most, x| most.max(x.sqrt()));
            if (factor > 1.0 && widest >= WIDEST) || (factor < 1.0 && widest < NARROWEST) {
                continue;
            }
            // What cannot change is no jump.
            let Some(root) = Cholesky::new(widened.clone()) else { continue };
            jumps.push(Jump {
                directions: directions.clone(),
                covariance: widened,
                information: root.inverse(),
                log_determinant: log_determinant(&root),
                log_share,
                has_room: is_whole && factor >= 1.0,
            });
        }
    };
    for (directions, covariance, is_whole) in &spaces {
        offer(directions, covariance, share, *is_whole);
    }
    offer(&identity, &(prior * VARIANCE), ln(WHOLE), true);
    jumps
}

/// The prior's mean variance of lengths (m²) and of angles (rad²) of axes.
fn typical(layout: &Layout, prior: &DMatrix<f64>) -> [f64; 2] {
    [Quantity::Length, Quantity::Angle].map(|wanted| {
        let of_axes = layout.blocks().filter(|(block, _)| matches!(block, Block::Axis(_))).flat_map(|(_, range)| range);
        let variances: Vec<f64> =
            of_axes.filter(|k| layout.quantities()[*k] == wanted).map(|k| prior[(k, k)]).collect();
        variances.iter().sum::<f64>() / variances.len().max(1) as f64
    })
}

/// How learned coordinates change (m × 6) when all that is behind a joint shifts along and turns about the three coordinate axes
/// at its place; `None` where nothing behind it is learned.
fn motions_behind(state: &State, layout: &Layout, joint: usize) -> Option<DMatrix<f64>> {
    let at = match state.joints[joint] {
        Joint::Revolute(line) => line.point.coords,
        Joint::Prismatic(_) => Vector3::zeros(),
    };
    let columns = state.slopes_along(layout, 6, |k, step| {
        let unit = Vector3::ith(k % 3, step);
        let motion = if k < 3 {
            Isometry3::from_parts(Translation3::from(unit), UnitQuaternion::identity())
        } else {
            let rotation = UnitQuaternion::from_scaled_axis(unit);
            Isometry3::from_parts(Translation3::from(at - rotation * at), rotation)
        };
        state.carried(&motion, |link| state.tree.moves(joint, link))
    })?;
    (columns.amax() > 0.0).then_some(columns)
}
