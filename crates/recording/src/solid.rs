//! Solid shapes, for arms and bodies.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::{
    rerun::{Capsules3D, Color, Cylinders3D, FillMode, Quaternion, RotationQuat, Transform3D, Translation3D},
    values::{Cell, Values},
};

/// A point in Rerun's form.
pub(super) fn single([x, y, z]: [f64; 3]) -> [f32; 3] {
    [x as f32, y as f32, z as f32]
}

/// A rotation in Rerun's form.
pub(super) fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    let [x, y, z, w]: [f64; 4] = rotation.coords.into();
    Quaternion::from_xyzw([x as f32, y as f32, z as f32, w as f32])
}

/// A pose in Rerun's form.
pub(super) fn transform(pose: &Isometry3<f64>) -> Transform3D {
    Transform3D::update_fields()
        .with_translation(single(pose.translation.vector.into()))
        .with_quaternion(quaternion(&pose.rotation))
}

/// A rod with round ends between two points; a ball if they are one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Capsule {
    pub(super) from: Point3<f64>,
    pub(super) to: Point3<f64>,
    pub(super) radius_m: f64,
    /// Red, green, blue and opacity.
    pub(super) colour: [u8; 4],
}

impl Capsule {
    fn length(&self) -> f32 {
        (self.to - self.from).norm() as f32
    }

    fn translation(&self) -> Translation3D {
        single(self.from.coords.into()).into()
    }

    /// The rotation of the capsule: Rerun's capsules lie along z.
    fn rotation(&self) -> RotationQuat {
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &(self.to - self.from));
        // Only a half turn is left open: about which axis makes no difference to a rod.
        let turn = turn.unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        quaternion(&turn).into()
    }
}

/// Capsules as one entity.
pub(super) fn solid(capsules: &[Capsule]) -> Capsules3D {
    let Capsules3D { translations, quaternions, .. } = moved(capsules);
    Capsules3D { translations, quaternions, ..look(capsules) }.with_lengths(capsules.iter().map(Capsule::length))
}

/// The lengths and poses of capsules.
pub(super) fn shapes(capsules: &[Capsule]) -> Vec<Cell> {
    let translations = capsules.iter().map(|capsule| capsule.translation().0.0).collect();
    let rotations = capsules.iter().map(|capsule| capsule.rotation().0.0).collect();
    let lengths = capsules.iter().map(Capsule::length).collect();
    vec![
        (Capsules3D::descriptor_lengths(), Values::Singles(lengths)),
        (Capsules3D::descriptor_translations(), Values::Triples(translations)),
        (Capsules3D::descriptor_quaternions(), Values::Quads(rotations)),
    ]
}

/// The look of capsules, which is the same for an arm in all its postures.
pub(super) fn look(capsules: &[Capsule]) -> Capsules3D {
    let colours =
        capsules.iter().map(|Capsule { colour: [r, g, b, a], .. }| Color::from_unmultiplied_rgba(*r, *g, *b, *a));
    Capsules3D::update_fields()
        .with_radii(capsules.iter().map(|it| it.radius_m as f32))
        .with_colors(colours)
        .with_fill_mode(FillMode::Solid)
}

/// A rod with flat ends as an entity.
pub(super) fn drum(rod: &Capsule) -> Cylinders3D {
    let Capsule { from, to, radius_m, colour: [red, green, blue, alpha] } = *rod;
    Cylinders3D::from_lengths_and_radii([rod.length()], [radius_m as f32])
        .with_centers([single(nalgebra::center(&from, &to).coords.into())])
        .with_quaternions([rod.rotation()])
        .with_colors([Color::from_unmultiplied_rgba(red, green, blue, alpha)])
        .with_fill_mode(FillMode::Solid)
}

/// Capsules at other poses: the poses alone.
pub(super) fn moved(capsules: &[Capsule]) -> Capsules3D {
    Capsules3D::update_fields()
        .with_translations(capsules.iter().map(Capsule::translation))
        .with_quaternions(capsules.iter().map(Capsule::rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capsule_ends_where_it_should() {
        let from = Point3::new(0.1, 0.2, 0.3);
        for to in [[0.1, 0.2, 0.9], [0.1, 0.2, -0.9], [1.0, -1.0, 0.0]] {
            let capsule = Capsule { from, to: to.into(), radius_m: 0.1, colour: [0; 4] };
            let [x, y, z, w] = capsule.rotation().0.0.map(f64::from);
            let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            let end = from + turn * Vector3::z() * f64::from(capsule.length());
            assert!((end - Point3::from(to)).norm() < 1e-6, "{end} instead of {to:?}");
        }
    }
}
