//! DIRECT's partition of the joint box: a slice to look at, and all of it as data.

use std::sync::Arc;

use rerun::{
    AsComponents, Boxes2D, Color, DynamicArchetype, Image, LineStrips2D, Points2D, Radius, Transform3D,
    external::{
        arrow::array::{BooleanArray, Float64Array, UInt8Array, UInt32Array},
        re_log_types::EntityPath,
    },
};

use super::{colours::viridis, rows::Rows};
use crate::{
    experiment::JointDescription,
    kinematics::JointKind,
    optimize::{Plane, Projection},
    selection::{Leaf, Partition},
};

const NO_VALUE: [u8; 3] = [0x60, 0x60, 0x60];
const FRAME: [u8; 3] = [0x90, 0x90, 0x90];
const LABEL: [u8; 3] = [0x80, 0x80, 0x80];
const CHOSEN: [u8; 3] = [0xD5, 0x5E, 0x00];

/// Pixels along each side of the picture of a slice: sides trisected up to four times fit exactly.
const PIXELS: usize = 81;

/// How bright the fill of a face is beside its outline.
const FILL: f64 = 0.5;

/// Where the box that was searched is in a slice of the joint box: its least corner and its sides, of the square's 1.
struct Window {
    plane: Plane,
    corner: [f64; 2],
    sides: [f64; 2],
}

impl Window {
    fn of(partition: &Partition, plane: Plane, joints: &[JointDescription]) -> Self {
        let range = |joint: Option<usize>| {
            let (joint, searched) = joint.and_then(|joint| Some((joints.get(joint)?, partition.limits.get(joint)?)))?;
            let ([lower, upper], [from, to]) = (joint.limits, *searched);
            (lower < upper).then(|| ((from - lower) / (upper - lower), (to - from) / (upper - lower)))
        };
        let [(left, width), (bottom, height)] = [Some(plane.x), plane.y].map(|side| range(side).unwrap_or((0.0, 1.0)));
        Self { plane, corner: [left, bottom], sides: [width, height] }
    }

    /// Centre and half-sizes of a rectangle's face. Rerun's 2-D views have y downwards: upper limits are at 0.
    fn face(&self, leaf: &Leaf) -> ([f32; 2], [f32; 2]) {
        let Projection { centre, half } = self.plane.project(&leaf.centre, &leaf.levels);
        let [x, y] = [0, 1].map(|side| self.corner[side] + centre[side] * self.sides[side]);
        ([x as f32, (1.0 - y) as f32], [0, 1].map(|side| (half[side] * self.sides[side]) as f32))
    }
}

/// The frame of a slice and the names and limits of its joints, each from its lower limit to its upper: `x` to the
/// right, `y` upwards.
pub(super) fn frame(plane: Plane, joints: &[JointDescription]) -> [Box<dyn AsComponents>; 2] {
    let square = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
    let label = |joint: usize, directions: [&str; 2]| {
        joints.get(joint).map_or_else(String::new, |joint| {
            let [lower, upper] = joint.limits.map(|limit| match joint.kind {
                JointKind::Revolute => format!("{:.0}°", limit.to_degrees()),
                JointKind::Prismatic => format!("{limit:.2} m"),
            });
            format!("{}: {lower} {}, {upper} {}", joint.name, directions[0], directions[1])
        })
    };
    let mut labels = vec![([0.5_f32, 1.02], label(plane.x, ["left", "right"]))];
    labels.extend(plane.y.map(|y| ([0.5, -0.09], label(y, ["bottom", "top"]))));
    [
        Box::new(
            LineStrips2D::new([square])
                .with_colors([Color::from(FRAME)])
                .with_radii([Radius::new_ui_points(0.75)])
                .with_draw_order(1.0),
        ),
        Box::new(
            Points2D::new(labels.iter().map(|(place, _)| *place))
                .with_colors([Color::from(LABEL)])
                .with_radii([Radius::new_ui_points(0.0)])
                .with_labels(labels.iter().map(|(_, label)| label.clone()))
                .with_show_labels(true),
        ),
    ]
}

/// What is drawn of a slice.
pub(super) struct Slice {
    fill: Image,
    outlines: Boxes2D,
    centres: Points2D,
    chosen: Points2D,
}

impl Slice {
    /// The slice of a partition through its chosen rectangle, in the joint box; `None` if it has none.
    pub(super) fn of(partition: &Partition, plane: Plane, joints: &[JointDescription]) -> Option<Self> {
        let chosen = partition.leaves.get(partition.chosen)?;
        let colour = scale(partition);
        let (mut cut, other): (Vec<&Leaf>, Vec<&Leaf>) =
            partition.leaves.iter().partition(|leaf| plane.cuts(&leaf.centre, &leaf.levels, &chosen.centre));
        // Potentially optimal ones last, on top of their neighbours.
        cut.sort_by_key(|rectangle| rectangle.potentially_optimal);
        let window = Window::of(partition, plane, joints);
        let faces = || cut.iter().map(|rectangle| window.face(rectangle));
        Some(Self {
            fill: fill(cut.iter().map(|rectangle| (window.face(rectangle), colour(rectangle)))),
            outlines: Boxes2D::from_centers_and_half_sizes(faces().map(|(c, _)| c), faces().map(|(_, h)| h))
                .with_colors(cut.iter().map(|rectangle| Color::from(colour(rectangle))))
                .with_radii(
                    cut.iter()
                        .map(|rectangle| Radius::new_ui_points(if rectangle.potentially_optimal { 2.5 } else { 1.0 })),
                ),
            centres: Points2D::update_fields()
                .with_positions(other.iter().map(|rectangle| window.face(rectangle).0))
                .with_colors(other.iter().map(|rectangle| Color::from(colour(rectangle)))),
            chosen: Points2D::update_fields().with_positions([window.face(chosen).0]),
        })
    }

    /// Logs it, as the entities that `entity` names.
    pub(super) fn log(&self, rows: &mut Rows, step: u64, entity: impl Fn(&'static str) -> EntityPath) {
        let fill_look = || Image::update_fields().with_draw_order(-10.0);
        rows.drawn(step, &entity("direct/criterion"), &[&self.fill], Vec::new(), (0, fill_look));
        let outline_look = || Boxes2D::update_fields().with_draw_order(10.0);
        rows.drawn(step, &entity("direct/boxes"), &[&self.outlines], Vec::new(), (0, outline_look));
        let centre_look = || Points2D::update_fields().with_radii([Radius::new_ui_points(1.5)]).with_draw_order(20.0);
        rows.drawn(step, &entity("direct/centres"), &[&self.centres], Vec::new(), (0, centre_look));
        let chosen_look = || {
            Points2D::update_fields()
                .with_colors([Color::from(CHOSEN)])
                .with_radii([Radius::new_ui_points(5.0)])
                .with_labels(["chosen"])
                .with_show_labels(false)
                .with_draw_order(30.0)
        };
        rows.drawn(step, &entity("direct/chosen"), &[&self.chosen], Vec::new(), (0, chosen_look));
    }
}

/// The faces as a picture; Rerun's boxes are outlines.
fn fill(faces: impl Iterator<Item = (([f32; 2], [f32; 2]), [u8; 3])>) -> Image {
    let mut pixels = vec![0; PIXELS * PIXELS * 3];
    for ((centre, half), colour) in faces {
        // Of faces smaller than a pixel the last one gets it.
        let range = |side: usize| {
            let pixel = |place: f32| (place * PIXELS as f32).clamp(0.0, PIXELS as f32);
            let first = (pixel(centre[side] - half[side]) + 1e-3) as usize;
            let last = (pixel(centre[side] + half[side]) - 1e-3).ceil() as usize;
            first.min(PIXELS - 1)..last.clamp(first + 1, PIXELS)
        };
        let dark = colour.map(|channel| (FILL * f64::from(channel)) as u8);
        for row in range(1) {
            for column in range(0) {
                let start = 3 * (row * PIXELS + column);
                pixels[start..start + 3].copy_from_slice(&dark);
            }
        }
    }
    Image::from_rgb24(pixels, [PIXELS as u32; 2])
}

/// Puts the picture of a slice on the unit square.
pub(super) fn fill_transform() -> Transform3D {
    let pixel = 1.0 / PIXELS as f32;
    Transform3D::from_scale([pixel, pixel, 1.0])
}

/// The colour of a rectangle: viridis over the values of the partition, the lowest, which DIRECT looks for, brightest.
fn scale(partition: &Partition) -> impl Fn(&Leaf) -> [u8; 3] {
    let (lowest, highest) = partition
        .leaves
        .iter()
        .filter_map(|rectangle| rectangle.value)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let range = highest - lowest;
    move |rectangle| match rectangle.value {
        Some(value) if range > 0.0 => viridis((highest - value) / range),
        Some(_) => viridis(1.0),
        None => NO_VALUE,
    }
}

/// All rectangles as plain data.
pub(super) fn data(partition: &Partition) -> DynamicArchetype {
    let rectangles = &partition.leaves;
    let dimension = rectangles.first().map_or(0, |rectangle| rectangle.levels.len());
    DynamicArchetype::new_without_archetype()
        .with_component_from_data(
            "centres",
            Arc::new(Float64Array::from_iter_values(
                rectangles.iter().flat_map(|rectangle| rectangle.centre.iter().copied()),
            )),
        )
        .with_component_from_data(
            "levels",
            Arc::new(UInt8Array::from_iter_values(
                rectangles.iter().flat_map(|rectangle| rectangle.levels.iter().copied()),
            )),
        )
        .with_component_from_data(
            "values",
            Arc::new(Float64Array::from_iter_values(
                rectangles.iter().map(|rectangle| rectangle.value.unwrap_or(f64::NAN)),
            )),
        )
        .with_component_from_data(
            "generations",
            Arc::new(UInt32Array::from_iter_values(
                rectangles.iter().map(|rectangle| u32::try_from(rectangle.generation).unwrap_or(u32::MAX)),
            )),
        )
        .with_component_from_data(
            "potentially_optimal",
            Arc::new(rectangles.iter().map(|rectangle| Some(rectangle.potentially_optimal)).collect::<BooleanArray>()),
        )
        .with_component_from_data("dimension", Arc::new(UInt32Array::from_iter_values([dimension as u32])))
        .with_component_from_data("chosen", Arc::new(UInt32Array::from_iter_values([partition.chosen as u32])))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was searched within reach lies where it is in the joint box; without limits of its own it fills the slice.
    #[test]
    fn a_part_of_the_joint_box_is_drawn_as_that_part() {
        let joint = |name: &str, limits| JointDescription {
            name: name.to_owned(),
            kind: JointKind::Revolute,
            learned: true,
            limits,
        };
        let joints = [joint("a", [-1.0, 1.0]), joint("b", [0.0, 4.0])];
        let whole = Leaf {
            centre: vec![0.5; 2],
            levels: vec![0; 2],
            value: Some(1.0),
            generation: 0,
            potentially_optimal: false,
        };
        let plane = Plane { x: 0, y: Some(1) };
        for (limits, centre, half) in [
            (vec![], [0.5, 0.5], [0.5, 0.5]),
            (vec![[0.0, 0.5], [1.0, 3.0]], [0.625, 0.5], [0.125, 0.25]),
            (vec![[-1.0, 1.0], [3.0, 4.0]], [0.5, 0.125], [0.5, 0.125]),
        ] {
            let partition = Partition { leaves: vec![whole.clone()], chosen: 0, limits };
            let face = Window::of(&partition, plane, &joints).face(&whole);
            assert_eq!(face, (centre, half));
        }
    }
}
