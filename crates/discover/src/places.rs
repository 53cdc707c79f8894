//! Where axes are, given where they point: a linear problem.
//!
//! With all directions known, the place of a target is linear in a point v of every line, the vector s of every slide, and its home p₀:
//!
//! ```text
//! p(θ) = Σ_turns A (I − E) v + Σ_slides A q s + Aₙ p₀
//! ```
//!
//! A the rotation of the joints before. A column that slides therefore needs no guess at all: its direction comes out, and its length,
//! which is 1 where the column reads metres.

use body_schema_engine::{
    elementary::ln,
    kinematics::{Joint, Line},
};
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitVector3, Vector3};

use crate::{
    data::{Data, Reading},
    fit::deviation,
    robot::{Drive, Driven, Held, Robot},
};

/// A joint of a chain of which only the direction may be known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Piece {
    /// Turns about this direction.
    Turn(Vec<(usize, f64)>, UnitVector3<f64>),
    /// Slides along an unknown one.
    Slide(usize),
}

impl Piece {
    /// A turn by one column.
    pub(crate) fn turn(column: usize, direction: UnitVector3<f64>) -> Self {
        Self::Turn(vec![(column, 1.0)], direction)
    }

    /// The same without the part that a column has in it besides its own.
    pub(crate) fn without(&self, column: usize) -> Self {
        match self {
            Self::Turn(drives, direction) => {
                let is_kept = |(at, drive): &(usize, &(usize, f64))| *at == 0 || drive.0 != column;
                let drives = drives.iter().enumerate().filter(is_kept).map(|(_, drive)| *drive);
                Self::Turn(drives.collect(), *direction)
            }
            Self::Slide(of) => Self::Slide(*of),
        }
    }
}

/// The most by which the length of a slide's vector differs from 1 where its column is taken to read metres.
const LENGTH: f64 = 0.1;

/// The chain that explains the places best, with the evidence of the places alone; `None` where they do not suffice.
pub(crate) fn solve(data: &Data, middle: &[f64], pieces: &[Piece]) -> Option<(Robot, f64)> {
    let count = 3 * (pieces.len() + data.targets.len());
    let equations: usize = 3 * data.readings();
    if equations < count {
        return None;
    }
    let mut weights: Vec<f64> = vec![1.0; data.readings()];
    let mut answer = DVector::zeros(count);
    let mut squares = Vec::new();
    for round in 0..2 {
        let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
        let mut rows: Vec<(Vec<Matrix3<f64>>, usize, Vector3<f64>)> = Vec::new();
        for row in &data.rows {
            let mut blocks = Vec::with_capacity(pieces.len() + 1);
            let mut before = Matrix3::<f64>::identity();
            for piece in pieces {
                match piece {
                    Piece::Turn(drives, direction) => {
                        let angle = drives
                            .iter()
                            .map(|(column, ratio)| ratio * (row.positions[*column] - middle[*column]))
                            .sum();
                        let own = Rotation3::from_axis_angle(direction, angle).into_inner();
                        blocks.push(before - before * own);
                        before *= own;
                    }
                    Piece::Slide(column) => blocks.push(before * (row.positions[*column] - middle[*column])),
                }
            }
            blocks.push(before);
            let seen =
                row.readings.iter().enumerate().filter_map(|(target, reading)| Some((target, reading.as_ref()?)));
            rows.extend(seen.map(|(target, reading)| (blocks.clone(), target, reading.point().coords)));
        }
        let at = |block: usize, target: usize| 3 * if block < pieces.len() { block } else { pieces.len() + target };
        for ((blocks, target, place), weight) in rows.iter().zip(&weights) {
            for (one, block) in blocks.iter().enumerate() {
                let transposed = block.transpose() * *weight;
                let first = at(one, *target);
                let mut part = gradient.fixed_rows_mut::<3>(first);
                part += transposed * place;
                for (other, second) in blocks.iter().enumerate().skip(one) {
                    let mut part = hessian.fixed_view_mut::<3, 3>(at(other, *target), first);
                    part += (transposed * second).transpose();
                }
            }
        }
        hessian.fill_upper_triangle_with_lower_triangle();
        // Along its own axis a line's point says nothing.
        (0..count).for_each(|index| hessian[(index, index)] += 1e-6 * data.rows.len() as f64);
        answer = Cholesky::new(hessian)?.solve(&gradient);
        squares = rows
            .iter()
            .map(|(blocks, target, place)| {
                let part = |block: usize| answer.fixed_rows::<3>(at(block, *target)).into_owned();
                let found: Vector3<f64> = blocks.iter().enumerate().map(|(block, matrix)| matrix * part(block)).sum();
                (found - place).norm_squared()
            })
            .collect();
        if round == 0 {
            let sigma = deviation(&squares, 1.0).max(1e-6);
            weights = squares.iter().map(|square| (2.8 * sigma / square.sqrt().max(1e-12)).min(1.0)).collect();
        }
    }
    let part = |block: usize| answer.fixed_rows::<3>(3 * block).into_owned();
    let mut joints: Vec<Driven> = Vec::new();
    for (index, piece) in pieces.iter().enumerate() {
        let parent = index.checked_sub(1);
        let drive = |column: usize, ratio: f64, is_free: bool| Drive { column, ratio, is_free };
        joints.push(match piece {
            Piece::Turn(drives, direction) => Driven {
                drives: drives
                    .iter()
                    .enumerate()
                    .map(|(at, (column, ratio))| drive(*column, *ratio, at > 0 || *ratio != 1.0))
                    .collect(),
                parent,
                axis: Joint::Revolute(Line { point: Point3::from(part(index)), direction: *direction }),
            },
            Piece::Slide(column) => {
                let vector = part(index);
                let direction = UnitVector3::try_new(vector, 1e-9)?;
                let length = vector.norm();
                let is_free = (length - 1.0).abs() > LENGTH;
                Driven {
                    drives: vec![drive(*column, if is_free { length } else { 1.0 }, is_free)],
                    parent,
                    axis: Joint::Prismatic(direction),
                }
            }
        });
    }
    let carrier = joints.len().checked_sub(1);
    let mut robot = Robot { middle: middle.to_vec(), joints, targets: Vec::new() };
    for (target, held) in data.targets.iter().enumerate() {
        let translation = Translation3::from(part(pieces.len() + target));
        let home = Isometry3::from_parts(translation, nalgebra::UnitQuaternion::identity());
        robot.targets.push(Held { carrier, home, is_pose: held.is_pose });
    }
    set_rotations(data, &mut robot);
    let sigma = deviation(&squares, 1.0 - count as f64 / (equations as f64 + 1.0)).max(1e-6);
    let cost: f64 = squares.iter().map(|square| (square / (sigma * sigma)).min(16.0)).sum();
    let evidence = -0.5 * cost - equations as f64 * ln(sigma) - 0.5 * robot.parameters() as f64 * ln(equations as f64);
    Some((robot, evidence))
}

/// Sets the home rotations of poses: the mean of what the rows say.
fn set_rotations(data: &Data, robot: &mut Robot) {
    let mut sums = vec![Matrix3::<f64>::zeros(); robot.targets.len()];
    for row in &data.rows {
        let motions = robot.motions(&row.positions);
        for (target, reading) in row.readings.iter().enumerate() {
            if let Some(Reading::Pose(pose)) = reading {
                let motion = robot.targets[target].carrier.map_or(Isometry3::identity(), |joint| motions[joint]);
                sums[target] += Rotation3::from(motion.rotation.inverse() * pose.rotation).into_inner();
            }
        }
    }
    for (held, sum) in robot.targets.iter_mut().zip(&sums) {
        if held.is_pose && sum.norm() > 0.0 {
            let mean = Rotation3::from_matrix_eps(sum, 1e-12, 100, Rotation3::identity());
            held.home.rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&mean);
        }
    }
}
