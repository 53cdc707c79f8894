//! How the joints' readings move a robot's links, at one posture.
//!
//! A joint j moves what is fixed to a link by its twist, if the link is behind it (see [`Tree`](crate::kinematics::Tree)): the Jacobian
//! has the column `Ad ξⱼ ∂θⱼ/∂qⱼ`, and 0 where j moves another branch. A frame measured from another moves by the difference of their two
//! twists, so a joint that carries both does not count.

use nalgebra::{Const, Dyn, Isometry3, Matrix3xX, Matrix6xX, OMatrix, Point3, Vector3};

use super::{Frame, Load, State, Target};
use crate::kinematics::{Joint, Twist};

impl State {
    /// J = ∂p/∂q of a target by the readings of all joints (3 × n), m per rad or m; frame of the measurements.
    pub fn target_jacobian(&self, target: usize, positions: &[f64]) -> Matrix3xX<f64> {
        let links = self.links(positions);
        let Target { link, place } = &self.targets[target];
        let mut jacobian = Matrix3xX::zeros(positions.len());
        self.joint_twists(&links, *link, &(links[*link] * place.origin()), |joint, twist| {
            jacobian.set_column(joint, &twist.linear);
        });
        self.by_readings(&jacobian, positions)
    }

    /// How the readings of all joints move a frame: the velocity of its origin, m per rad or m, then its angular velocity, rad per rad
    /// or m (6 × n; frame of the measurements).
    pub fn frame_jacobian(&self, frame: Frame, positions: &[f64]) -> Matrix6xX<f64> {
        let at = Point3::from(self.frame_at(frame, positions).translation.vector);
        self.by_readings(&self.twists_at(frame, &at, positions), positions)
    }

    /// Where a frame is, seen from another at readings `positions` (rad or m, one per joint).
    pub fn relative(&self, frame: Frame, seen_from: Frame, positions: &[f64]) -> Isometry3<f64> {
        self.frame_at(seen_from, positions).inverse() * self.frame_at(frame, positions)
    }

    /// The Jacobian (6 × n) of a frame as seen from another: like [`frame_jacobian`](Self::frame_jacobian), but relative to and in
    /// the frame `seen_from`.
    pub fn relative_jacobian(&self, frame: Frame, seen_from: Frame, positions: &[f64]) -> Matrix6xX<f64> {
        let at = Point3::from(self.frame_at(frame, positions).translation.vector);
        let mut apart = self.twists_at(frame, &at, positions) - self.twists_at(seen_from, &at, positions);
        let back = self.frame_at(seen_from, positions).rotation.inverse();
        for mut column in apart.column_iter_mut() {
            let [linear, angular] = [0, 3].map(|first| back * column.fixed_rows::<3>(first).into_owned());
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
            column.fixed_rows_mut::<3>(3).copy_from(&angular);
        }
        self.by_readings(&apart, positions)
    }

    /// How the positions of all joints move a frame, with the velocity of its point that is at `x`.
    fn twists_at(&self, frame: Frame, x: &Point3<f64>, positions: &[f64]) -> Matrix6xX<f64> {
        let mut jacobian = Matrix6xX::zeros(positions.len());
        if let Some(link) = self.link_of(frame) {
            self.joint_twists(&self.links(positions), link, x, |joint, Twist { linear, angular }| {
                jacobian.fixed_view_mut::<3, 1>(0, joint).copy_from(&linear);
                jacobian.fixed_view_mut::<3, 1>(3, joint).copy_from(&angular);
            });
        }
        jacobian
    }

    /// Hands every joint that moves a link to `each`, with the velocity of the link's point that is at `x` and its angular velocity by
    /// the joint's position.
    fn joint_twists(&self, links: &[Isometry3<f64>], link: usize, x: &Point3<f64>, mut each: impl FnMut(usize, Twist)) {
        for index in self.tree.path(link) {
            let (joint, before) = (&self.joints[index], &links[self.tree.link_before(index)]);
            let along = before.rotation * joint.direction().into_inner();
            each(
                index,
                match joint {
                    Joint::Revolute(line) => Twist { linear: along.cross(&(x - before * line.point)), angular: along },
                    Joint::Prismatic(_) => Twist { linear: along, angular: Vector3::zeros() },
                },
            );
        }
    }

    /// Turns a derivative by the joints' positions into one by their readings: `J ∂θ/∂q`.
    fn by_readings<const R: usize>(
        &self,
        jacobian: &OMatrix<f64, Const<R>, Dyn>,
        positions: &[f64],
    ) -> OMatrix<f64, Const<R>, Dyn> {
        let mut by_readings = jacobian.clone();
        for (mut column, (correction, reading)) in
            by_readings.column_iter_mut().zip(self.corrections.iter().zip(positions))
        {
            column *= correction.slope(*reading);
        }
        // A joint gives way to what all joints do.
        for (loads, load) in self.bending().into_iter().flat_map(|loads| Load::ALL.map(|load| (loads, load))) {
            let mut slopes = loads.slopes(load, positions);
            for (mut row, correction) in slopes.row_iter_mut().zip(&self.corrections) {
                row *= correction.compliance[load as usize];
            }
            by_readings += jacobian * slopes;
        }
        by_readings
    }
}
