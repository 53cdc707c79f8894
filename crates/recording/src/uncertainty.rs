//! The uncertainty of a learner about its arm, as ellipsoids that move with it.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::{
    ellipsoid::{Axes, Ellipsoid, EllipsoidSize},
    model::origins,
    rerun::{Color, ComponentDescriptor, Ellipsoids3D, FillMode, RotationQuat},
    solid::{quaternion, single},
    values::{Cell, Values},
};
use body_schema_wire::{JointDescription, ModelReport};

/// The ratio of standard deviations above which a learner's covariance is drawn beside what its data allow.
const KEPT_LARGE: f64 = 1.5;

/// The ellipsoids of one learner, continuous from step to step.
pub(super) struct Uncertainty {
    size: EllipsoidSize,
    /// The factor by which the ellipsoids of points are magnified.
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
    /// The index of its joint; the number of joints for the marker.
    part: usize,
    /// The link that carries it: 0 is the base, i what moves with the i-th joint.
    link: usize,
    covariance: Matrix3<f64>,
    ellipsoid: Ellipsoid,
}

impl Cloud {
    fn new(
        centre: [f64; 3],
        [part, link]: [usize; 2],
        rows: &[[f64; 3]; 3],
        axes: &mut Axes,
        (size, scale): (EllipsoidSize, f64),
    ) -> Option<Self> {
        let ellipsoid = axes.ellipsoid(rows, size, scale)?;
        let covariance = Matrix3::from_fn(|row, column| rows[row][column]);
        Some(Self { centre: centre.into(), part, link, covariance, ellipsoid })
    }

    /// Where its middle is when the links have these motions, and how far it reaches from there along a unit vector, metres.
    pub(super) fn reach(&self, links: &[Isometry3<f64>], way: &Vector3<f64>) -> (Point3<f64>, f64) {
        let link = links.get(self.link).copied().unwrap_or_default();
        let way = (link.rotation * self.ellipsoid.rotation).inverse() * way;
        (link * self.centre, way.component_mul(&Vector3::from(self.ellipsoid.half_sizes)).norm())
    }

    /// Its place and rotation when the links have these motions.
    fn at(&self, links: &[Isometry3<f64>]) -> (Point3<f64>, RotationQuat) {
        let link = links.get(self.link).copied().unwrap_or_default();
        (link * self.centre, quaternion(&(link.rotation * self.ellipsoid.rotation)).into())
    }
}

impl Uncertainty {
    /// The ellipsoids of an arm with `joints` joints.
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

    /// These ellipsoids with those of points magnified by `times`.
    pub(super) fn magnified(self, times: f64) -> Self {
        Self { magnified: times, ..self }
    }

    /// The ellipsoids of the points on the axes, then of the marker. `None` if the learner keeps no covariance.
    pub(super) fn of_points(&mut self, model: &ModelReport) -> Option<Vec<Cloud>> {
        let mut any = false;
        let points = model.joints.iter().zip(&mut self.points).enumerate().filter_map(|(index, (joint, axes))| {
            let (point, covariance) = (joint.point_m?, joint.point_covariance_m2?);
            any = true;
            Cloud::new(point, [index, model.link_before(index)], &covariance, axes, (self.size, self.magnified))
        });
        let mut clouds: Vec<Cloud> = points.collect();
        if let Some(covariance) = model.marker_covariance_m2 {
            any = true;
            let axes = &mut self.marker;
            let hand = [self.points.len(), model.hand_link()];
            clouds.extend(Cloud::new(model.marker_m, hand, &covariance, axes, (self.size, self.magnified)));
        }
        any.then_some(clouds)
    }

    /// The ellipsoids that data allow, for the points whose own covariance is much larger. `None` where that is not
    /// known.
    pub(super) fn of_allowed(&mut self, model: &ModelReport) -> Option<Vec<Cloud>> {
        let mut any = false;
        let trace = |rows: &[[f64; 3]; 3]| (0..3).map(|i| rows[i][i]).sum::<f64>();
        let points = model.joints.iter().zip(&mut self.allowed).enumerate().filter_map(|(index, (joint, axes))| {
            let (point, own, allowed) =
                (joint.point_m?, joint.point_covariance_m2?, joint.allowed_point_covariance_m2?);
            any = true;
            let cloud = Cloud::new(point, [index, model.link_before(index)], &allowed, axes, (self.size, 1.0))?;
            (trace(&own) > KEPT_LARGE.powi(2) * trace(&allowed)).then_some(cloud)
        });
        let clouds = points.collect();
        any.then_some(clouds)
    }

    /// The ellipsoids of directions, at the tips of arrows `length_m` long at θ = 0. `None` if the learner keeps no
    /// covariance.
    pub(super) fn of_directions(&mut self, model: &ModelReport, length_m: f64) -> Option<Vec<Cloud>> {
        let mut any = false;
        let origins = origins(model);
        let joints = model.joints.iter().zip(origins).zip(&mut self.directions).enumerate();
        let tips = joints.filter_map(|(part, ((joint, origin), axes))| {
            let tip = std::array::from_fn(|i| origin[i] + length_m * joint.axis[i]);
            let covariance = joint.direction_covariance_rad2?;
            any = true;
            Cloud::new(tip, [part, 0], &covariance, axes, (self.size, length_m))
        });
        let clouds = tips.collect();
        any.then_some(clouds)
    }

    /// The look of these ellipsoids, solid or outlined, in a colour with an opacity; `what` they are goes into their
    /// labels.
    pub(super) fn look(
        &self,
        clouds: &[Cloud],
        joints: &[JointDescription],
        (what, is_solid): (&str, bool),
        ([red, green, blue], alpha): ([u8; 3], u8),
    ) -> (u64, impl FnOnce() -> Ellipsoids3D) {
        let kind = clouds
            .iter()
            .fold(1 + u64::from(is_solid), |kind: u64, cloud| kind.wrapping_mul(31).wrapping_add(cloud.part as u64));
        let label = move |cloud: &Cloud| {
            let name = joints.get(cloud.part).map_or("marker", |joint| joint.name.as_str());
            format!("{name}{what} ({})", self.size.label())
        };
        let look = move || {
            Ellipsoids3D::update_fields()
                .with_colors([Color::from_unmultiplied_rgba(red, green, blue, alpha)])
                .with_fill_mode(if is_solid { FillMode::Solid } else { FillMode::MajorWireframe })
                .with_labels(clouds.iter().map(label))
                .with_show_labels(false)
        };
        (kind, look)
    }
}

/// The ellipsoids where the links carry them, with the covariances that they show.
pub(super) fn drawn(clouds: &[Cloud], links: &[Isometry3<f64>]) -> Vec<Cell> {
    let poses = clouds.iter().map(|cloud| cloud.at(links));
    let (centres, turns) = poses.map(|(centre, turn)| (single(centre.coords.into()), turn.0.0)).unzip();
    let half_sizes = clouds.iter().map(|cloud| single(cloud.ellipsoid.half_sizes)).collect();
    let turned = clouds.iter().map(|cloud| {
        let turn = links.get(cloud.link).copied().unwrap_or_default().rotation.to_rotation_matrix();
        turn.matrix() * cloud.covariance * turn.matrix().transpose()
    });
    // Symmetric: by columns it is the same as by rows.
    let covariances = turned.flat_map(<[[f64; 3]; 3]>::from).flatten().collect();
    vec![
        (Ellipsoids3D::descriptor_centers(), Values::Triples(centres)),
        (Ellipsoids3D::descriptor_half_sizes(), Values::Triples(half_sizes)),
        (Ellipsoids3D::descriptor_quaternions(), Values::Quads(turns)),
        (ComponentDescriptor::partial("covariances"), Values::Doubles(covariances)),
    ]
}

/// The ellipsoids on an arm that moves: their poses alone.
pub(super) fn carried(clouds: &[Cloud], links: &[Isometry3<f64>]) -> Ellipsoids3D {
    let poses: Vec<_> = clouds.iter().map(|cloud| cloud.at(links)).collect();
    Ellipsoids3D::update_fields()
        .with_centers(poses.iter().map(|(centre, _)| single(centre.coords.into())))
        .with_quaternions(poses.iter().map(|(_, turn)| *turn))
}
