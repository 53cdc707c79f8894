//! How the joints' readings move a robot's links, at one posture.
//!
//! A joint j moves what is fixed to a link by its twist, if the link is behind it (see [`Tree`](crate::kinematics::Tree)): the Jacobian
//! has the column `Ad ξⱼ ∂θⱼ/∂qⱼ`, and 0 where j moves another branch. A frame measured from another moves by the difference of their two
//! twists, so a joint that carries both does not count.

use nalgebra::{Const, Dyn, Isometry3, Matrix3xX, Matrix6xX, OMatrix, Vector3};

use super::{Frame, Load, State, links::Links};

impl State {
    /// J = ∂p/∂q of a target by the readings of all joints (3 × n), m per rad or m; frame of the measurements.
    pub fn target_jacobian(&self, target: usize, positions: &[f64]) -> Matrix3xX<f64> {
        Links::towards(self, [Frame::Target(target)]).at(positions).target_jacobian(target)
    }

    /// How the readings of all joints move a frame: the velocity of its origin, m per rad or m, then its angular velocity, rad per rad
    /// or m (6 × n; frame of the measurements).
    pub fn frame_jacobian(&self, frame: Frame, positions: &[f64]) -> Matrix6xX<f64> {
        Links::towards(self, [frame]).at(positions).frame_jacobian(frame)
    }

    /// Where a frame is, seen from another at readings `positions` (rad or m, one per joint).
    pub fn relative(&self, frame: Frame, seen_from: Frame, positions: &[f64]) -> Isometry3<f64> {
        Links::of(self, positions).relative(frame, seen_from)
    }

    /// The Jacobian (6 × n) of a frame as seen from another: like [`frame_jacobian`](Self::frame_jacobian), but relative to and in
    /// the frame `seen_from`.
    pub fn relative_jacobian(&self, frame: Frame, seen_from: Frame, positions: &[f64]) -> Matrix6xX<f64> {
        Links::of(self, positions).relative_jacobian(frame, seen_from)
    }
}

impl Links<'_> {
    /// [`State::target_jacobian`] at the present posture.
    pub fn target_jacobian(&self, target: usize) -> Matrix3xX<f64> {
        let (state, x) = (self.state(), self.target(target));
        let mut jacobian = Matrix3xX::zeros(state.joints.len());
        for joint in state.tree.path(state.targets[target].link) {
            jacobian.set_column(joint, &self.twist(joint).at(&x));
        }
        self.by_readings(&jacobian)
    }

    /// [`State::frame_jacobian`] at the present posture.
    pub fn frame_jacobian(&self, frame: Frame) -> Matrix6xX<f64> {
        self.by_readings(&self.twists_at(frame, &self.pose(frame).translation.vector))
    }

    /// [`State::relative_jacobian`] at the present posture.
    pub fn relative_jacobian(&self, frame: Frame, seen_from: Frame) -> Matrix6xX<f64> {
        let origin = self.pose(frame).translation.vector;
        let mut apart = self.twists_at(frame, &origin) - self.twists_at(seen_from, &origin);
        let back = self.pose(seen_from).rotation.inverse();
        for mut column in apart.column_iter_mut() {
            let [linear, angular] = [0, 3].map(|first| back * column.fixed_rows::<3>(first).into_owned());
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
            column.fixed_rows_mut::<3>(3).copy_from(&angular);
        }
        self.by_readings(&apart)
    }

    /// How the positions of all joints move a frame, with the velocity of its point that is at `x`.
    fn twists_at(&self, frame: Frame, x: &Vector3<f64>) -> Matrix6xX<f64> {
        let state = self.state();
        let mut jacobian = Matrix6xX::zeros(state.joints.len());
        for joint in state.link_of(frame).into_iter().flat_map(|link| state.tree.path(link)) {
            let twist = self.twist(joint);
            jacobian.fixed_view_mut::<3, 1>(0, joint).copy_from(&twist.at(x));
            jacobian.fixed_view_mut::<3, 1>(3, joint).copy_from(&twist.angular);
        }
        jacobian
    }

    /// Turns a derivative by the joints' positions into one by their readings: `J ∂θ/∂q`.
    fn by_readings<const R: usize>(&self, jacobian: &OMatrix<f64, Const<R>, Dyn>) -> OMatrix<f64, Const<R>, Dyn> {
        let (state, positions) = (self.state(), self.positions());
        let mut by_readings = jacobian.clone();
        for (mut column, (correction, reading)) in
            by_readings.column_iter_mut().zip(state.corrections.iter().zip(positions))
        {
            column *= correction.slope(*reading);
        }
        // A joint gives way to what all joints do.
        for (loads, load) in state.bending().into_iter().flat_map(|loads| Load::ALL.map(|load| (loads, load))) {
            let mut slopes = loads.slopes(load, positions);
            for (mut row, correction) in slopes.row_iter_mut().zip(&state.corrections) {
                row *= correction.compliance[load as usize];
            }
            by_readings += jacobian * slopes;
        }
        by_readings
    }
}
