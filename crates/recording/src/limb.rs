//! The limbs of a robot that a figure is drawn around: the arm, and the head that looks on.

use nalgebra::{Isometry3, Point3};

use body_schema_engine::model::{Branch, Frame, State};
use body_schema_wire::JointDescription;

/// The beginnings of names of joints that are in the trunk, and of the first joint of an arm.
const TRUNK: [&str; 2] = ["torso", "chest"];
const SHOULDER: &str = "shoulder";
/// How many times longer than the hand's another limb must be to be taken for the arm.
const LONGER: f64 = 2.0;

/// The joints from the base to the end of a branch, and where they are at θ = 0, metres.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    /// The joints in order, those nearer to the base first.
    joints: Vec<usize>,
    /// The link that the joints of the trunk carry; 0, the base, if there are none.
    pub(super) trunk: usize,
    /// Where it begins: at the joint with the name of a shoulder, or else at the first that turns and is not in the trunk.
    pub(super) shoulder: Point3<f64>,
    /// The distance from there to its end when it is stretched out.
    pub(super) reach_m: f64,
}

impl Limb {
    /// The limb that ends with a branch.
    fn of(joints: &[JointDescription], arm: &State, branch: &Branch) -> Self {
        let name = |index: &usize| joints.get(*index).map_or("", |joint| joint.name.as_str());
        let outermost = branch.joints.last().or(branch.carrier.as_ref()).map_or(0, |joint| joint + 1);
        let mut path: Vec<usize> = arm.tree.path(outermost).collect();
        path.reverse();
        let in_trunk = path.iter().take_while(|index| TRUNK.iter().any(|trunk| name(index).starts_with(trunk))).count();
        let end = branch.end.map(|end| place(arm, end));
        let pivot = |place: usize| Some((place, arm.joints[path[place]].line()?.point));
        let points: Vec<(usize, Point3<f64>)> = (0..path.len()).filter_map(pivot).collect();
        let begins = points.iter().find(|(place, _)| name(&path[*place]).starts_with(SHOULDER));
        let begins = begins.or(points.iter().find(|(place, _)| *place >= in_trunk));
        let (first, shoulder) = begins.copied().unwrap_or((0, end.unwrap_or(arm.marker())));
        let line = points.iter().filter(|(place, _)| *place >= first).map(|(_, point)| *point).chain(end);
        let line: Vec<Point3<f64>> = line.collect();
        let reach_m = line.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum();
        let trunk = in_trunk.checked_sub(1).map_or(0, |last| path[last] + 1);
        Self { joints: path, trunk, shoulder, reach_m }
    }

    /// The first joint.
    pub(super) fn first(&self) -> Option<usize> {
        self.joints.first().copied()
    }
}

/// The limbs of a robot.
#[derive(Clone, Debug)]
pub(super) struct Limbs {
    /// The arm: the limb with the hand, unless another is more than twice as long.
    pub(super) arm: Limb,
    others: Vec<Limb>,
}

/// The head on a neck: its place and its look at θ = 0, and what carries it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gazing {
    /// The frame of its camera: z is ahead.
    pub(super) camera: Isometry3<f64>,
    /// Its link.
    pub(super) link: usize,
    /// Where its neck begins.
    pub(super) neck: Point3<f64>,
}

impl Limbs {
    pub(super) fn of(joints: &[JointDescription], arm: &State) -> Self {
        let mut limbs: Vec<Limb> = arm.branches().iter().map(|branch| Limb::of(joints, arm, branch)).collect();
        let longest = (0..limbs.len()).max_by(|a, b| limbs[*a].reach_m.total_cmp(&limbs[*b].reach_m)).unwrap_or(0);
        let is_longer = limbs[longest].reach_m > LONGER * limbs[0].reach_m;
        let arm = limbs.remove(if is_longer { longest } else { 0 });
        Self { arm, others: limbs }
    }

    /// The first other limb with a camera on its last link that is no arm itself.
    pub(super) fn head(&self, arm: &State) -> Option<Gazing> {
        self.others.iter().filter(|limb| !self.is_arm(limb)).find_map(|limb| {
            let link = limb.joints.last()? + 1;
            let camera = arm.devices.iter().find(|device| device.link == Some(link))?.pose;
            Some(Gazing { camera, link, neck: limb.shoulder })
        })
    }

    /// Whether there is another arm.
    pub(super) fn has_another_arm(&self) -> bool {
        self.others.iter().any(|limb| self.is_arm(limb))
    }

    /// Whether a limb is at least half as long as the arm.
    fn is_arm(&self, limb: &Limb) -> bool {
        2.0 * limb.reach_m >= self.arm.reach_m
    }

    /// Where the other limbs begin that stand on the base beside the arm.
    pub(super) fn beside(&self, arm: &State) -> Vec<Point3<f64>> {
        let stands = |limb: &Limb| {
            let first = limb.first().filter(|first| Some(*first) != self.arm.first())?;
            (limb.joints.iter())
                .find_map(|joint| arm.joints[*joint].line())
                .filter(|_| arm.tree.parent(first).is_none())
        };
        self.others.iter().filter_map(|limb| Some(stands(limb)?.point)).collect()
    }
}

/// Where a frame is at θ = 0.
fn place(arm: &State, frame: Frame) -> Point3<f64> {
    match frame {
        Frame::Link(_) => Point3::origin(),
        Frame::Target(target) => arm.targets[target].place.origin(),
        Frame::Device(device) => Point3::from(arm.devices[device].pose.translation.vector),
    }
}
