//! An arm at θ = 0, as lines: its links and its axes.

use super::{
    rerun::{Arrows3D, Color, LineStrips3D, Radius},
    solid::single,
    values::{Cell, Values},
};
use body_schema_wire::{JointDescription, ModelReport};

/// A robot as lines through its points, one for each branch.
pub(super) fn links(bones_m: &[Vec<[f64; 3]>]) -> Vec<Cell> {
    let points = Values::Triples(bones_m.iter().flatten().copied().map(single).collect());
    let lines = Values::Lists(bones_m.iter().map(Vec::len).collect(), Box::new(points));
    vec![(LineStrips3D::descriptor_strips(), lines)]
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

/// The places of the arrows. A prismatic joint has no point: its arrow stands at that of the next joint that it carries, or at the marker;
/// where it carries nothing, at that of the joint that carries it.
pub(super) fn origins(model: &ModelReport) -> Vec<[f64; 3]> {
    let count = model.joints.len();
    let mut origins: Vec<Option<[f64; 3]>> = vec![None; count];
    for index in (0..count).rev() {
        let next = (index + 1..count).find(|other| model.link_before(*other) == index + 1);
        let marker = || (model.hand_link() == index + 1).then_some(model.marker_m);
        let next = next.and_then(|next| origins[next]).or_else(marker);
        origins[index] = model.joints[index].point_m.or(next);
    }
    for index in 0..count {
        let before = model.link_before(index).checked_sub(1).and_then(|carrier| *origins.get(carrier)?);
        origins[index] = origins[index].or(before);
    }
    origins.into_iter().map(|origin| origin.unwrap_or(model.marker_m)).collect()
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
            parents: Vec::new(),
            marker_link: None,
            marker_covariance_m2: None,
            base: None,
            cameras: Vec::new(),
            targets: Vec::new(),
            sockets_m: Vec::new(),
            loads: None,
        };
        assert_eq!(origins(&model), [a, a, a, b, marker_m]);
        // The second and the third on the base, the fourth with the marker on the first, the fifth on the fourth.
        let parents = vec![None, None, None, Some(0), Some(3)];
        let tree = ModelReport { parents, marker_link: Some(4), ..model };
        assert_eq!(origins(&tree), [b, marker_m, a, b, b]);
    }
}
