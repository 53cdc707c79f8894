//! What a scenario says of how its robot and its surroundings look.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{rerun::MediaType, shipped::shipped};
use body_schema_engine::selection::Obstacle;
use body_schema_robot::{Shape, Solid};
use body_schema_scenario::{Described, Scenario, ships};

/// What a scenario says of how its robot and its surroundings look. Nothing of it is in a
/// [`Description`](body_schema_wire::Description), and nothing of it has a bearing on what is computed.
#[derive(Clone, Debug, Default)]
pub struct Appearance {
    /// The boxes of `[constraints]`, in the frame of the nominal base.
    pub(super) obstacles: Vec<Obstacle>,
    /// The least height of `[constraints]` in that frame, metres.
    pub(super) minimum_height_m: Option<f64>,
    /// The robot, if a URDF describes it.
    pub(super) described: Option<Arc<Described>>,
    /// The content of mesh files and their media type, by the names that the description has for them.
    pub(super) meshes: BTreeMap<String, (Arc<[u8]>, &'static str)>,
}

impl Appearance {
    /// What a scenario says. Of robots that ship the meshes are there, where these ship, too; others are not read.
    pub fn of(scenario: &Scenario) -> Self {
        let constraints = scenario.constraints.as_ref();
        let mut appearance = Self {
            obstacles: constraints.map(|constraints| constraints.obstacles.clone()).unwrap_or_default(),
            minimum_height_m: constraints.and_then(|constraints| constraints.minimum_height),
            described: scenario.robot.described.clone(),
            meshes: BTreeMap::new(),
        };
        if scenario.robot.described.as_ref().is_some_and(|described| ships(described.urdf.text())) {
            let files = appearance.mesh_files().into_iter();
            appearance.meshes = files
                .filter_map(|file| Some((shipped(&file)?, file)))
                .map(|(content, file)| (file, (content, MediaType::GLB)))
                .collect();
        }
        appearance
    }

    /// The files of meshes that the robot's description names.
    pub fn mesh_files(&self) -> BTreeSet<String> {
        let Some(described) = &self.described else { return BTreeSet::new() };
        let attached = described.urdf.attached(&described.chain);
        attached.iter().flat_map(|link| mesh_files(link.visual).chain(mesh_files(link.collision))).collect()
    }

    /// The files of meshes of links that have neither a mesh whose content is known nor another shape, however small.
    pub fn undrawn_meshes(&self) -> BTreeSet<String> {
        let Some(described) = &self.described else { return BTreeSet::new() };
        let can_be_drawn = |shape: &Shape| match &shape.solid {
            Solid::Mesh { file, .. } => self.meshes.contains_key(file),
            _ => true,
        };
        let attached = described.urdf.attached(&described.chain);
        let bare = attached.iter().filter(|link| !link.visual.iter().chain(link.collision).any(can_be_drawn));
        bare.flat_map(|link| mesh_files(if link.visual.is_empty() { link.collision } else { link.visual })).collect()
    }

    /// Adds the content of a mesh file, by the name that the description has for it. `false` if it is of no kind that can be
    /// drawn: STL, OBJ and GLB can.
    pub fn add_mesh(&mut self, file: &str, content: Vec<u8>) -> bool {
        let ending = file.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase();
        let media_type = match ending.as_str() {
            "stl" => MediaType::STL,
            "obj" => MediaType::OBJ,
            "glb" => MediaType::GLB,
            _ => return false,
        };
        self.meshes.insert(file.to_owned(), (content.into(), media_type));
        true
    }
}

fn mesh_files(shapes: &[Shape]) -> impl Iterator<Item = String> {
    shapes.iter().filter_map(|shape| match &shape.solid {
        Solid::Mesh { file, .. } => Some(file.clone()),
        _ => None,
    })
}
