//! An arm as it is drawn in a posture: the shapes of its links, capsules for links without any, and a pin along each axis.

use nalgebra::Isometry3;

use super::{
    links::Links,
    posture::{ArmLook, Posture},
    rerun::{AsComponents, EntityPath},
    rows::Rows,
    solid::{self, moved, transform},
    values::cells,
};
use body_schema_engine::model::State;

/// An arm in a posture.
#[derive(Clone, Copy)]
pub(super) struct Arm<'a> {
    /// The frames of its links at θ = 0 ([`Drawing::frames`]).
    pub(super) frames: &'a [Isometry3<f64>],
    pub(super) posture: &'a Posture,
    pub(super) look: ArmLook,
}

/// What arms are drawn with.
#[derive(Clone, Copy)]
pub(super) struct Drawing<'a> {
    /// The shapes of the robot's links, if it has any.
    pub(super) links: Option<&'a Links>,
    /// The length of the arm.
    pub(super) reach_m: f64,
}

impl Drawing<'_> {
    /// The frames of an arm's links at θ = 0, in the frame of the measurements, in which its base stands at `base`. They are the same in
    /// every posture, and there are none without shapes.
    pub(super) fn frames(&self, arm: &State, base: &Isometry3<f64>) -> Vec<Isometry3<f64>> {
        self.links.map_or_else(Vec::new, |links| links.frames(arm, base))
    }
}

impl Arm<'_> {
    /// Logs it at a step.
    pub(super) fn log(&self, rows: &mut Rows, step: u64, entity: &EntityPath, Drawing { links, reach_m }: Drawing<'_>) {
        let capsules = self.posture.capsules(reach_m, self.look);
        let Some(links) = links else {
            let kind = capsules.len() as u64;
            rows.drawn(step, entity, solid::shapes(&capsules), (kind, || solid::look(&capsules)));
            return;
        };
        let capsules = links.beside(capsules);
        let cells = [solid::shapes(&capsules), links.cells(self.frames, self.posture)].concat();
        let kind = capsules.len() as u64;
        rows.drawn(step, entity, cells, (kind, || links.look(&solid::look(&capsules), self.look.links)));
        for (index, pose) in links.mesh_poses(self.frames, self.posture).iter().enumerate() {
            rows.at(step, &mesh(entity, index), &[&transform(pose)]);
        }
    }

    /// Logs its poses at `ticks` after a step, on the way to the next.
    pub(super) fn log_between(
        &self,
        rows: &mut Rows,
        (step, ticks): (u64, u64),
        entity: &EntityPath,
        Drawing { links, reach_m }: Drawing<'_>,
    ) {
        let capsules = self.posture.capsules(reach_m, self.look);
        let Some(links) = links else {
            rows.after(step, ticks, entity, &[&moved(&capsules)]);
            return;
        };
        let capsules = moved(&links.beside(capsules));
        let poses = [cells([&capsules as &dyn AsComponents]), links.cells(self.frames, self.posture)].concat();
        rows.after_plain(step, ticks, entity, poses);
        for (index, pose) in links.mesh_poses(self.frames, self.posture).iter().enumerate() {
            rows.after(step, ticks, &mesh(entity, index), &[&transform(pose)]);
        }
    }
}

/// Logs that there is no arm at a step.
pub(super) fn log_none(rows: &mut Rows, step: u64, entity: &EntityPath, links: Option<&Links>) {
    let cells = [solid::shapes(&[]), links.map(Links::no_cells).unwrap_or_default()].concat();
    rows.drawn(step, entity, cells, (0, || solid::look(&[])));
}

/// Logs what does not change of the meshes of an arm; steps move them.
pub(super) fn log_meshes(rows: &mut Rows, entity: &EntityPath, links: &Links, look: ArmLook) {
    for (index, (asset, place)) in links.meshes(look.links).enumerate() {
        rows.always(&mesh(entity, index), &[&asset, &place]);
    }
}

/// The entity of a mesh of an arm.
fn mesh(arm: &EntityPath, index: usize) -> EntityPath {
    arm.join(&EntityPath::from(format!("mesh-{}", index + 1)))
}
