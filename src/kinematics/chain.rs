//! A serial chain and its forward kinematics.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};

use super::{Joint, TangentLayout, chart};

/// Joints from base to hand, and the marker p₀ at θ = 0, all in the measurement frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// The joints in order, the one nearest the base first.
    pub joints: Vec<Joint>,
    /// The marker at θ = 0, metres.
    pub marker: Point3<f64>,
}

impl Chain {
    /// The marker `p(θ) = e^{ξ₁θ₁} … e^{ξₙθₙ} p₀`, metres. `positions` holds one entry per joint, rad or m.
    pub fn marker_at(&self, positions: &[f64]) -> Point3<f64> {
        debug_assert_eq!(positions.len(), self.joints.len());
        self.joints.iter().zip(positions).rev().fold(self.marker, |point, (joint, &theta)| joint.carry(theta, &point))
    }

    /// The motions e^{ξ₁θ₁} … e^{ξᵢθᵢ} for i = 1 … n: `motions[i]` carries what is fixed to the link behind joint i.
    pub fn motions(&self, positions: &[f64]) -> Vec<Isometry3<f64>> {
        let mut motion = Isometry3::identity();
        self.joints
            .iter()
            .zip(positions)
            .map(|(joint, &theta)| {
                motion *= joint.exp(theta);
                motion
            })
            .collect()
    }

    /// The skeleton at θ: the pivot of every revolute joint in order, then the marker, metres.
    ///
    /// A line has no distinguished point, so this is a drawing of the arm, not a property of its kinematics.
    pub fn skeleton(&self, positions: &[f64]) -> Vec<Point3<f64>> {
        let motions = self.motions(positions);
        let mut points: Vec<_> = self
            .joints
            .iter()
            .zip(&motions)
            .filter_map(|(joint, motion)| joint.line().map(|line| motion * line.point))
            .collect();
        points.push(motions.last().map_or(self.marker, |motion| motion * self.marker));
        points
    }

    /// The same chain with the point of every axis slid to where it is nearest to the axis point of `reference`: the
    /// same kinematics, drawn comparably.
    pub fn slid_towards(&self, reference: &Self) -> Self {
        let mut chain = self.clone();
        for (joint, reference) in chain.joints.iter_mut().zip(&reference.joints) {
            if let (Joint::Revolute(line), Some(other)) = (joint, reference.line()) {
                *line = line.slid(line.direction.dot(&(other.point - line.point)));
            }
        }
        chain
    }

    /// The chain at tangent coordinates δ (see [`TangentLayout`]) in the chart at `self`; what is not learned stays.
    pub fn retract(&self, layout: &TangentLayout, delta: &DVector<f64>) -> Self {
        let mut chain = self.clone();
        for (index, joint) in chain.joints.iter_mut().enumerate() {
            let Some(directions) = layout.direction(index) else { continue };
            match joint {
                Joint::Revolute(line) => {
                    let start = directions.start - 2;
                    *line = chart::retract_line(line, &delta.fixed_rows::<4>(start).into_owned());
                }
                Joint::Prismatic(w) => {
                    *w = chart::retract_direction(w, &delta.fixed_rows::<2>(directions.start).into_owned());
                }
            }
        }
        if let Some(range) = layout.marker() {
            chain.marker += Vector3::from(delta.fixed_rows::<3>(range.start));
        }
        chain
    }

    /// The tangent coordinates of `other` in the chart at `self`, the inverse of [`retract`](Self::retract); `None`
    /// where a joint of `other` lies outside the chart (directions 90 deg or more apart) or the chains do not match.
    pub fn local(&self, layout: &TangentLayout, other: &Self) -> Option<DVector<f64>> {
        let mut delta = DVector::zeros(layout.dimension());
        for (index, (joint, other)) in self.joints.iter().zip(&other.joints).enumerate() {
            let Some(directions) = layout.direction(index) else { continue };
            match (joint, other) {
                (Joint::Revolute(line), Joint::Revolute(other)) => {
                    delta.fixed_rows_mut::<4>(directions.start - 2).copy_from(&chart::local_line(line, other)?);
                }
                (Joint::Prismatic(w), Joint::Prismatic(other)) => {
                    delta.fixed_rows_mut::<2>(directions.start).copy_from(&chart::local_direction(w, other)?);
                }
                _ => return None,
            }
        }
        if let Some(range) = layout.marker() {
            delta.fixed_rows_mut::<3>(range.start).copy_from(&(other.marker - self.marker));
        }
        Some(delta)
    }

    /// The derivative J (m × m, block diagonal) of the change of chart from `self` to `self.retract(δ)`, at δ.
    pub fn transport(&self, layout: &TangentLayout, delta: &DVector<f64>) -> DMatrix<f64> {
        let mut transport = DMatrix::identity(layout.dimension(), layout.dimension());
        for (index, joint) in self.joints.iter().enumerate() {
            let Some(directions) = layout.direction(index) else { continue };
            let w = joint.direction();
            let d = delta.fixed_rows::<2>(directions.start).into_owned();
            let w_new = chart::retract_direction(&w, &d);
            let mut put = |start: usize, block| transport.fixed_view_mut::<2, 2>(start, start).copy_from(&block);
            if let Some(points) = layout.point(index) {
                put(points.start, chart::point_transport(&w, &w_new));
            }
            put(directions.start, chart::direction_transport(&w, &d, &w_new));
        }
        transport
    }
}
