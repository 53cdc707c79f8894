//! How uncertain a learner is of its arm, as ellipsoids that move with it.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3};
use rerun::{
    AsComponents, Color, DynamicArchetype, Ellipsoids3D, FillMode, components::RotationQuat,
    external::arrow::array::Float64Array,
};

use super::{
    ellipsoid::{Axes, Ellipsoid, EllipsoidSize},
    model::origins,
    solid::{quaternion, single},
};
use crate::experiment::{JointDescription, ModelReport};

/// A learner's own covariance is drawn beside what its data allow where its standard deviations are so much larger.
const KEPT_LARGE: f64 = 1.5;

/// The ellipsoids of one learner, continuous from step to step.
pub(super) struct Uncertainty {
    size: EllipsoidSize,
    /// So many times as large those of points are drawn.
    magnified: f64,
    points: Vec<Axes>,
    allowed: Vec<Axes>,
    marker: Axes,
    directions: Vec<Axes>,
}

/// One covariance at θ = 0, and the link that carries it.
#[derive(Clone, Debug)]
pub(super) struct Cloud {
    centre: Point3<f64>,
    /// So many joints are before it.
    link: usize,
    label: String,
    covariance: Matrix3<f64>,
    ellipsoid: Ellipsoid,
}

impl Cloud {
    fn new(
        centre: [f64; 3],
        link: usize,
        name: &str,
        rows: &[[f64; 3]; 3],
        axes: &mut Axes,
        (size, scale): (EllipsoidSize, f64),
    ) -> Option<Self> {
        let ellipsoid = axes.ellipsoid(rows, size, scale)?;
        let covariance = Matrix3::from_fn(|row, column| rows[row][column]);
        Some(Self { centre: centre.into(), link, label: format!("{name} ({})", size.label()), covariance, ellipsoid })
    }

    /// Where it is when the links are there.
    fn at(&self, links: &[Isometry3<f64>]) -> (Point3<f64>, RotationQuat) {
        let link = links.get(self.link).copied().unwrap_or_default();
        (link * self.centre, quaternion(&(link.rotation * self.ellipsoid.rotation)).into())
    }
}

impl Uncertainty {
    /// For an arm of so many joints.
    pub(super) fn new(joints: usize, size: EllipsoidSize) -> Self {
        let axes = vec![Axes::default(); joints];
        Self {
            size,
            magnified: 1.0,
            points: axes.clone(),
            allowed: axes.clone(),
            marker: Axes::default(),
            directions: axes,
        }
    }

    /// The same with the points' ellipsoids so many times as large.
    pub(super) fn magnified(self, times: f64) -> Self {
        Self { magnified: times, ..self }
    }

    /// The points on the axes, then the marker. `None` if the learner keeps no covariance of any.
    pub(super) fn of_points(&mut self, model: &ModelReport, joints: &[JointDescription]) -> Option<Vec<Cloud>> {
        let mut any = false;
        let points = (model.joints.iter().zip(&mut self.points).zip(joints).enumerate()).filter_map(
            |(link, ((joint, axes), description))| {
                let (point, covariance) = (joint.point_m?, joint.point_covariance_m2?);
                any = true;
                Cloud::new(point, link, &description.name, &covariance, axes, (self.size, self.magnified))
            },
        );
        let mut clouds: Vec<Cloud> = points.collect();
        if let Some(covariance) = model.marker_covariance_m2 {
            any = true;
            let axes = &mut self.marker;
            clouds.extend(Cloud::new(
                model.marker_m,
                joints.len(),
                "marker",
                &covariance,
                axes,
                (self.size, self.magnified),
            ));
        }
        any.then_some(clouds)
    }

    /// What data allow of the points whose own covariance is kept larger. `None` where that is not known.
    pub(super) fn of_allowed(&mut self, model: &ModelReport, joints: &[JointDescription]) -> Option<Vec<Cloud>> {
        let mut any = false;
        let trace = |rows: &[[f64; 3]; 3]| (0..3).map(|i| rows[i][i]).sum::<f64>();
        let points = (model.joints.iter().zip(&mut self.allowed).zip(joints).enumerate()).filter_map(
            |(link, ((joint, axes), description))| {
                let (point, own, allowed) =
                    (joint.point_m?, joint.point_covariance_m2?, joint.allowed_point_covariance_m2?);
                any = true;
                let name = format!("{}, what data allow", description.name);
                let cloud = Cloud::new(point, link, &name, &allowed, axes, (self.size, 1.0))?;
                (trace(&own) > KEPT_LARGE.powi(2) * trace(&allowed)).then_some(cloud)
            },
        );
        let clouds = points.collect();
        any.then_some(clouds)
    }

    /// The directions, at the tips of arrows `length_m` long at θ = 0. `None` if the learner keeps no covariance of any.
    pub(super) fn of_directions(
        &mut self,
        model: &ModelReport,
        joints: &[JointDescription],
        length_m: f64,
    ) -> Option<Vec<Cloud>> {
        let mut any = false;
        let origins = origins(model);
        let tips = (model.joints.iter().zip(origins).zip(&mut self.directions).zip(joints)).filter_map(
            |(((joint, origin), axes), description)| {
                let tip = std::array::from_fn(|i| origin[i] + length_m * joint.axis[i]);
                let covariance = joint.direction_covariance_rad2?;
                any = true;
                Cloud::new(tip, 0, &description.name, &covariance, axes, (self.size, length_m))
            },
        );
        let clouds = tips.collect();
        any.then_some(clouds)
    }
}

/// Ellipsoids, and the covariances they are drawn from.
pub(super) struct Drawn {
    ellipsoids: Ellipsoids3D,
    covariances: DynamicArchetype,
}

impl Drawn {
    /// Clouds where the links carry them, in a colour with an opacity.
    pub(super) fn new(clouds: &[Cloud], links: &[Isometry3<f64>], [red, green, blue]: [u8; 3], alpha: u8) -> Self {
        let poses: Vec<_> = clouds.iter().map(|cloud| cloud.at(links)).collect();
        let turned = clouds.iter().map(|cloud| {
            let turn = links.get(cloud.link).copied().unwrap_or_default().rotation.to_rotation_matrix();
            turn.matrix() * cloud.covariance * turn.matrix().transpose()
        });
        // Symmetric: by columns it is the same as by rows.
        let numbers: Vec<f64> = turned.flat_map(|matrix| matrix.iter().copied().collect::<Vec<_>>()).collect();
        Self {
            ellipsoids: Ellipsoids3D::from_centers_and_half_sizes(
                poses.iter().map(|(centre, _)| single(centre.coords.into())),
                clouds.iter().map(|cloud| single(cloud.ellipsoid.half_sizes)),
            )
            .with_quaternions(poses.iter().map(|(_, turn)| *turn))
            .with_colors([Color::from_unmultiplied_rgba(red, green, blue, alpha)])
            .with_fill_mode(FillMode::Solid)
            .with_labels(clouds.iter().map(|cloud| cloud.label.clone()))
            .with_show_labels(false),
            covariances: DynamicArchetype::new_without_archetype()
                .with_component_from_data("covariances", Arc::new(Float64Array::from_iter_values(numbers))),
        }
    }

    /// Both parts, to be logged in one row.
    pub(super) fn parts(&self) -> [&dyn AsComponents; 2] {
        [&self.ellipsoids, &self.covariances]
    }
}

/// The same clouds on an arm that moves: their poses alone.
pub(super) fn carried(clouds: &[Cloud], links: &[Isometry3<f64>]) -> Ellipsoids3D {
    let poses: Vec<_> = clouds.iter().map(|cloud| cloud.at(links)).collect();
    Ellipsoids3D::update_fields()
        .with_centers(poses.iter().map(|(centre, _)| single(centre.coords.into())))
        .with_quaternions(poses.iter().map(|(_, turn)| *turn))
}
