//! A structure with its axes, and where it predicts targets to be.

use body_schema_engine::kinematics::{Joint, JointKind};
use nalgebra::{Isometry3, Point3};

use crate::data::{Data, Reading};

/// A column's part in the position of a joint: ratio · (θ − θ₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// The column.
    pub column: usize,
    /// How much the joint moves per unit of the column; 1 where the column reads the joint itself.
    pub ratio: f64,
    /// Whether the ratio is learned.
    pub is_free: bool,
}

/// A joint of a robot that is being discovered.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven {
    /// What drives it: the first column names the joint, others are coupled to it.
    pub drives: Vec<Drive>,
    /// The joint that carries it, of a lower index; `None` for the ground.
    pub parent: Option<usize>,
    /// The axis at the middle posture θ₀, in the frame of the measurements, m.
    pub axis: Joint,
}

impl Driven {
    /// A joint that one column reads.
    pub fn new(column: usize, parent: Option<usize>, axis: Joint) -> Self {
        Self { drives: vec![Drive { column, ratio: 1.0, is_free: false }], parent, axis }
    }

    /// The column that names the joint.
    pub fn column(&self) -> usize {
        self.drives[0].column
    }

    /// The position of the joint relative to θ₀, rad or m.
    pub fn position(&self, positions: &[f64], middle: &[f64]) -> f64 {
        self.drives.iter().map(|drive| drive.ratio * (positions[drive.column] - middle[drive.column])).sum()
    }
}

/// Where a target hangs.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The joint that carries it; `None` for the ground.
    pub carrier: Option<usize>,
    /// Its pose at θ₀, m; of a point the translation alone means something.
    pub home: Isometry3<f64>,
    /// Whether its rotation is measured.
    pub is_pose: bool,
}

/// A robot: with qᵢ = Σ ratio (θ − θ₀) over the drives of joint i, a target is at `e^{ξ₁q₁} … e^{ξₙqₙ} home`, the product over the
/// joints from the ground to its carrier.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// θ₀ by column, rad or m.
    pub middle: Vec<f64>,
    /// The joints; each parent stands before its children.
    pub joints: Vec<Driven>,
    /// The targets.
    pub targets: Vec<Held>,
}

impl Robot {
    /// A chain without joints that holds the targets where they are in the mean.
    pub fn still(data: &Data) -> Self {
        let middle = data.middle();
        let targets = (0..data.targets.len()).map(|target| {
            let first = data.rows.iter().find_map(|row| row.readings[target]);
            let home = match first {
                Some(Reading::Pose(pose)) => pose,
                Some(Reading::Point(point)) => Isometry3::translation(point.x, point.y, point.z),
                None => Isometry3::identity(),
            };
            Held { carrier: None, home, is_pose: data.targets[target].is_pose }
        });
        Self { middle, joints: Vec::new(), targets: targets.collect() }
    }

    /// The motion of every joint's link at θ, m.
    pub fn motions(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut motions: Vec<Isometry3<f64>> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let own = joint.axis.exp(joint.position(positions, &self.middle));
            motions.push(joint.parent.map_or(own, |parent| motions[parent] * own));
        }
        motions
    }

    /// Where the targets are at θ, m.
    pub fn predict(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let motions = self.motions(positions);
        self.targets.iter().map(|held| held.carrier.map_or(held.home, |joint| motions[joint] * held.home)).collect()
    }

    /// The columns that drive a target, in the order of their joints from the ground.
    pub fn chain_of(&self, target: usize) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut at = self.targets[target].carrier;
        while let Some(joint) = at {
            chain.push(joint);
            at = self.joints[joint].parent;
        }
        chain.reverse();
        chain
    }

    /// The number of parameters: 4 per revolute, 2 per prismatic joint, one per learned ratio, 6 per pose and 3 per point.
    pub fn parameters(&self) -> usize {
        let joint = |joint: &Driven| {
            joint.axis.degrees_of_freedom() + joint.drives.iter().filter(|drive| drive.is_free).count()
        };
        let held = |held: &Held| if held.is_pose { 6 } else { 3 };
        self.joints.iter().map(joint).sum::<usize>() + self.targets.iter().map(held).sum::<usize>()
    }

    /// Whether every joint has a ratio of its own that is 1 and no other column.
    pub fn is_plain(&self) -> bool {
        self.joints.iter().all(|joint| joint.drives.len() == 1 && !joint.drives[0].is_free)
    }

    /// The structure in a form that can be compared: per joint its columns, kind and parent; per target its carrier.
    pub fn shape(&self) -> Shape {
        Shape {
            joints: self
                .joints
                .iter()
                .map(|joint| {
                    (
                        joint.drives.iter().map(|drive| drive.column).collect(),
                        joint.axis.kind() == JointKind::Revolute,
                        joint.parent,
                    )
                })
                .collect(),
            carriers: self.targets.iter().map(|held| held.carrier).collect(),
        }
    }

    /// The same robot with its axes written at the posture `middle`.
    pub fn rebased(&self, middle: &[f64]) -> Self {
        let motions = self.motions(middle);
        let mut moved = self.clone();
        moved.middle = middle.to_vec();
        for joint in &mut moved.joints {
            if let Some(parent) = joint.parent {
                joint.axis = joint.axis.transformed(&motions[parent]);
            }
        }
        for held in &mut moved.targets {
            if let Some(joint) = held.carrier {
                held.home = motions[joint] * held.home;
            }
        }
        moved
    }

    /// Writes every line with its pivot nearest to a point, m.
    pub fn pivot_near(&mut self, point: &Point3<f64>) {
        for joint in &mut self.joints {
            if let Joint::Revolute(line) = &mut joint.axis {
                *line = line.slid_towards(point);
            }
        }
    }
}

/// A structure without its axes.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Shape {
    joints: Vec<(Vec<usize>, bool, Option<usize>)>,
    carriers: Vec<Option<usize>>,
}
