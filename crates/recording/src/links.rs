//! The links of a robot that a URDF describes, as the shapes that it gives them.
//!
//! A learned axis carries its link's frame along as in [`Chain::fitted`](body_schema_robot::Chain::fitted): to the nearest point
//! of the learned line, turned by the smallest rotation. Shapes are drawn once; a step moves them.

use std::sync::Arc;

use nalgebra::Isometry3;

use super::{
    Appearance,
    posture::Posture,
    rerun::{
        AsComponents, Asset3D, Boxes3D, Color, Cylinders3D, Ellipsoids3D, FillMode, InstancePoses3D,
        SerializedComponentBatch,
    },
    solid::{Capsule, quaternion, single},
    values::{Cell, Values},
};
use body_schema_engine::{kinematics::Joint, model::State};
use body_schema_robot::{Chain, Shape, Solid};

/// The size below which a shape is the mark of a frame rather than a link's body, as a part of the chain's length.
const MARK: f64 = 0.03;

/// The shapes of a robot's links.
#[derive(Clone, Debug)]
pub(super) struct Links {
    chain: Chain,
    /// The described joints of the chain that move, in the base's frame.
    nominal: Vec<Joint>,
    parts: Vec<Part>,
    meshes: Vec<(Part, Mesh)>,
    /// For the base and what each moving joint carries up to the next: whether it has no shape.
    is_bare: Vec<bool>,
}

/// A shape on a link.
#[derive(Clone, Debug)]
struct Part {
    /// The index of the chain's link, 0 being the base, and the number of joints before it that move.
    link: usize,
    moving: usize,
    /// Where it is in that link's frame.
    place: Isometry3<f64>,
    solid: Solid,
}

/// A mesh as its file holds it.
#[derive(Clone, Debug)]
struct Mesh {
    content: Arc<[u8]>,
    media_type: &'static str,
    /// The factors of its x, y and z.
    scale: [f64; 3],
}

/// What an entity looks like, put together of several archetypes.
pub(super) struct Look(Vec<SerializedComponentBatch>);

impl AsComponents for Look {
    fn as_serialized_batches(&self) -> Vec<SerializedComponentBatch> {
        self.0.clone()
    }
}

impl Links {
    /// The shapes that can be drawn: those of `<visual>`, or of `<collision>` for a link without one of these. `None` if no link has any.
    pub(super) fn of(appearance: &Appearance) -> Option<Self> {
        let described = appearance.described.as_ref()?;
        let (chain, frames) = (described.chain.clone(), described.chain.frames());
        let (mut parts, mut meshes) = (Vec::new(), Vec::new());
        let mut is_bare = vec![true; chain.moving().count() + 1];
        let mark_m = MARK * chain.segments.iter().map(|segment| segment.origin.translation.vector.norm()).sum::<f64>();
        for attached in described.urdf.attached(&chain) {
            let (link, moving) = (attached.carrier, frames[attached.carrier].0);
            let part = |shape: &Shape| {
                let part = Part { link, moving, place: attached.place * shape.origin, solid: shape.solid.clone() };
                match &shape.solid {
                    Solid::Mesh { file, scale } => {
                        let (content, media_type) = appearance.meshes.get(file)?.clone();
                        Some((part, Some(Mesh { content, media_type, scale: *scale })))
                    }
                    _ => Some((part, None)),
                }
            };
            let is_body = |shape: &&Shape| size_m(&shape.solid) > mark_m;
            let drawn = |shapes: &[Shape]| shapes.iter().filter(is_body).filter_map(part).collect::<Vec<_>>();
            let visual = drawn(attached.visual);
            for (part, mesh) in if visual.is_empty() { drawn(attached.collision) } else { visual } {
                is_bare[moving] = false;
                match mesh {
                    Some(mesh) => meshes.push((part, mesh)),
                    None => parts.push(part),
                }
            }
        }
        (!parts.is_empty() || !meshes.is_empty()).then(|| Self {
            nominal: chain.state().joints,
            chain,
            parts,
            meshes,
            is_bare,
        })
    }

    /// Whether the base has shapes of its own.
    pub(super) fn has_base(&self) -> bool {
        !self.is_bare[0]
    }

    /// Of an arm's links, then its pins, what is drawn beside the shapes: links without any, and all pins.
    pub(super) fn beside(&self, capsules: Vec<Capsule>) -> Vec<Capsule> {
        let is_kept = |index: usize| self.is_bare.get(index + 1).copied().unwrap_or(true);
        capsules.into_iter().enumerate().filter(|(index, _)| is_kept(*index)).map(|(_, capsule)| capsule).collect()
    }

    /// The frames of the chain's links at θ = 0, for an arm in the frame of the measurements, in which its base stands at `base`.
    pub(super) fn frames(&self, arm: &State, base: &Isometry3<f64>) -> Vec<Isometry3<f64>> {
        let mut joints = self.nominal.iter().map(|joint| joint.transformed(base)).zip(&arm.joints);
        // Of every link as described and as learned.
        let mut frames = vec![(*base, *base)];
        for segment in &self.chain.segments {
            let (described, frame) = frames[segment.parent().map_or(0, |parent| parent + 1)];
            let described = described * segment.origin;
            let frame = match segment.kind.moves().and_then(|_| joints.next()) {
                Some((nominal, learned)) => nominal.motion_to(learned) * described,
                None => frame * segment.origin,
            };
            frames.push((described, frame));
        }
        frames.into_iter().map(|(_, frame)| frame).collect()
    }

    /// The poses of the meshes.
    pub(super) fn mesh_poses(&self, frames: &[Isometry3<f64>], posture: &Posture) -> Vec<Isometry3<f64>> {
        self.meshes.iter().map(|(part, _)| part.joint(frames, posture)).collect()
    }

    /// Where the shapes are, without meshes.
    pub(super) fn cells(&self, frames: &[Isometry3<f64>], posture: &Posture) -> Vec<Cell> {
        self.placed(&self.parts.iter().map(|part| part.pose(frames, posture)).collect::<Vec<_>>())
    }

    /// The shapes nowhere.
    pub(super) fn no_cells(&self) -> Vec<Cell> {
        self.placed(&[])
    }

    /// The shapes at these poses, kind by kind.
    fn placed(&self, poses: &[Isometry3<f64>]) -> Vec<Cell> {
        let kinds = [
            (is_box as fn(&Solid) -> bool, Boxes3D::descriptor_centers(), Some(Boxes3D::descriptor_quaternions())),
            (is_cylinder, Cylinders3D::descriptor_centers(), Some(Cylinders3D::descriptor_quaternions())),
            (is_ball, Ellipsoids3D::descriptor_centers(), None),
        ];
        let mut cells = Vec::new();
        for (is_wanted, centres, quaternions) in kinds {
            if !self.parts.iter().any(|part| is_wanted(&part.solid)) {
                continue;
            }
            let wanted = self.parts.iter().zip(poses).filter(|(part, _)| is_wanted(&part.solid));
            let (places, turns) =
                wanted.map(|(_, pose)| (single(pose.translation.vector.into()), quaternion(&pose.rotation).0)).unzip();
            cells.push((centres, Values::Triples(places)));
            cells.extend(quaternions.map(|quaternions| (quaternions, Values::Quads(turns))));
        }
        cells
    }

    /// What the shapes look like in a colour, beside what an entity has already.
    pub(super) fn look(&self, beside: &dyn AsComponents, [red, green, blue, alpha]: [u8; 4]) -> Look {
        let colour = [Color::from_unmultiplied_rgba(red, green, blue, alpha)];
        let (mut boxes, mut cylinders, mut balls) = (Vec::new(), Vec::new(), Vec::new());
        for part in &self.parts {
            match part.solid {
                Solid::Box(sides) => boxes.push(single(sides.map(|side| 0.5 * side))),
                Solid::Cylinder { radius_m, length_m } => cylinders.push((radius_m as f32, length_m as f32)),
                Solid::Ball(radius_m) => balls.push([radius_m as f32; 3]),
                Solid::Mesh { .. } => {}
            }
        }
        let mut batches = beside.as_serialized_batches();
        if !boxes.is_empty() {
            let boxes = Boxes3D::update_fields().with_half_sizes(boxes);
            batches.extend(boxes.with_colors(colour).with_fill_mode(FillMode::Solid).as_serialized_batches());
        }
        if !cylinders.is_empty() {
            let (radii, lengths): (Vec<_>, Vec<_>) = cylinders.into_iter().unzip();
            let cylinders = Cylinders3D::update_fields().with_radii(radii).with_lengths(lengths);
            batches.extend(cylinders.with_colors(colour).with_fill_mode(FillMode::Solid).as_serialized_batches());
        }
        if !balls.is_empty() {
            let balls = Ellipsoids3D::update_fields().with_half_sizes(balls);
            batches.extend(balls.with_colors(colour).with_fill_mode(FillMode::Solid).as_serialized_batches());
        }
        Look(batches)
    }

    /// What each mesh is, in a colour, and where on the joint that carries it.
    pub(super) fn meshes(
        &self,
        [red, green, blue, alpha]: [u8; 4],
    ) -> impl Iterator<Item = (Asset3D, InstancePoses3D)> {
        self.meshes.iter().map(move |(part, mesh)| {
            let asset = Asset3D::from_file_contents(mesh.content.to_vec(), Some(mesh.media_type))
                .with_albedo_factor(Color::from_unmultiplied_rgba(red, green, blue, alpha).0);
            let place = InstancePoses3D::new()
                .with_translations([single(part.place.translation.vector.into())])
                .with_quaternions([quaternion(&part.place.rotation)])
                .with_scales([single(mesh.scale)]);
            (asset, place)
        })
    }
}

impl Part {
    /// The pose of the link that carries it.
    fn joint(&self, frames: &[Isometry3<f64>], posture: &Posture) -> Isometry3<f64> {
        let motion = posture.links.get(self.moving).copied().unwrap_or_default();
        motion * frames.get(self.link).copied().unwrap_or_default()
    }

    fn pose(&self, frames: &[Isometry3<f64>], posture: &Posture) -> Isometry3<f64> {
        self.joint(frames, posture) * self.place
    }
}

/// The largest measure of a shape, metres; infinite for a mesh, of which it is not known.
fn size_m(solid: &Solid) -> f64 {
    match solid {
        Solid::Box(sides) => sides.iter().copied().fold(0.0, f64::max),
        Solid::Cylinder { radius_m, length_m } => length_m.max(2.0 * radius_m),
        Solid::Ball(radius_m) => 2.0 * radius_m,
        Solid::Mesh { .. } => f64::INFINITY,
    }
}

fn is_box(solid: &Solid) -> bool {
    matches!(solid, Solid::Box(_))
}

fn is_cylinder(solid: &Solid) -> bool {
    matches!(solid, Solid::Cylinder { .. })
}

fn is_ball(solid: &Solid) -> bool {
    matches!(solid, Solid::Ball(_))
}
