//! An arm at θ = 0: its links, its axes, and how uncertain they are.

use std::sync::Arc;

use rerun::{
    Arrows3D, AsComponents, Color, DynamicArchetype, Ellipsoids3D, FillMode, LineStrips3D, Quaternion, Radius,
    external::arrow::array::Float64Array,
};

use super::{
    colours::tint,
    ellipsoid::{Axes, Ellipsoid, EllipsoidSize},
};
use crate::experiment::{JointDescription, ModelReport};

/// Opacity of ellipsoids, of 255: what they surround stays visible.
const ALPHA: u8 = 90;

/// A point as Rerun takes it.
pub(super) fn single([x, y, z]: [f64; 3]) -> [f32; 3] {
    [x as f32, y as f32, z as f32]
}

/// An arm as one line through its points, `width` in points of the screen.
pub(super) fn links(points_m: &[[f64; 3]], colour: [u8; 3], width: f32) -> LineStrips3D {
    LineStrips3D::new([points_m.iter().copied().map(single)])
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_ui_points(width)])
}

/// The axes as arrows `length_m` long, one per joint.
pub(super) fn axes(model: &ModelReport, joints: &[JointDescription], length_m: f64, colour: [u8; 3]) -> Arrows3D {
    let vectors = model.joints.iter().map(|joint| single(joint.axis.map(|x| x * length_m)));
    Arrows3D::from_vectors(vectors)
        .with_origins(origins(model).into_iter().map(single))
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_ui_points(2.0)])
        .with_labels(joints.iter().map(|joint| joint.name.clone()))
        .with_show_labels(false)
}

/// Where the arrows stand. A prismatic joint has no point: its arrow stands at the next joint's, or at the marker.
pub(super) fn origins(model: &ModelReport) -> Vec<[f64; 3]> {
    let mut next = model.marker_m;
    let mut origins: Vec<[f64; 3]> = (model.joints.iter().rev())
        .map(|joint| {
            next = joint.point_m.unwrap_or(next);
            next
        })
        .collect();
    origins.reverse();
    origins
}

/// The ellipsoids of one learner, continuous from step to step.
pub(super) struct Uncertainty {
    size: EllipsoidSize,
    points: Vec<Axes>,
    marker: Axes,
    directions: Vec<Axes>,
}

/// One covariance and where it is drawn.
struct Instance {
    centre: [f64; 3],
    label: String,
    covariance: [[f64; 3]; 3],
    ellipsoid: Ellipsoid,
}

impl Uncertainty {
    /// For an arm of so many joints.
    pub(super) fn new(joints: usize, size: EllipsoidSize) -> Self {
        let axes = vec![Axes::default(); joints];
        Self { size, points: axes.clone(), marker: Axes::default(), directions: axes }
    }

    /// The points on the axes, then the marker. `None` if the learner keeps no covariance of any.
    pub(super) fn of_points(
        &mut self,
        model: &ModelReport,
        joints: &[JointDescription],
        colour: [u8; 3],
    ) -> Option<Instances> {
        let points =
            model.joints.iter().zip(&mut self.points).zip(joints).filter_map(|((joint, axes), description)| {
                Some((joint.point_m?, joint.point_covariance_m2?, axes, description.name.as_str()))
            });
        let marker =
            model.marker_covariance_m2.map(|covariance| (model.marker_m, covariance, &mut self.marker, "marker"));
        Instances::new(points.chain(marker), self.size, 1.0, colour)
    }

    /// The directions, at the tips of arrows `length_m` long. `None` if the learner keeps no covariance of any.
    pub(super) fn of_directions(
        &mut self,
        model: &ModelReport,
        joints: &[JointDescription],
        length_m: f64,
        colour: [u8; 3],
    ) -> Option<Instances> {
        let origins = origins(model);
        let tips = (model.joints.iter().zip(origins).zip(&mut self.directions).zip(joints)).filter_map(
            |(((joint, origin), axes), description)| {
                let tip = std::array::from_fn(|i| origin[i] + length_m * joint.axis[i]);
                Some((tip, joint.direction_covariance_rad2?, axes, description.name.as_str()))
            },
        );
        Instances::new(tips, self.size, length_m, tint(colour, 0.5))
    }
}

/// Ellipsoids, and the covariances they are drawn from.
pub(super) struct Instances {
    ellipsoids: Ellipsoids3D,
    covariances: DynamicArchetype,
}

impl Instances {
    fn new<'a>(
        covariances: impl Iterator<Item = ([f64; 3], [[f64; 3]; 3], &'a mut Axes, &'a str)>,
        size: EllipsoidSize,
        scale: f64,
        colour: [u8; 3],
    ) -> Option<Self> {
        let mut any = false;
        let instances: Vec<Instance> = covariances
            .filter_map(|(centre, covariance, axes, name)| {
                any = true;
                let label = format!("{name} ({})", size.label());
                Some(Instance { centre, label, covariance, ellipsoid: axes.ellipsoid(&covariance, size, scale)? })
            })
            .collect();
        any.then(|| Self {
            ellipsoids: Ellipsoids3D::from_centers_and_half_sizes(
                instances.iter().map(|instance| single(instance.centre)),
                instances.iter().map(|instance| single(instance.ellipsoid.half_sizes)),
            )
            .with_quaternions(instances.iter().map(|instance| {
                let [x, y, z, w]: [f64; 4] = instance.ellipsoid.rotation.coords.into();
                Quaternion::from_xyzw([x as f32, y as f32, z as f32, w as f32])
            }))
            .with_colors([Color::from_unmultiplied_rgba(colour[0], colour[1], colour[2], ALPHA)])
            .with_line_radii([Radius::new_ui_points(0.5)])
            .with_fill_mode(FillMode::TransparentFillMajorWireframe)
            .with_labels(instances.iter().map(|instance| instance.label.clone()))
            .with_show_labels(false),
            covariances: DynamicArchetype::new_without_archetype().with_component_from_data(
                "covariances",
                Arc::new(Float64Array::from_iter_values(
                    instances.iter().flat_map(|instance| instance.covariance.into_iter().flatten()),
                )),
            ),
        })
    }

    /// Both parts, to be logged in one row.
    pub(super) fn parts(&self) -> [&dyn AsComponents; 2] {
        [&self.ellipsoids, &self.covariances]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::JointReport;

    #[test]
    fn the_arrow_of_a_slide_stands_at_the_next_point() {
        let joint = |point_m| JointReport {
            axis: [0.0, 0.0, 1.0],
            point_m,
            point_covariance_m2: None,
            direction_covariance_rad2: None,
        };
        let (a, b, marker_m) = ([1.0; 3], [2.0; 3], [3.0; 3]);
        let joints = vec![joint(None), joint(None), joint(Some(a)), joint(Some(b)), joint(None)];
        let model = ModelReport { joints, marker_m, marker_covariance_m2: None };
        assert_eq!(origins(&model), [a, a, a, b, marker_m]);
    }
}
