//! The meshes that a robot's description names, read for recordings from the files beside it.

use std::path::Path;

use body_schema_files::mesh;
use body_schema_recording::Appearance;
use body_schema_scenario::Scenario;

use super::{input::files_of, output};

/// How many meshes that are not drawn are named.
const NAMED: usize = 3;

/// How a scenario looks, which was loaded by this name, with the meshes of its description. Links whose meshes cannot be drawn are told
/// on standard error; those of built-in scenarios do not ship.
pub fn appearance(name: &str, scenario: &Scenario) -> Appearance {
    let mut appearance = Appearance::of(scenario);
    let Some(described) = &scenario.robot.described else { return appearance };
    if files_of(name, scenario).is_empty() {
        return appearance;
    }
    let description = Path::new(name).parent().unwrap_or(Path::new("")).join(&described.file);
    let mut untold = Vec::new();
    for file in appearance.mesh_files() {
        let added = mesh(&description, &file).and_then(|content| {
            let is_drawn = appearance.add_mesh(&file, content);
            is_drawn.then_some(()).ok_or_else(|| "only STL, OBJ and GLB are drawn".to_owned())
        });
        untold.extend(added.err().map(|why| (file, why)));
    }
    let bare = appearance.undrawn_meshes();
    untold.retain(|(file, _)| bare.contains(file));
    for (file, why) in untold.iter().take(NAMED) {
        output::tell(format_args!("warning: the mesh {file} is not drawn: {why}; a capsule stands for its link"));
    }
    if let Some(more) = untold.len().checked_sub(NAMED).filter(|more| *more > 0) {
        output::tell(format_args!("warning: {more} more meshes are not drawn"));
    }
    appearance
}
