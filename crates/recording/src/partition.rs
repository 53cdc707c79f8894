//! DIRECT's partition of the joint box: a slice as a picture, and all of it as data.

use super::{
    rerun::{
        AsComponents, Boxes2D, ChannelDatatype, Color, ColorModel, ComponentDescriptor, EntityPath, Image, ImageFormat,
        LineStrips2D, Points2D, Radius, Transform3D,
    },
    rows::Rows,
    values::{Cell, Values},
};
use body_schema_engine::{
    optimize::{Plane, Projection},
    selection::{Leaf, Partition},
};
use body_schema_palette::viridis;
use body_schema_wire::{JointDescription, JointKind};

const NO_VALUE: [u8; 3] = [0x60, 0x60, 0x60];
const FRAME: [u8; 3] = [0x90, 0x90, 0x90];
const LABEL: [u8; 3] = [0x80, 0x80, 0x80];
const CHOSEN: [u8; 3] = [0xD5, 0x5E, 0x00];

/// Pixels along each side of the picture of a slice: sides trisected up to four times fit exactly.
const PIXELS: usize = 81;

/// The brightness of the fill of a face relative to its outline.
const FILL: f64 = 0.5;

/// The place of the searched box in a slice of the joint box: its least corner and its sides, as parts of the square's.
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

/// The side of a slice with room for what is written above and below it: viewers write a label under its place.
pub(super) const WITH_LABELS: [f64; 2] = [-0.3, 1.3];
/// Where the labels of the upper and the lower side are.
const ABOVE: f32 = -0.27;
const BELOW: f32 = 1.02;

/// The frame of a slice and the names and limits of its joints, each from its lower limit to its upper: `x` to the
/// right, `y` upwards.
pub(super) fn frame(plane: Plane, joints: &[JointDescription]) -> [Box<dyn AsComponents>; 2] {
    let square = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
    let label = |joint: usize, direction: &str| {
        joints.get(joint).map_or_else(String::new, |joint| {
            let [lower, upper] = joint.limits.map(|limit| match joint.kind {
                JointKind::Revolute => format!("{:.0}°", limit.to_degrees()),
                JointKind::Prismatic => format!("{limit:.2} m"),
            });
            format!("{}, {direction}: {lower} to {upper}", joint.name)
        })
    };
    let mut labels = vec![([0.5, BELOW], label(plane.x, "to the right"))];
    labels.extend(plane.y.map(|y| ([0.5, ABOVE], label(y, "upwards"))));
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

/// The drawing of a slice.
pub(super) struct Slice {
    fill: Vec<Cell>,
    outlines: Vec<Cell>,
    centres: Vec<Cell>,
    chosen: Vec<Cell>,
}

impl Slice {
    /// The slice of a partition through its chosen rectangle, in the joint box; `None` without a chosen one.
    pub(super) fn of(partition: &Partition, plane: Plane, joints: &[JointDescription]) -> Option<Self> {
        let chosen = partition.leaves.get(partition.chosen)?;
        let (window, colour) = (Window::of(partition, plane, joints), scale(partition));
        let faces = partition.leaves.iter().map(|leaf| Face { leaf, place: window.face(leaf), colour: colour(leaf) });
        let (mut cut, other): (Vec<Face<'_>>, Vec<Face<'_>>) =
            faces.partition(|face| plane.cuts(&face.leaf.centre, &face.leaf.levels, &chosen.centre));
        // Potentially optimal ones last, on top of their neighbours.
        cut.sort_by_key(|face| face.leaf.potentially_optimal);
        let pixels = fill(cut.iter().map(|face| (face.place, face.colour)));
        let radius = |face: &Face<'_>| Radius::new_ui_points(if face.leaf.potentially_optimal { 2.5 } else { 1.0 }).0.0;
        let centres = |faces: &[Face<'_>]| Values::Pairs(faces.iter().map(|face| face.place.0).collect());
        let colours =
            |faces: &[Face<'_>]| Values::Words(faces.iter().map(|face| Color::from(face.colour).to_u32()).collect());
        Some(Self {
            fill: vec![(
                Image::descriptor_buffer(),
                Values::Lists(vec![pixels.len()], Box::new(Values::Bytes(pixels))),
            )],
            outlines: vec![
                (Boxes2D::descriptor_centers(), centres(&cut)),
                (Boxes2D::descriptor_half_sizes(), Values::Pairs(cut.iter().map(|face| face.place.1).collect())),
                (Boxes2D::descriptor_colors(), colours(&cut)),
                (Boxes2D::descriptor_radii(), Values::Singles(cut.iter().map(radius).collect())),
            ],
            centres: vec![
                (Points2D::descriptor_positions(), centres(&other)),
                (Points2D::descriptor_colors(), colours(&other)),
            ],
            chosen: vec![(Points2D::descriptor_positions(), Values::Pairs(vec![window.face(chosen).0]))],
        })
    }

    /// Logs it, as the entities that `entity` names.
    pub(super) fn log(self, rows: &mut Rows, step: u64, entity: impl Fn(&'static str) -> EntityPath) {
        let format = ImageFormat::from_color_model([PIXELS as u32; 2], ColorModel::RGB, ChannelDatatype::U8);
        let fill_look = || Image::update_fields().with_format(format).with_draw_order(-10.0);
        rows.drawn(step, &entity("direct/criterion"), self.fill, (0, fill_look));
        let outline_look = || Boxes2D::update_fields().with_draw_order(10.0);
        rows.drawn(step, &entity("direct/boxes"), self.outlines, (0, outline_look));
        let centre_look = || Points2D::update_fields().with_radii([Radius::new_ui_points(1.5)]).with_draw_order(20.0);
        rows.drawn(step, &entity("direct/centres"), self.centres, (0, centre_look));
        let chosen_look = || {
            Points2D::update_fields()
                .with_colors([Color::from(CHOSEN)])
                .with_radii([Radius::new_ui_points(5.0)])
                .with_labels(["chosen"])
                .with_show_labels(false)
                .with_draw_order(30.0)
        };
        rows.drawn(step, &entity("direct/chosen"), self.chosen, (0, chosen_look));
    }
}

/// A rectangle in the drawing.
struct Face<'a> {
    leaf: &'a Leaf,
    /// Its centre and half-sizes in the slice.
    place: ([f32; 2], [f32; 2]),
    colour: [u8; 3],
}

/// The faces as a picture; Rerun's boxes are outlines.
fn fill(faces: impl Iterator<Item = (([f32; 2], [f32; 2]), [u8; 3])>) -> Vec<u8> {
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
    pixels
}

/// The transform that puts the picture of a slice on the unit square.
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
pub(super) fn data(partition: &Partition) -> Vec<Cell> {
    let leaves = &partition.leaves;
    let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let dimension = leaves.first().map_or(0, |leaf| leaf.levels.len());
    let component = |name: &'static str, values| (ComponentDescriptor::partial(name), values);
    let (mut centres, mut levels) =
        (Vec::with_capacity(dimension * leaves.len()), Vec::with_capacity(dimension * leaves.len()));
    for leaf in leaves {
        centres.extend_from_slice(&leaf.centre);
        levels.extend_from_slice(&leaf.levels);
    }
    let values = leaves.iter().map(|leaf| leaf.value.unwrap_or(f64::NAN)).collect();
    let generations = leaves.iter().map(|leaf| count(leaf.generation)).collect();
    let potentially_optimal = leaves.iter().map(|leaf| leaf.potentially_optimal).collect();
    vec![
        component("centres", Values::Doubles(centres)),
        component("levels", Values::Bytes(levels)),
        component("values", Values::Doubles(values)),
        component("generations", Values::Words(generations)),
        component("potentially_optimal", Values::Flags(potentially_optimal)),
        component("dimension", Values::Words(vec![count(dimension)])),
        component("chosen", Values::Words(vec![count(partition.chosen)])),
    ]
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
