//! The view of cameras: their pictures' planes, the known points of targets, and the rays from one to the other.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{
    TRUTH_COLOR,
    posture::Posture,
    rerun::{AsComponents, Color, EntityPath, LineStrips3D, Points3D, Radius},
    rows::Rows,
    scenery::Scenery,
    solid::single,
};
use body_schema_engine::model::State;
use body_schema_wire::{Description, MovementReport};

/// The colour of rays, which is that of measurements.
const RAY: [u8; 4] = [0xE6, 0xB4, 0x22, 150];
/// The drawn distance from a camera to its picture, and the radius of a known point, as parts of the arm's reach.
const DEPTH: f64 = 0.16;
const POINT: f64 = 0.012;
/// The most points of a target that is outlined: with more, their order is no outline.
const OUTLINED: usize = 4;
/// The distance, metres and radians, below which two frames count as equal.
const SAME: f64 = 1e-9;

type Strip = Vec<[f32; 3]>;

/// Cameras and targets of an arm in one posture.
struct Sight {
    /// By camera: its frame, and the sides of its picture at depth 1: left, right, upper, lower.
    cameras: Vec<(Isometry3<f64>, [f64; 4])>,
    /// By target: its known points.
    targets: Vec<Vec<Point3<f64>>>,
}

/// Whether there is anything to draw of it: a camera, or a target beside the marker on a robot that branches.
pub(super) fn is_drawn(scenery: &Scenery<'_>) -> bool {
    let Description { cameras, targets, .. } = scenery.description;
    !cameras.is_empty() || (scenery.branches && targets.len() > 1)
}

impl Sight {
    fn of(arm: &State, posture: &Posture, scenery: &Scenery<'_>) -> Self {
        let description = scenery.description;
        let carried =
            |link: usize, frame: &Isometry3<f64>| posture.links.get(link).copied().unwrap_or_default() * frame;
        let cameras = arm.devices.iter().zip(&description.cameras).filter_map(|(device, camera)| {
            let ([fx, fy, cx, cy], [width, height]) = (device.intrinsics?, camera.size_px);
            let sides = [-cx / fx, (width - cx) / fx, -cy / fy, (height - cy) / fy];
            Some((device.link.map_or(device.pose, |link| carried(link, &device.pose)), sides))
        });
        // The first is the marker once more.
        let targets = arm.targets.iter().skip(1).zip(&description.targets).map(|(target, known)| {
            let frame = carried(target.link, &target.place.frame());
            known.points_m.iter().map(|point| frame * Point3::from(*point)).collect()
        });
        Self { cameras: cameras.collect(), targets: targets.collect() }
    }

    /// Pictures and the lines to their corners, and the outlines of tags.
    fn strips(&self, reach_m: f64, other: Option<&Self>) -> Vec<Strip> {
        let mut strips = Vec::new();
        for (index, (frame, [left, right, upper, lower])) in self.cameras.iter().enumerate() {
            let same = |(there, _): &(Isometry3<f64>, _)| (frame.inverse() * there).to_homogeneous();
            let is_there = other.and_then(|other| other.cameras.get(index)).map(same);
            if is_there.is_some_and(|way| (way - nalgebra::Matrix4::identity()).amax() < SAME) {
                continue;
            }
            let corner = |x: f64, y: f64| drawn(&(frame * Point3::from(Vector3::new(x, y, 1.0) * (DEPTH * reach_m))));
            let corners = [(*left, *upper), (*right, *upper), (*right, *lower), (*left, *lower)];
            let corners = corners.map(|(x, y)| corner(x, y));
            let eye = drawn(&Point3::from(frame.translation.vector));
            strips.push(closed(&corners));
            strips.extend(corners.iter().map(|corner| vec![eye, *corner]));
            // A notch above the picture says which way is up.
            let (middle, width) = (0.5 * (left + right), 0.2 * (right - left));
            let notch = [(middle - width, *upper), (middle, 1.3 * upper), (middle + width, *upper)];
            strips.push(notch.map(|(x, y)| corner(x, y)).to_vec());
        }
        let tags = self.targets.iter().filter(|points| (3..=OUTLINED).contains(&points.len()));
        strips.extend(tags.map(|points| closed(&points.iter().map(drawn).collect::<Vec<_>>())));
        strips
    }

    /// The rays from every camera to the points that it saw.
    fn rays(&self, movement: &MovementReport, scenery: &Scenery<'_>) -> Vec<Strip> {
        let seen = movement.readings.iter().filter(|reading| reading.residual_sigmas.is_some());
        let channels = seen.filter_map(|reading| scenery.description.channels.get(reading.channel));
        let pairs = channels.filter_map(|channel| {
            let (eye, _) = self.cameras.get(channel.camera?)?;
            Some((Point3::from(eye.translation.vector), self.targets.get(channel.target?)?))
        });
        pairs.flat_map(|(eye, points)| points.iter().map(move |point| vec![drawn(&eye), drawn(point)])).collect()
    }
}

/// Logs cameras and targets, true and believed, at `ticks` after a step, below the entities and in the colour of a learner; with a
/// movement, also what was seen in it. An arm that is moving has seen nothing yet.
pub(super) fn log(
    rows: &mut Rows,
    (step, ticks): (u64, u64),
    (entity, colour): (&dyn Fn(&'static str) -> EntityPath, [u8; 3]),
    [truth, estimate]: [Option<(&State, &Posture)>; 2],
    movement: Option<&MovementReport>,
    scenery: &Scenery<'_>,
) {
    let reach_m = scenery.stage.figure.reach_m;
    let [truth, estimate] = [truth, estimate].map(|arm| arm.map(|(arm, posture)| Sight::of(arm, posture, scenery)));
    let mut put = |path: &'static str, what: &dyn AsComponents| {
        let entity = entity(path);
        if ticks == 0 { rows.at(step, &entity, &[what]) } else { rows.after(step, ticks, &entity, &[what]) }
    };
    let lines = |strips: Vec<Strip>, colour: Color, width: f32| {
        LineStrips3D::new(strips).with_colors([colour]).with_radii([Radius::new_ui_points(width)])
    };
    let points = |sight: Option<&Sight>, colour: [u8; 3]| {
        Points3D::new(sight.into_iter().flat_map(|sight| sight.targets.iter().flatten()).map(drawn))
            .with_colors([Color::from(colour)])
            .with_radii([Radius::new_scene_units((POINT * reach_m) as f32)])
    };
    if scenery.truth.is_some() {
        let strips = truth.as_ref().map(|truth| truth.strips(reach_m, None)).unwrap_or_default();
        put("sight/truth", &lines(strips, TRUTH_COLOR.into(), 1.5));
        put("sight/truth/points", &points(truth.as_ref(), TRUTH_COLOR));
    }
    let strips = estimate.as_ref().map(|estimate| estimate.strips(reach_m, truth.as_ref())).unwrap_or_default();
    put("sight/estimate", &lines(strips, colour.into(), 1.5));
    put("sight/estimate/points", &points(estimate.as_ref(), colour));
    let [red, green, blue, alpha] = RAY;
    let rays =
        truth.as_ref().or(estimate.as_ref()).zip(movement).map(|(sight, movement)| sight.rays(movement, scenery));
    let ray = Color::from_unmultiplied_rgba(red, green, blue, alpha);
    put("sight/rays", &lines(rays.unwrap_or_default(), ray, 0.7));
}

fn drawn(point: &Point3<f64>) -> [f32; 3] {
    single(point.coords.into())
}

fn closed(points: &[[f32; 3]]) -> Strip {
    points.iter().chain(points.first()).copied().collect()
}
