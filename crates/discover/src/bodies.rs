//! Which markers are on one body, and the body's pose by three or more of them.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::{
    data::{Data, Reading, Row, Target},
    median::median,
};

/// The spread of the distance of two markers, as a share of how far they move, below which they are on one body.
const RIGID: f64 = 0.04;
/// Three markers within this share of their greatest extent of a line have no rotation about it.
const FLAT: f64 = 0.15;

/// The targets of every body: poses are bodies of their own, markers belong together whose distances do not change.
pub fn bodies(data: &Data) -> Vec<Vec<usize>> {
    let mut bodies: Vec<Vec<usize>> = Vec::new();
    for (target, held) in data.targets.iter().enumerate() {
        let is_with = |body: &&mut Vec<usize>| {
            !held.is_pose && body.iter().all(|other| !data.targets[*other].is_pose && is_rigid(data, target, *other))
        };
        match bodies.iter_mut().find(is_with) {
            Some(body) => body.push(target),
            None => bodies.push(vec![target]),
        }
    }
    bodies
}

fn is_rigid(data: &Data, one: usize, other: usize) -> bool {
    let pairs: Vec<(Point3<f64>, Point3<f64>)> =
        data.rows.iter().filter_map(|row| Some((row.readings[one]?.point(), row.readings[other]?.point()))).collect();
    if pairs.len() < 3 {
        return false;
    }
    let distances: Vec<f64> = pairs.iter().map(|(one, other)| (one - other).norm()).collect();
    let middle = median(distances.clone());
    let spread = median(distances.iter().map(|distance| (distance - middle).abs()).collect());
    let (ones, others): (Vec<Point3<f64>>, Vec<Point3<f64>>) = pairs.into_iter().unzip();
    spread <= RIGID * scatter(&ones).min(scatter(&others))
}

/// The median distance of points from their middle, m.
pub(crate) fn scatter(points: &[Point3<f64>]) -> f64 {
    let axis = |axis: usize| median(points.iter().map(|point| point[axis]).collect());
    let middle = Point3::new(axis(0), axis(1), axis(2));
    median(points.iter().map(|point| (point - middle).norm()).collect())
}

/// The same rows with the body's pose in place of its targets: measured, or by the best rigid motion of three or more markers (Arun,
/// Huang and Blostein 1987). `None` where its rotation is not measured.
pub(crate) fn posed(data: &Data) -> Option<Data> {
    let target = |name: &str| Target { name: name.to_owned(), is_pose: true };
    if let [only] = data.targets.as_slice() {
        return only.is_pose.then(|| data.clone());
    }
    let whole = |row: &Row| -> Option<Vec<Vector3<f64>>> {
        row.readings.iter().map(|reading| Some(reading.as_ref()?.point().coords)).collect()
    };
    if data.targets.len() < 3 {
        return None;
    }
    // The shape of the body: the row whose distances are nearest to their medians, so that no outlier makes it.
    let shapes: Vec<Vec<Vector3<f64>>> = data.rows.iter().filter_map(whole).collect();
    let side = |shape: &[Vector3<f64>], at: usize| (shape[at % shape.len()] - shape[(at + 1) % shape.len()]).norm();
    let count = data.targets.len();
    let sides: Vec<f64> = (0..count).map(|at| median(shapes.iter().map(|shape| side(shape, at)).collect())).collect();
    let off = |shape: &Vec<Vector3<f64>>| (0..count).map(|at| (side(shape, at) - sides[at]).abs()).sum::<f64>();
    let shape = shapes.iter().min_by(|one, other| off(one).total_cmp(&off(other)))?;
    let centre = shape.iter().sum::<Vector3<f64>>() / count as f64;
    let local: Vec<Vector3<f64>> = shape.iter().map(|point| point - centre).collect();
    let scatter: Matrix3<f64> = local.iter().map(|point| point * point.transpose()).sum();
    let mut extents = scatter.symmetric_eigenvalues().as_slice().to_vec();
    extents.sort_by(|one, other| other.total_cmp(one));
    if extents[1].max(0.0).sqrt() < FLAT * extents[0].max(0.0).sqrt() {
        return None;
    }
    let pose = |row: &Row| -> Option<Reading> {
        let points = whole(row)?;
        let middle = points.iter().sum::<Vector3<f64>>() / count as f64;
        let moved: Matrix3<f64> =
            points.iter().zip(&local).map(|(point, local)| (point - middle) * local.transpose()).sum();
        let svd = moved.svd(true, true);
        let (u, v) = (svd.u?, svd.v_t?.transpose());
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v.transpose()).determinant().signum()));
        // The least singular value is the last: nalgebra sorts them.
        let rotation = Rotation3::from_matrix_unchecked(u * mirror * v.transpose());
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Some(Reading::Pose(Isometry3::from_parts(middle.into(), rotation)))
    };
    let rows = data.rows.iter().map(|row| Row { readings: vec![pose(row)], ..row.clone() }).collect();
    Some(Data { columns: data.columns.clone(), targets: vec![target("body")], rows })
}
