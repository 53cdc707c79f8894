//! An arm at θ = 0, as lines: its links and its axes.

use super::{
    rerun::{Arrows3D, Color, LineStrips3D, Radius},
    solid::single,
    values::{Cell, Values},
};
use body_schema_wire::{JointDescription, ModelReport};

/// An arm as one line through its points.
pub(super) fn links(points_m: &[[f64; 3]]) -> Vec<Cell> {
    let line = Values::line(points_m.iter().copied().map(single).collect());
    vec![(LineStrips3D::descriptor_strips(), line)]
}

/// The look of such lines.
pub(super) fn links_look(colour: [u8; 3]) -> LineStrips3D {
    LineStrips3D::update_fields().with_colors([Color::from(colour)]).with_radii([Radius::new_ui_points(2.0)])
}

/// The axes as arrows `length_m` long, one per joint.
pub(super) fn axes(model: &ModelReport, length_m: f64) -> Vec<Cell> {
    let vectors = model.joints.iter().map(|joint| single(joint.axis.map(|x| x * length_m))).collect();
    let origins = origins(model).into_iter().map(single).collect();
    vec![
        (Arrows3D::descriptor_vectors(), Values::Triples(vectors)),
        (Arrows3D::descriptor_origins(), Values::Triples(origins)),
    ]
}

/// The look of such arrows.
pub(super) fn axes_look(joints: &[JointDescription], colour: [u8; 3]) -> Arrows3D {
    Arrows3D::update_fields()
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_ui_points(2.0)])
        .with_labels(joints.iter().map(|joint| joint.name.clone()))
        .with_show_labels(false)
}

/// The places of the arrows. A prismatic joint has no point: its arrow stands at the next joint's, or at the marker.
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

#[cfg(test)]
mod tests {
    use super::*;
    use body_schema_wire::JointReport;

    #[test]
    fn the_arrow_of_a_slide_stands_at_the_next_point() {
        let joint = |point_m| JointReport {
            axis: [0.0, 0.0, 1.0],
            point_m,
            point_covariance_m2: None,
            allowed_point_covariance_m2: None,
            direction_covariance_rad2: None,
            correction: None,
        };
        let (a, b, marker_m) = ([1.0; 3], [2.0; 3], [3.0; 3]);
        let joints = vec![joint(None), joint(None), joint(Some(a)), joint(Some(b)), joint(None)];
        let model = ModelReport {
            joints,
            marker_m,
            marker_covariance_m2: None,
            base: None,
            cameras: Vec::new(),
            targets: Vec::new(),
            sockets_m: Vec::new(),
            loads: None,
        };
        assert_eq!(origins(&model), [a, a, a, b, marker_m]);
    }
}
