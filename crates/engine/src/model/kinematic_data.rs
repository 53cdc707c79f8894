//! One pass along the tree: where every link is, and how every learned parameter moves it.
//!
//! A parameter moves all that is behind it by a twist, whatever is measured there. In the frame of the measurements, with
//! A_{i−1} the motion of the link that carries joint i, and A_i = A_{i−1} e^{ξθ}:
//!
//! | parameter | twist (linear, angular) |
//! |---|---|
//! | axis, moved by η | `Ad_{A_{i-1}} η − Ad_{A_i} η` |
//! | what makes θ of the reading q, c·f(q) | `f(q) Ad_{A_{i-1}} ξ`: f = 1 for the offset, q for the ratio, sin q, cos q, the torque of a load |
//! | base (t + ν, exp(\[ω\]×) R) | `(ν − ω × t, ω)` |
//!
//! for all links that the joint moves (see [`Tree`](crate::kinematics::Tree)); the links come from the `kernel` of
//! [`kinematics`](crate::kinematics). What is measured between two frames moves by the difference of their twists.

use nalgebra::{DVector, Isometry3, Matrix3, Matrix3xX, Matrix6xX, Point3, Vector3, Vector6};

use super::{Block, Frame, Hand, Layout, State, links::Links};
use crate::kinematics::{Motion, Plain, Term, Twist};

/// How one tangent coordinate moves links.
#[derive(Clone, Copy, Debug)]
struct Column {
    /// Its place in the tangent vector.
    coordinate: usize,
    /// The joint, all of whose links it moves; `None` for the base, which is before all.
    joint: Option<usize>,
    twist: Twist,
}

/// The links and twists of one state, computed at one posture after another.
#[derive(Clone, Debug)]
pub struct KinematicData<'a> {
    layout: &'a Layout,
    /// The coordinates of each joint's corrections, and f.
    corrections: Vec<Vec<(usize, Term)>>,
    /// The place of each joint's axis, if it is learned.
    axes: Vec<Option<usize>>,
    links: Links<'a>,
    /// The columns of base, axes and corrections, joint by joint.
    columns: Vec<Column>,
}

impl<'a> KinematicData<'a> {
    /// A pass at no posture yet: call [`at`](Self::at) first.
    pub fn new(state: &'a State, layout: &'a Layout) -> Self {
        let corrections = layout.corrections();
        let loads = if layout.has_compliance() { state.loads.as_deref() } else { state.bending() };
        let needs_sine = |joint: usize| corrections[joint].iter().any(|(_, term)| term.needs_sine());
        let links = Links::with(state, loads, |_| true, needs_sine);
        let start = |joint| layout.point(joint).or_else(|| layout.direction(joint)).map(|range| range.start);
        let axes = (0..state.joints.len()).map(start).collect();
        let columns = Vec::with_capacity(layout.dimension());
        Self { layout, corrections, axes, links, columns }
    }

    /// The state that is passed.
    pub fn state(&self) -> &'a State {
        self.links.state()
    }

    /// The layout of what is learned.
    pub fn layout(&self) -> &'a Layout {
        self.layout
    }

    /// The readings of the present posture, rad or m, one per joint.
    pub fn positions(&self) -> &[f64] {
        self.links.positions()
    }

    /// Moves to readings `positions`, rad or m, one per joint.
    pub fn at(&mut self, positions: &[f64]) -> &mut Self {
        self.columns.clear();
        self.links.at(positions);
        if let Some(range) = self.layout.block(Block::Base) {
            let origin = &self.state().base.translation.vector;
            for (k, coordinate) in range.enumerate() {
                let unit = Vector3::ith(k % 3, 1.0);
                let (linear, angular) = if k < 3 { (unit, Vector3::zeros()) } else { (origin.cross(&unit), unit) };
                self.columns.push(Column { coordinate, joint: None, twist: Twist { linear, angular } });
            }
        }
        for joint in 0..positions.len() {
            self.pass(joint);
        }
        self
    }

    /// Collects the twists of a joint.
    #[inline]
    fn pass(&mut self, joint: usize) {
        let (kind, turned) = (self.state().joints[joint].kind(), self.links.joint(joint));
        let mut put = |coordinate, twist| self.columns.push(Column { coordinate, joint: Some(joint), twist });
        if let Some(start) = self.axes[joint] {
            turned.axis_twists(kind, |k, twist| put(start + k, twist));
        }
        let Twist { linear, angular } = turned.twist(kind);
        let torques = self.links.torques(joint);
        for &(coordinate, term) in &self.corrections[joint] {
            let (f, _) = term.factor(Plain, turned.reading, &torques);
            put(coordinate, Twist { linear: linear * f, angular: angular * f });
        }
    }

    /// The twists of base, axes and corrections that move a link, with their coordinates.
    #[inline]
    fn twists(&self, link: usize) -> impl Iterator<Item = (usize, &Twist)> {
        let tree = &self.state().tree;
        // A joint comes before the links that it moves.
        let columns = self.columns.iter().take_while(move |column| column.joint.is_none_or(|joint| joint < link));
        let moving = columns.filter(move |column| column.joint.is_none_or(|joint| tree.moves(joint, link)));
        moving.map(|column| (column.coordinate, &column.twist))
    }

    /// The motion of a link: from θ = 0 in the robot's frame into the frame of the measurements.
    pub fn link(&self, link: usize) -> Motion {
        self.links.link(link)
    }

    /// Where the links are.
    pub fn links(&self) -> &Links<'a> {
        &self.links
    }

    /// The position of a target, metres.
    #[inline]
    pub fn target(&self, target: usize) -> Vector3<f64> {
        self.links.target(target)
    }

    /// Hands every column of ∂x/∂δ that is not zero to `column`, x being the origin of a target, metres; returns x.
    #[inline]
    pub fn point_columns(&self, target: usize, mut column: impl FnMut(usize, Vector3<f64>)) -> Vector3<f64> {
        let link = self.state().targets[target].link;
        let x = self.target(target);
        for (coordinate, twist) in self.twists(link) {
            column(coordinate, twist.at(&x));
        }
        if let Some(range) = self.layout.block(Block::Target(target)) {
            let rotation = self.links.link(link).rotation;
            (0..3).for_each(|k| column(range.start + k, rotation.column(k).into_owned()));
        }
        x
    }

    /// The pose of a frame.
    pub fn pose(&self, frame: Frame) -> Isometry3<f64> {
        self.links.pose(frame)
    }

    /// Hands the twist of every coordinate that moves a frame to `each`, with the velocity of the frame's point that is `arm` (metres)
    /// from its origin.
    fn twists_at(&self, frame: Frame, origin: &Vector3<f64>, arm: &Vector3<f64>, mut each: impl FnMut(usize, Twist)) {
        let link = self.state().link_of(frame);
        let own = match frame {
            Frame::Link(_) => None,
            Frame::Target(target) => self.layout.block(Block::Target(target)),
            Frame::Device(device) => self.layout.block(Block::Device(device)),
        };
        let x = origin + arm;
        for (coordinate, twist) in link.into_iter().flat_map(|link| self.twists(link)) {
            each(coordinate, Twist { linear: twist.at(&x), ..*twist });
        }
        let Some(own) = own else { return };
        let rotation = link.map_or(Matrix3::identity(), |link| self.links.link(link).rotation);
        for (k, coordinate) in own.enumerate() {
            let unit = rotation.column(k % 3).into_owned();
            let (linear, angular) = if k < 3 { (unit, Vector3::zeros()) } else { (unit.cross(arm), unit) };
            each(coordinate, Twist { linear, angular });
        }
    }

    /// The twist (6 × m; linear at the frame's own origin, then angular) by which every parameter moves a frame.
    pub fn frame_twists(&self, frame: Frame) -> Matrix6xX<f64> {
        let mut columns = Matrix6xX::zeros(self.layout.dimension());
        let origin = self.pose(frame).translation.vector;
        self.twists_at(frame, &origin, &Vector3::zeros(), |coordinate, Twist { linear, angular }| {
            columns.fixed_view_mut::<3, 1>(0, coordinate).copy_from(&linear);
            columns.fixed_view_mut::<3, 1>(3, coordinate).copy_from(&angular);
        });
        columns
    }

    /// The twist (6 × m; linear at the frame's own origin, then angular; in the frame `seen_from`) by which every parameter moves a
    /// frame as seen from another: the difference of the two frames' twists.
    pub fn relative_twists(&self, frame: Frame, seen_from: Frame) -> Matrix6xX<f64> {
        let mut columns = Matrix6xX::zeros(self.layout.dimension());
        let [x, observer] = [frame, seen_from].map(|frame| self.pose(frame));
        let (back, arm) = (observer.rotation.inverse(), x.translation.vector - observer.translation.vector);
        for (of, origin, arm, sign) in [(frame, x, Vector3::zeros(), 1.0), (seen_from, observer, arm, -1.0)] {
            self.twists_at(of, &origin.translation.vector, &arm, |coordinate, Twist { linear, angular }| {
                let mut linear_and_angular = columns.column_mut(coordinate);
                linear_and_angular.fixed_rows_mut::<3>(0).axpy(sign, &(back * linear), 1.0);
                linear_and_angular.fixed_rows_mut::<3>(3).axpy(sign, &(back * angular), 1.0);
            });
        }
        columns
    }

    /// The adjoint of [`frame_twists`](Self::frame_twists): turns the derivative of a value by the frame's motion (by the velocity of
    /// its origin, then by its angular velocity) into its derivative by all coordinates (m).
    pub fn adjoint(&self, frame: Frame, by_twist: &Vector6<f64>) -> DVector<f64> {
        let mut slope = DVector::zeros(self.layout.dimension());
        let (force, torque) = (by_twist.fixed_rows::<3>(0), by_twist.fixed_rows::<3>(3));
        let origin = self.pose(frame).translation.vector;
        self.twists_at(frame, &origin, &Vector3::zeros(), |coordinate, Twist { linear, angular }| {
            slope[coordinate] += force.dot(&linear) + torque.dot(&angular);
        });
        slope
    }
}

/// What predictions are about, [`State::predicted_at`], metres, and its Jacobian (3 × m; metres per unit of each coordinate).
pub fn prediction_jacobian(state: &State, layout: &Layout, positions: &[f64]) -> (Point3<f64>, Matrix3xX<f64>) {
    let Some(observer) = state.seen_from else { return jacobian(state, layout, positions) };
    let mut data = KinematicData::new(state, layout);
    data.at(positions);
    let [hand, observer] = [state.hand, observer].map(Hand::frame);
    let place = data.pose(observer).inverse() * data.pose(hand);
    let h = data.relative_twists(hand, observer).fixed_rows::<3>(0).into_owned();
    (Point3::from(place.translation.vector), h)
}

/// The marker p(θ), metres, and its Jacobian H = ∂p/∂δ (3 × m; metres per unit of each coordinate).
pub fn jacobian(state: &State, layout: &Layout, positions: &[f64]) -> (Point3<f64>, Matrix3xX<f64>) {
    let mut h = Matrix3xX::zeros(layout.dimension());
    let mut data = KinematicData::new(state, layout);
    data.at(positions);
    let marker = match state.hand {
        Hand::Target(target) => data.point_columns(target, |coordinate, column| h.set_column(coordinate, &column)),
        Hand::Device(_) => {
            h.copy_from(&data.frame_twists(state.hand.frame()).fixed_rows::<3>(0));
            data.pose(state.hand.frame()).translation.vector
        }
    };
    (Point3::from(marker), h)
}
