//! The head that watches: the field of its lens, the range of its turns, and its gaze.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::{
    colours::tint,
    rerun::{Color, LineStrips3D, Radius},
    solid::single,
};
use body_schema_engine::sensing::Head;
use body_schema_wire::{GazeReport, HeadDescription};

/// Length of the drawn cones, metres.
const LENGTH_M: f64 = 0.35;
/// Corners of the polygon that stands for a circle.
const CORNERS: usize = 24;
/// The colour of the head, which no learner has.
const HEAD: [u8; 3] = [0x8C, 0x93, 0xA0];

/// The cone at rest, and the line that the look direction draws along the limits of pan and tilt.
pub(super) fn frustum(description: &HeadDescription) -> LineStrips3D {
    let head = head(description);
    let rest = head.gaze(0.0, 0.0).direction;
    let mut strips = cone(&head.position, &rest, head.lens_half_angle);
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
    strips.push(
        (corners.into_iter())
            .map(|(pan, tilt)| head.gaze(pan * head.pan_limit, tilt * head.tilt_limit).direction)
            .map(|direction| point(&(head.position + direction.into_inner() * LENGTH_M)))
            .collect(),
    );
    drawn(strips, HEAD, 1.0)
}

/// The cone of every eye; nothing without a gaze.
pub(super) fn gaze(description: &HeadDescription, gaze: Option<&GazeReport>, colour: [u8; 3]) -> LineStrips3D {
    let cones = gaze.into_iter().flat_map(|gaze| {
        let direction = UnitVector3::new_normalize(Vector3::from(gaze.direction));
        let of_eye = move |eye: &[f64; 3]| cone(&Point3::from(*eye), &direction, description.lens_half_angle_rad);
        gaze.eyes_m.iter().flat_map(of_eye).collect::<Vec<_>>()
    });
    drawn(cones.collect(), tint(colour, 0.5), 1.0)
}

fn head(description: &HeadDescription) -> Head {
    Head {
        position: Point3::from(description.position_m),
        look: UnitVector3::new_normalize(Vector3::from(description.look)),
        pan_limit: description.pan_limit_rad,
        tilt_limit: description.tilt_limit_rad,
        lens_half_angle: description.lens_half_angle_rad,
        baseline: description.eye_baseline_m,
    }
}

/// A cone as lines: its rim, and four lines from the apex to the rim.
fn cone(apex: &Point3<f64>, direction: &UnitVector3<f64>, half_angle: f64) -> Vec<Vec<[f64; 3]>> {
    let aside = if direction.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let u = direction.cross(&aside).normalize();
    let v = direction.cross(&u);
    let rim = |corner: usize| {
        let (sin, cos) = (std::f64::consts::TAU * corner as f64 / CORNERS as f64).sin_cos();
        let ray = direction.into_inner() * half_angle.cos() + (u * cos + v * sin) * half_angle.sin();
        point(&(apex + ray * LENGTH_M))
    };
    let mut strips = vec![(0..=CORNERS).map(rim).collect::<Vec<_>>()];
    strips.extend((0..4).map(|side| vec![point(apex), rim(side * CORNERS / 4)]));
    strips
}

fn point(point: &Point3<f64>) -> [f64; 3] {
    [point.x, point.y, point.z]
}

fn drawn(strips: Vec<Vec<[f64; 3]>>, colour: [u8; 3], width: f32) -> LineStrips3D {
    LineStrips3D::new(strips.into_iter().map(|strip| strip.into_iter().map(single).collect::<Vec<_>>()))
        .with_colors([Color::from(colour)])
        .with_radii([Radius::new_ui_points(width)])
}
