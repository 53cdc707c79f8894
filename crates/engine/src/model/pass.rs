//! One pass over the chain: where every link is, and how every learned parameter moves it.
//!
//! A parameter moves all that is behind it by a twist, whatever is measured there. In the frame of the measurements, with
//! A_{i−1} the motion of base and joints before joint i, and A_i = A_{i−1} e^{ξθ}:
//!
//! | parameter | twist (linear, angular) |
//! |---|---|
//! | axis, moved by η | `Ad_{A_{i-1}} η − Ad_{A_i} η` |
//! | what makes θ of the reading q, c·f(q) | `f(q) Ad_{A_{i-1}} ξ`: f = 1 for the offset, q for the ratio, sin q, cos q, the torque of a load |
//! | base (t + ν, exp(\[ω\]×) R) | `(ν − ω × t, ω)` |
//!
//! The linear part is the velocity of the point that is at the origin, so that a point at x moves by `linear + angular × x`.
//! For an axis (v, w) with the basis b₁, b₂ = w × b₁ the first row is, with D = (R_{i−1} − R_i)\[b₁ b₂\] = \[d₁ d₂\] and the
//! pivot at q = A_{i−1} v = A_i v,
//!
//! ```text
//! point        (d₁, 0), (d₂, 0)
//! direction    (q × d₂, d₂), (−q × d₁, −d₁)       revolute
//!              (θ R_{i−1} b₁, 0), (θ R_{i−1} b₂, 0)   prismatic
//! ```

use nalgebra::{
    Isometry3, Matrix3, Matrix3x2, Matrix3xX, Matrix6xX, Point3, Rotation3, Translation3, UnitQuaternion, Vector3,
};

use super::{Block, Hand, Layout, Load, Loads, State};
use crate::{
    elementary::{cos, sin},
    kinematics::{Joint, chart},
};

/// A rigid motion as a matrix and a shift: `x ↦ R x + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// R.
    pub rotation: Matrix3<f64>,
    /// t, metres.
    pub translation: Vector3<f64>,
}

impl Motion {
    fn of(pose: &Isometry3<f64>) -> Self {
        Self { rotation: *pose.rotation.to_rotation_matrix().matrix(), translation: pose.translation.vector }
    }

    /// R x + t.
    pub fn point(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x + self.translation
    }

    /// The same as a pose.
    pub fn pose(&self) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotation);
        Isometry3::from_parts(Translation3::from(self.translation), UnitQuaternion::from_rotation_matrix(&rotation))
    }
}

/// How one tangent coordinate moves all links from one on.
#[derive(Clone, Copy, Debug)]
struct Twist {
    /// Its place in the tangent vector.
    coordinate: usize,
    /// The first link that it moves; 0 is the base.
    from: usize,
    /// Velocity of the point at the origin of the frame of the measurements, metres per unit of the coordinate.
    linear: Vector3<f64>,
    /// Angular velocity, radians per unit.
    angular: Vector3<f64>,
}

/// A frame that parameters move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Of a link.
    Link(usize),
    /// Of a target.
    Target(usize),
    /// Of a device.
    Device(usize),
}

/// Links and twists of one state at one posture after another.
#[derive(Clone, Debug)]
pub struct Pass<'a> {
    state: &'a State,
    layout: &'a Layout,
    /// By joint: the coordinates of its corrections, and f.
    corrections: Vec<Vec<(usize, Term)>>,
    /// By joint: where its axis stands (usize::MAX if it is not learned), and its basis.
    axes: Vec<(usize, Matrix3x2<f64>)>,
    /// Where joints give way, or may be learned to.
    loads: Option<&'a Loads>,
    /// By joint: what it bears, N·m per kg; empty without loads.
    torques: Vec<[f64; 2]>,
    /// Where it stands.
    positions: Vec<f64>,
    links: Vec<Motion>,
    /// Of base, axes and corrections, those that move the links nearest to the base first.
    twists: Vec<Twist>,
}

/// f: what moves θ in proportion to a parameter.
#[derive(Clone, Copy, Debug)]
pub(super) enum Term {
    Offset,
    Ratio,
    Sine,
    Cosine,
    Torque(Load),
}

const HELD: usize = usize::MAX;

impl<'a> Pass<'a> {
    /// At no posture yet: [`at`](Self::at) comes first.
    pub fn new(state: &'a State, layout: &'a Layout) -> Self {
        let mut corrections = vec![Vec::new(); state.joints.len()];
        let mut loads = state.bending();
        for (block, range) in layout.blocks() {
            let (joint, terms) = match block {
                Block::Offset(joint) => (joint, [Some(Term::Offset), None]),
                Block::Ratio(joint) => (joint, [Some(Term::Ratio), None]),
                Block::Eccentricity(joint) => (joint, [Some(Term::Sine), Some(Term::Cosine)]),
                Block::Compliance(joint, load) => {
                    loads = state.loads.as_deref();
                    (joint, [Some(Term::Torque(load)), None])
                }
                _ => continue,
            };
            corrections[joint].extend(range.zip(terms.into_iter().flatten()));
        }
        let axes = state.joints.iter().enumerate();
        let axes = axes.map(|(joint, axis)| {
            let start = layout.point(joint).or_else(|| layout.direction(joint)).map_or(HELD, |range| range.start);
            (start, chart::basis(&axis.direction()))
        });
        let axes = axes.collect();
        let (links, twists) = (Vec::with_capacity(state.joints.len() + 1), Vec::with_capacity(layout.dimension()));
        let positions = Vec::with_capacity(state.joints.len());
        Self { state, layout, corrections, axes, loads, torques: Vec::new(), positions, links, twists }
    }

    /// The state.
    pub fn state(&self) -> &'a State {
        self.state
    }

    /// What of it is learned.
    pub fn layout(&self) -> &'a Layout {
        self.layout
    }

    /// The readings where it stands, rad or m, one per joint.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Moves to readings `positions`, rad or m, one per joint.
    pub fn at(&mut self, positions: &[f64]) -> &mut Self {
        debug_assert_eq!(positions.len(), self.state.joints.len());
        self.links.clear();
        self.twists.clear();
        self.positions.clear();
        self.positions.extend_from_slice(positions);
        let mut link = Motion::of(&self.state.base);
        if let Some(range) = self.layout.block(Block::Base) {
            for (k, coordinate) in range.enumerate() {
                let unit = Vector3::ith(k % 3, 1.0);
                let (linear, angular) =
                    if k < 3 { (unit, Vector3::zeros()) } else { (link.translation.cross(&unit), unit) };
                self.twists.push(Twist { coordinate, from: 0, linear, angular });
            }
        }
        self.links.push(link);
        if let Some(loads) = self.loads {
            self.torques = loads.torques(positions);
        }
        for (index, &reading) in positions.iter().enumerate() {
            link = self.pass_joint(index, reading, &link);
            self.links.push(link);
        }
        self
    }

    /// Collects the twists of a joint behind `before`, and goes on to the link behind it.
    #[inline]
    fn pass_joint(&mut self, index: usize, reading: f64, before: &Motion) -> Motion {
        let joint = &self.state.joints[index];
        let torques = self.torques.get(index).copied().unwrap_or_default();
        let correction = &self.state.corrections[index];
        let theta = correction.position(reading) + correction.given_way(&torques);
        let (start, basis) = &self.axes[index];
        let from = index + 1;
        let mut put = |coordinate, linear, angular| self.twists.push(Twist { coordinate, from, linear, angular });
        let (axis_linear, axis_angular, after) = match joint {
            Joint::Revolute(line) => {
                let rotation = before.rotation * Rotation3::from_axis_angle(&line.direction, theta).matrix();
                let pivot = before.point(&line.point.coords);
                let translation = pivot - rotation * line.point.coords;
                if *start != HELD {
                    let turned = (before.rotation - rotation) * basis;
                    let (d1, d2) = (turned.column(0).into_owned(), turned.column(1).into_owned());
                    put(*start, d1, Vector3::zeros());
                    put(start + 1, d2, Vector3::zeros());
                    put(start + 2, pivot.cross(&d2), d2);
                    put(start + 3, d1.cross(&pivot), -d1);
                }
                let angular = before.rotation * line.direction.into_inner();
                (pivot.cross(&angular), angular, Motion { rotation, translation })
            }
            Joint::Prismatic(direction) => {
                let along = before.rotation * direction.into_inner();
                if *start != HELD {
                    let turned = before.rotation * basis * theta;
                    put(*start, turned.column(0).into_owned(), Vector3::zeros());
                    put(start + 1, turned.column(1).into_owned(), Vector3::zeros());
                }
                let translation = before.translation + along * theta;
                (along, Vector3::zeros(), Motion { rotation: before.rotation, translation })
            }
        };
        for &(coordinate, term) in &self.corrections[index] {
            let f = match term {
                Term::Offset => 1.0,
                Term::Ratio => reading,
                Term::Sine => sin(reading),
                Term::Cosine => cos(reading),
                Term::Torque(load) => torques[load as usize],
            };
            put(coordinate, axis_linear * f, axis_angular * f);
        }
        after
    }

    /// Where a link is: the motion from θ = 0 in the robot's frame into the frame of the measurements.
    pub fn link(&self, link: usize) -> &Motion {
        &self.links[link]
    }

    /// Where a target is, metres.
    #[inline]
    pub fn target(&self, target: usize) -> Vector3<f64> {
        let target = &self.state.targets[target];
        self.links[target.link].point(&target.place.origin().coords)
    }

    /// Hands every column of ∂x/∂δ that is not zero to `column`, x being the origin of a target, metres; returns x.
    #[inline]
    pub fn point_columns(&self, target: usize, mut column: impl FnMut(usize, Vector3<f64>)) -> Vector3<f64> {
        let link = self.state.targets[target].link;
        let x = self.target(target);
        for twist in self.twists.iter().take_while(|twist| twist.from <= link) {
            column(twist.coordinate, twist.linear + twist.angular.cross(&x));
        }
        if let Some(range) = self.layout.block(Block::Target(target)) {
            let rotation = &self.links[link].rotation;
            (0..3).for_each(|k| column(range.start + k, rotation.column(k).into_owned()));
        }
        x
    }

    /// Where a frame is.
    pub fn pose(&self, frame: Frame) -> Isometry3<f64> {
        match frame {
            Frame::Link(link) => self.links[link].pose(),
            Frame::Target(target) => {
                let target = &self.state.targets[target];
                self.links[target.link].pose() * target.place.frame()
            }
            Frame::Device(device) => {
                let device = &self.state.devices[device];
                device.link.map_or(device.pose, |link| self.links[link].pose() * device.pose)
            }
        }
    }

    /// The twist (linear at the frame's own origin, then angular; 6 × m) by which every parameter moves a frame.
    pub fn frame_twists(&self, frame: Frame) -> Matrix6xX<f64> {
        let mut columns = Matrix6xX::zeros(self.layout.dimension());
        let origin = self.pose(frame).translation.vector;
        let (link, own) = match frame {
            Frame::Link(link) => (Some(link), None),
            Frame::Target(target) => {
                let fixed = &self.state.targets[target];
                (Some(fixed.link), self.layout.block(Block::Target(target)))
            }
            Frame::Device(device) => (self.state.devices[device].link, self.layout.block(Block::Device(device))),
        };
        let mut put = |coordinate: usize, linear: &Vector3<f64>, angular: &Vector3<f64>| {
            columns.fixed_view_mut::<3, 1>(0, coordinate).copy_from(linear);
            columns.fixed_view_mut::<3, 1>(3, coordinate).copy_from(angular);
        };
        for twist in self.twists.iter().filter(|twist| link.is_some_and(|link| twist.from <= link)) {
            put(twist.coordinate, &(twist.linear + twist.angular.cross(&origin)), &twist.angular);
        }
        let rotation = link.map_or(Matrix3::identity(), |link| self.links[link].rotation);
        for (k, coordinate) in own.into_iter().flatten().enumerate() {
            let unit = rotation.column(k % 3).into_owned();
            let (linear, angular) = if k < 3 { (unit, Vector3::zeros()) } else { (Vector3::zeros(), unit) };
            put(coordinate, &linear, &angular);
        }
        columns
    }
}

/// The marker p(θ), metres, and its Jacobian H = ∂p/∂δ (3 × m; metres per unit of each coordinate).
pub fn jacobian(state: &State, layout: &Layout, positions: &[f64]) -> (Point3<f64>, Matrix3xX<f64>) {
    let mut h = Matrix3xX::zeros(layout.dimension());
    let mut pass = Pass::new(state, layout);
    pass.at(positions);
    let marker = match state.hand {
        Hand::Target(target) => pass.point_columns(target, |coordinate, column| h.set_column(coordinate, &column)),
        Hand::Device(_) => {
            h.copy_from(&pass.frame_twists(state.hand.frame()).fixed_rows::<3>(0));
            pass.pose(state.hand.frame()).translation.vector
        }
    };
    (Point3::from(marker), h)
}
