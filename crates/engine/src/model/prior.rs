//! What is known of a robot before any measurement.
//!
//! Some blocks are known to lie around a guess, with a joint covariance P₀ of their tangent coordinates; others are only
//! known to lie anywhere within bounds. The prior must hold everywhere, also for a line turned by more than 90 deg from
//! the guess, where the chart at the guess ends. So it is written in the [displacements](super::Displacement) r of the
//! blocks, which do not end:
//!
//! ```text
//! cost = ½ rᵀ P₀⁻¹ r
//! ```
//!
//! Near the guess this is the Gaussian of covariance P₀ in tangent coordinates. For a line whose point and direction have
//! one standard deviation each it is `‖(I − wwᵀ)(v − v₀)‖² / 2σₚ² + ∠(w, w₀)² / 2σd²`, wherever the line is.
//!
//! A block that may be anywhere within ±b of the origin has directions and rotations uniform on their spheres: they cost
//! nothing, and their information enters the covariance only, as the reciprocal of the variance per coordinate of such a
//! draw in the chart at its own mean: π²/4 − 1 rad² for a direction, (π²/3 + 2)/3 rad² for a rotation. Points cost what a
//! Gaussian of standard deviation b/√3 does, that of a coordinate uniform within ±b.

use std::{f64::consts::PI, ops::Range};

use nalgebra::{
    Cholesky, DMatrix, DVector, Isometry3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, UnitVector3,
    Vector3,
};
use rand::{Rng, RngExt};

use super::{
    Block, Element, Layout, Quantity, State,
    element::{line_displaced, line_displacement},
};
use crate::{
    elementary::{cos, sin},
    kinematics::{Joint, Line, chart},
    normal::StandardNormal,
};

/// What is known of the learned blocks of a state before any measurement.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Prior {
    guess: State,
    blocks: Vec<(Block, Range<usize>, Knowledge)>,
    /// P₀; for blocks that may be anywhere, the variance of a uniform draw, on the diagonal.
    #[serde(with = "crate::as_numbers")]
    covariance: DMatrix<f64>,
    /// P₀⁻¹ of the blocks around the guess; zero for the others.
    #[serde(with = "crate::as_numbers")]
    information: DMatrix<f64>,
    /// L with L Lᵀ = P₀.
    #[serde(with = "crate::as_numbers")]
    root: DMatrix<f64>,
    /// Pairs of blocks around the guess, by their places, that share information; lines alone excluded.
    coupled: Vec<(usize, usize)>,
    /// By block: the information of a line whose errors are independent of those of every other block.
    #[serde(with = "crate::as_numbers")]
    lines: Vec<Option<Matrix4<f64>>>,
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
enum Knowledge {
    Around,
    /// Anywhere within ± this many metres.
    Anywhere(f64),
}

/// Why there is no such prior.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PriorError {
    /// The covariance is not symmetric and positive, or not of the layout's dimension.
    #[error("the prior covariance of {0} parameters is not symmetric and positive")]
    NotPositive(usize),
    /// Numbers have no bounds within which they could be anywhere.
    #[error("{0:?} cannot be anywhere within bounds: only axes, points and poses can")]
    Unbounded(Block),
}

/// The variance of each coordinate of a direction uniform on the sphere, E θ²/2 with θ its angle to the pole.
const UNIFORM_DIRECTION: f64 = PI * PI / 4.0 - 1.0;
/// The variance of each coordinate of a uniform rotation, E φ²/3 with φ its angle.
const UNIFORM_ROTATION: f64 = (PI * PI / 3.0 + 2.0) / 3.0;

/// The derivative and the slope of a block's displacement.
type Slopes = (DMatrix<f64>, DMatrix<f64>);

/// A cost's second and first derivatives: information (m × m) and negative gradient −∂cost/∂δ.
pub type Derivatives<'a> = (&'a mut DMatrix<f64>, &'a mut DVector<f64>);

impl Prior {
    /// A prior around `guess` with the covariance P₀ (m × m) of its tangent coordinates.
    ///
    /// # Errors
    ///
    /// [`PriorError::NotPositive`] if the covariance is not m × m, symmetric and positive definite.
    pub fn around(guess: State, layout: &Layout, covariance: DMatrix<f64>) -> Result<Self, PriorError> {
        Self::new(guess, layout, covariance, |_| None)
    }

    /// A prior around `guess` with independent standard deviations, one per tangent coordinate.
    ///
    /// # Errors
    ///
    /// [`PriorError::NotPositive`] if there are not m deviations, or a square of one is not positive.
    pub fn with_deviations(guess: State, layout: &Layout, deviations: &DVector<f64>) -> Result<Self, PriorError> {
        Self::around(guess, layout, DMatrix::from_diagonal(&deviations.map(|sd| sd * sd)))
    }

    /// A prior whose blocks lie around `guess` with this covariance (m × m), but for those to which `within` gives a
    /// bound (metres): they may be anywhere within ± that bound, and their part of guess and covariance is ignored.
    ///
    /// # Errors
    ///
    /// [`PriorError::NotPositive`] if the covariance is not m × m, symmetric and positive definite;
    /// [`PriorError::Unbounded`] if `within` bounds a block of plain numbers.
    pub fn new(
        guess: State,
        layout: &Layout,
        mut covariance: DMatrix<f64>,
        within: impl Fn(Block) -> Option<f64>,
    ) -> Result<Self, PriorError> {
        let m = layout.dimension();
        let not_positive = || PriorError::NotPositive(m);
        if covariance.shape() != (m, m) || (&covariance - covariance.transpose()).amax() > 1e-9 * covariance.amax() {
            return Err(not_positive());
        }
        let mut blocks = Vec::new();
        for (block, range) in layout.blocks() {
            let Some(bound) = within(block) else {
                blocks.push((block, range, Knowledge::Around));
                continue;
            };
            let element = block.of(&guess);
            if matches!(element, Element::Numbers(_)) {
                return Err(PriorError::Unbounded(block));
            }
            let angle = if matches!(element, Element::Pose(_)) { UNIFORM_ROTATION } else { UNIFORM_DIRECTION };
            for k in range.clone() {
                covariance.row_mut(k).fill(0.0);
                covariance.column_mut(k).fill(0.0);
                let is_angle = layout.quantities()[k] == Quantity::Angle;
                covariance[(k, k)] = if is_angle { angle } else { bound * bound / 3.0 };
            }
            blocks.push((block, range, Knowledge::Anywhere(bound)));
        }
        let cholesky = Cholesky::new(covariance.clone()).ok_or_else(not_positive)?;
        let mut information = if is_diagonal(&covariance) {
            DMatrix::from_diagonal(&covariance.diagonal().map(f64::recip))
        } else {
            cholesky.inverse()
        };
        for (_, range, _) in blocks.iter().filter(|(.., knowledge)| *knowledge != Knowledge::Around) {
            range.clone().for_each(|k| information.column_mut(k).fill(0.0));
        }
        let mut coupled = Vec::new();
        for (i, (_, rows, _)) in blocks.iter().enumerate() {
            for (j, (_, columns, _)) in blocks.iter().enumerate() {
                let shared = information.view((rows.start, columns.start), (rows.len(), columns.len()));
                if shared.iter().any(|x| *x != 0.0) {
                    coupled.push((i, j));
                }
            }
        }
        let line_alone = |(index, (block, range, knowledge)): (usize, &(Block, Range<usize>, Knowledge))| {
            let is_line = matches!(block.of(&guess), Element::Axis(Joint::Revolute(_)));
            let alone = coupled.iter().all(|(i, j)| i == j || (*i != index && *j != index));
            (is_line && alone && *knowledge == Knowledge::Around)
                .then(|| information.fixed_view::<4, 4>(range.start, range.start).into_owned())
        };
        let lines: Vec<Option<Matrix4<f64>>> = blocks.iter().enumerate().map(line_alone).collect();
        coupled.retain(|(i, _)| lines[*i].is_none());
        Ok(Self { guess, blocks, covariance, information, root: cholesky.l(), coupled, lines })
    }

    /// The same with another covariance of its blocks around the guess.
    pub(crate) fn with_covariance(&self, layout: &Layout, covariance: DMatrix<f64>) -> Result<Self, PriorError> {
        let bound = |block: Block| {
            let of = self.blocks.iter().find(|(known, ..)| *known == block);
            of.and_then(|(.., knowledge)| match knowledge {
                Knowledge::Around => None,
                Knowledge::Anywhere(bound) => Some(*bound),
            })
        };
        Self::new(self.guess.clone(), layout, covariance, bound)
    }

    /// The state to start from. Blocks that may be anywhere mean nothing in it.
    pub fn guess(&self) -> &State {
        &self.guess
    }

    /// The state to start from, to be told what its robot bears.
    pub(crate) fn guess_mut(&mut self) -> &mut State {
        &mut self.guess
    }

    /// P₀, with the variance of a draw for blocks that may be anywhere.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Whether any block may be anywhere.
    pub fn is_vague(&self) -> bool {
        self.blocks.iter().any(|(.., knowledge)| *knowledge != Knowledge::Around)
    }

    /// The points that axes are pinned to: every line is written with its point nearest to these.
    pub fn pins(&self) -> State {
        let mut pins = self.guess.clone();
        for (block, _, knowledge) in &self.blocks {
            if let (Block::Axis(joint), Knowledge::Anywhere(_)) = (block, knowledge)
                && let Joint::Revolute(line) = &mut pins.joints[*joint]
            {
                line.point = Point3::origin();
            }
        }
        pins
    }

    /// The cost of `state`, whose axes are written with their points nearest to the [pins](Self::pins). Its derivatives
    /// in the chart at `state` are added to `normal`, if wanted: the negative gradient exactly, the information by Gauss and Newton.
    pub fn cost(&self, state: &State, mut normal: Option<Derivatives<'_>>) -> f64 {
        let mut cost = 0.0;
        let (mut displaced, mut slopes) =
            (Vec::with_capacity(self.blocks.len()), Vec::with_capacity(self.blocks.len()));
        for ((block, range, knowledge), alone) in self.blocks.iter().zip(&self.lines) {
            if let (Some(information), Block::Axis(joint)) = (alone, block)
                && let (Some(guess), Some(line)) = (self.guess.joints[*joint].line(), state.joints[*joint].line())
            {
                let normal = normal.as_mut().map(|(i, d)| (&mut **i, &mut **d));
                cost += line_cost(guess, line, information, range.start, normal);
                displaced.push(None);
                slopes.push(None);
                continue;
            }
            let element = block.of(state);
            match knowledge {
                Knowledge::Around => {
                    let guess = block.of(&self.guess);
                    if normal.is_none() {
                        displaced.push(guess.displaced(&element));
                        continue;
                    }
                    let found = guess.displacement(&element);
                    let (value, of) = found.map(|of| (of.value, (of.derivative, of.slope))).unzip();
                    displaced.push(value);
                    slopes.push(of);
                }
                Knowledge::Anywhere(bound) => {
                    cost += anywhere_cost(&element, range, *bound, normal.as_mut().map(|(i, d)| (&mut **i, &mut **d)));
                    displaced.push(None);
                    slopes.push(None);
                }
            }
        }
        if self.coupled.iter().any(|(i, j)| i != j) {
            return cost + self.coupled_cost(&displaced, &slopes, normal);
        }
        for &(i, j) in &self.coupled {
            let (Some(a), Some(b)) = (&displaced[i], &displaced[j]) else { return f64::INFINITY };
            let (rows, columns) = (&self.blocks[i].1, &self.blocks[j].1);
            let shared = self.information.view((rows.start, columns.start), (rows.len(), columns.len()));
            let pull = shared * b;
            cost += 0.5 * a.dot(&pull);
            if let Some((information, negative_gradient)) = &mut normal
                && let (Some((derivative, slope)), Some((_, other))) = (&slopes[i], &slopes[j])
            {
                let mut place = information.view_mut((rows.start, columns.start), (rows.len(), columns.len()));
                place.gemm_tr(1.0, slope, &(shared * other), 1.0);
                let mut place = negative_gradient.rows_mut(rows.start, rows.len());
                place.gemv_tr(-1.0, derivative, &pull, 1.0);
            }
        }
        cost
    }

    /// What blocks cost whose errors have to do with each other, by their displacements and the derivatives of these; all at once.
    /// Of lines alone and of what may be anywhere nothing is put here.
    fn coupled_cost(
        &self,
        displaced: &[Option<DVector<f64>>],
        slopes: &[Option<Slopes>],
        normal: Option<Derivatives<'_>>,
    ) -> f64 {
        let m = self.information.nrows();
        let mut value = DVector::zeros(m);
        for ((index, (_, range, knowledge)), of) in self.blocks.iter().enumerate().zip(displaced) {
            let Some(of) = of else {
                if self.lines[index].is_some() || *knowledge != Knowledge::Around {
                    continue;
                }
                return f64::INFINITY;
            };
            value.rows_mut(range.start, range.len()).copy_from(of);
        }
        let pull = &self.information * &value;
        let cost = 0.5 * value.dot(&pull);
        let Some((information, negative_gradient)) = normal else { return cost };
        // Λ S, column by column of a block.
        let mut carried = DMatrix::zeros(m, m);
        for ((_, range, _), of) in self.blocks.iter().zip(slopes) {
            let Some((derivative, slope)) = of else { continue };
            let columns = self.information.columns(range.start, range.len());
            carried.columns_mut(range.start, range.len()).gemm(1.0, &columns, slope, 0.0);
            negative_gradient.rows_mut(range.start, range.len()).gemv_tr(
                -1.0,
                derivative,
                &pull.rows(range.start, range.len()),
                1.0,
            );
        }
        for ((_, range, _), of) in self.blocks.iter().zip(slopes) {
            let Some((_, slope)) = of else { continue };
            let rows = carried.rows(range.start, range.len());
            information.rows_mut(range.start, range.len()).gemm_tr(1.0, slope, &rows, 1.0);
        }
        cost
    }

    /// A state drawn from the prior.
    pub fn draw(&self, layout: &Layout, rng: &mut impl Rng) -> State {
        let standard = DVector::from_fn(layout.dimension(), |_, _| rng.sample::<f64, _>(StandardNormal));
        let mut drawn = self.guess.retract(layout, &(&self.root * standard));
        for (block, _, knowledge) in &self.blocks {
            if let Knowledge::Anywhere(bound) = knowledge {
                let element = anywhere(&block.of(&self.guess), *bound, rng);
                block.put(&mut drawn, element);
            }
        }
        drawn
    }
}

fn is_diagonal(matrix: &DMatrix<f64>) -> bool {
    (0..matrix.ncols()).all(|column| (0..matrix.nrows()).all(|row| row == column || matrix[(row, column)] == 0.0))
}

/// The cost of a line around a guess with this information, and its derivatives from a coordinate on.
fn line_cost(
    guess: &Line,
    line: &Line,
    information: &Matrix4<f64>,
    start: usize,
    normal: Option<Derivatives<'_>>,
) -> f64 {
    let Some((matrix, vector)) = normal else {
        let value = line_displaced(guess, line);
        return 0.5 * value.dot(&(information * value));
    };
    let (value, derivative, slope) = line_displacement(guess, line);
    let pull = information * value;
    let mut place = matrix.fixed_view_mut::<4, 4>(start, start);
    place += slope.tr_mul(&(information * slope));
    let mut place = vector.fixed_rows_mut::<4>(start);
    place -= derivative.tr_mul(&pull);
    0.5 * value.dot(&pull)
}

/// The cost of a block that may be anywhere, and its derivatives.
fn anywhere_cost(element: &Element, range: &Range<usize>, bound: f64, normal: Option<Derivatives<'_>>) -> f64 {
    let information = 3.0 / (bound * bound);
    // (coordinate, offset from the origin, how the angle after next carries it along)
    let (offsets, lever, angles): (Vec<f64>, f64, Range<usize>) = match element {
        Element::Axis(Joint::Revolute(line)) => {
            let offset = line.point.coords;
            let across = chart::basis(&line.direction).transpose() * offset;
            (across.as_slice().to_vec(), -line.direction.dot(&offset), range.start + 2..range.end)
        }
        Element::Axis(Joint::Prismatic(_)) => (Vec::new(), 0.0, range.clone()),
        Element::Point(point) => (point.coords.as_slice().to_vec(), 0.0, range.end..range.end),
        Element::Pose(pose) => (pose.translation.vector.as_slice().to_vec(), 0.0, range.start + 3..range.end),
        Element::Numbers(_) => (Vec::new(), 0.0, range.end..range.end),
    };
    if let Some((matrix, vector)) = normal {
        for (k, offset) in offsets.iter().enumerate() {
            let row = range.start + k;
            matrix[(row, row)] += information;
            vector[row] -= information * offset;
            // Turning a line about its pivot carries it past the origin.
            if lever != 0.0 {
                let column = row + 2;
                matrix[(row, column)] += information * lever;
                matrix[(column, row)] += information * lever;
                matrix[(column, column)] += information * lever * lever;
                vector[column] -= information * lever * offset;
            }
        }
        let uniform = if matches!(element, Element::Pose(_)) { UNIFORM_ROTATION } else { UNIFORM_DIRECTION };
        angles.for_each(|k| matrix[(k, k)] += uniform.recip());
    }
    0.5 * information * offsets.iter().map(|offset| offset * offset).sum::<f64>()
}

/// An element of the same kind, its directions and rotations uniform, its points uniform within ±`bound` (metres).
pub fn anywhere(element: &Element, bound: f64, rng: &mut impl Rng) -> Element {
    match element {
        Element::Axis(Joint::Revolute(_)) => {
            let direction = uniform_direction(rng);
            Element::Axis(Joint::Revolute(Line { point: uniform_point(bound, rng), direction }))
        }
        Element::Axis(Joint::Prismatic(_)) => Element::Axis(Joint::Prismatic(uniform_direction(rng))),
        Element::Point(_) => Element::Point(uniform_point(bound, rng)),
        Element::Pose(_) => {
            let translation = Translation3::from(uniform_point(bound, rng).coords);
            let numbers = nalgebra::Vector4::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let rotation = UnitQuaternion::from_quaternion(Quaternion::from_vector(numbers));
            Element::Pose(Isometry3::from_parts(translation, rotation))
        }
        Element::Numbers(numbers) => Element::Numbers(numbers.clone()),
    }
}

fn uniform_direction(rng: &mut impl Rng) -> UnitVector3<f64> {
    // Archimedes: the height of a uniform direction is uniform.
    let height: f64 = rng.random_range(-1.0..=1.0);
    let turn: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    let radius = (1.0 - height * height).max(0.0).sqrt();
    UnitVector3::new_normalize(Vector3::new(radius * cos(turn), radius * sin(turn), height))
}

fn uniform_point(bound: f64, rng: &mut impl Rng) -> Point3<f64> {
    Point3::from(Vector3::from_fn(|_, _| bound * rng.random_range(-1.0..=1.0)))
}
