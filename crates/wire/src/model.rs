//! A chain at θ = 0: an estimate with its uncertainty, or a truth.

use nalgebra::{Isometry3, Matrix3, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::{CorrectionReport, LoadsReport, PlaceReport, array, arrays, rows};
use body_schema_engine::{
    estimation::Belief,
    kinematics::{Joint, Line},
    model::{Correction, Loads, State},
};

/// A chain at θ = 0, with its uncertainty if it is an estimate that keeps one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModelReport {
    /// The joints, base first.
    pub joints: Vec<JointReport>,
    /// The marker at θ = 0, metres.
    pub marker_m: [f64; 3],
    /// The joint that carries each joint, counted from 0, null for one on the base; empty for an arm, whose every joint is carried by the
    /// one before it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parents: Vec<Option<usize>>,
    /// What carries the marker of a robot that branches: 0 is its base, i what moves with the i-th joint. Null for an arm, whose last
    /// link carries it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub marker_link: Option<usize>,
    /// Covariance of the marker, m², row by row; null if it is known or no covariance is kept.
    pub marker_covariance_m2: Option<[[f64; 3]; 3]>,
    /// The robot's base in the frame of the measurements; null where the two are one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<PlaceReport>,
    /// The cameras.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<PlaceReport>,
    /// What can be looked at; empty where that is a marker alone, and a point.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<PlaceReport>,
    /// The sockets in which targets are held, metres, in the order of the description; those that are held out are none of
    /// them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sockets_m: Vec<[f64; 3]>,
    /// What joints that give way bear; null where none does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loads: Option<LoadsReport>,
}

/// The axis of one joint at θ = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct JointReport {
    /// Unit direction of the axis.
    pub axis: [f64; 3],
    /// A point on the axis, metres: of an estimate the one nearest to the true axis point, so that drawings compare
    /// like with like, or the pivot of its chart where no truth is known; null for a prismatic joint.
    pub point_m: Option<[f64; 3]>,
    /// Covariance of that point, m², row by row: rank 2, flat along the axis.
    pub point_covariance_m2: Option<[[f64; 3]; 3]>,
    /// The covariance that its prior and its data allow of that point, linearised at the truth: m², row by row, as
    /// `bound_trace` among the metrics. Null where no truth is known, or the learner keeps no covariance to compare.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub allowed_point_covariance_m2: Option<[[f64; 3]; 3]>,
    /// Covariance of the direction, rad², row by row: rank 2, flat along the axis.
    pub direction_covariance_rad2: Option<[[f64; 3]; 3]>,
    /// What its readings are corrected by; null where they are taken for what they say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<CorrectionReport>,
}

impl ModelReport {
    /// A state without uncertainty, in the frame of the measurements.
    pub fn of_state(state: &State) -> Self {
        let base = PlaceReport::of_base(state);
        let state = state.measured();
        let joints = state
            .joints
            .iter()
            .zip(&state.corrections)
            .map(|(joint, correction)| JointReport {
                axis: array(&joint.direction()),
                point_m: joint.line().map(|line| array(&line.point.coords)),
                point_covariance_m2: None,
                allowed_point_covariance_m2: None,
                direction_covariance_rad2: None,
                correction: CorrectionReport::of(correction),
            })
            .collect();
        Self {
            joints,
            marker_m: array(&state.marker().coords),
            parents: state.tree.clone().into(),
            marker_link: (!state.tree.is_serial()).then(|| state.hand_link()),
            marker_covariance_m2: None,
            base,
            cameras: PlaceReport::of_cameras(&state),
            targets: PlaceReport::of_targets(&state),
            sockets_m: state.sockets.iter().map(|socket| array(&socket.coords)).collect(),
            loads: state.bending().map(LoadsReport::of),
        }
    }

    /// A belief with what it holds of uncertainty; points on axes are those nearest to the truth's, where it is known.
    pub fn of_belief(belief: &Belief, truth: Option<&State>) -> Self {
        let (shown, estimate) = (shown(&belief.state, truth), belief.state.measured());
        let base = PlaceReport::of_base(&belief.state);
        let mut model = Self { base, ..Self::of_state(&shown) };
        for (index, joint) in model.joints.iter_mut().enumerate() {
            let along = match (shown.joints[index].line(), estimate.joints[index].line()) {
                (Some(shown), Some(line)) => line.direction.dot(&(shown.point - line.point)),
                _ => 0.0,
            };
            joint.point_covariance_m2 = belief.point_covariance(index, along).as_ref().map(rows);
            joint.direction_covariance_rad2 = belief.direction_covariance(index).as_ref().map(rows);
        }
        model.marker_covariance_m2 = belief.hand_marker_covariance().as_ref().map(rows);
        model
    }

    /// What a learner believes, beside what its data allow of every point whose covariance it knows.
    pub fn of_outcome(belief: &Belief, truth: Option<&State>, allowed: &[Option<Matrix3<f64>>]) -> Self {
        let mut model = Self::of_belief(belief, truth);
        for (joint, allowed) in model.joints.iter_mut().zip(allowed) {
            let is_known = joint.point_covariance_m2.is_some();
            joint.allowed_point_covariance_m2 = allowed.as_ref().filter(|_| is_known).map(rows);
        }
        model
    }

    /// The chain that it describes with its cameras, in the frame of the measurements; `None` if a number in it is not
    /// finite, or its parents are no tree of its joints. The first target is the marker, the others are those of the report.
    pub fn state(&self) -> Option<State> {
        let finite = |vector: &[f64; 3]| vector.iter().all(|x| x.is_finite());
        let joint = |joint: &JointReport| {
            let direction = UnitVector3::try_new(Vector3::from(joint.axis), 0.0).filter(|_| finite(&joint.axis))?;
            match joint.point_m {
                Some(point) if finite(&point) => Some(Joint::Revolute(Line { point: point.into(), direction })),
                Some(_) => None,
                None => Some(Joint::Prismatic(direction)),
            }
        };
        let joints = self.joints.iter().map(joint).collect::<Option<Vec<_>>>()?;
        let mut state = finite(&self.marker_m).then(|| State::arm(joints, self.marker_m.into()))?;
        if !self.parents.is_empty() {
            let hand = (self.marker_link.unwrap_or(state.joints.len()), self.marker_m.into());
            state = State::branching(state.joints, self.parents.clone(), hand).ok()?;
        }
        for (correction, joint) in state.corrections.iter_mut().zip(&self.joints) {
            *correction = joint.correction.map_or(*correction, |report| report.correction());
        }
        if let Some(report) = &self.loads {
            state.loads = Some(Loads { tree: state.tree.clone(), ..report.loads(state.joints.len())? }.into());
        }
        state.devices = self.cameras.iter().map(PlaceReport::device).collect::<Option<_>>()?;
        state.targets.extend(self.targets.iter().map(PlaceReport::target).collect::<Option<Vec<_>>>()?);
        Some(state)
    }

    /// Where the robot's base is in the frame of the measurements; `None` if a number in it is not finite.
    pub fn base_frame(&self) -> Option<Isometry3<f64>> {
        self.base.as_ref().map_or(Some(Isometry3::identity()), PlaceReport::frame)
    }

    /// The arm at θ = 0: axis points in order, then the marker, metres.
    pub fn skeleton_m(&self) -> Vec<[f64; 3]> {
        self.joints.iter().filter_map(|joint| joint.point_m).chain([self.marker_m]).collect()
    }

    /// The link that carries a joint: 0 is the base, i what moves with the i-th joint.
    pub fn link_before(&self, joint: usize) -> usize {
        match self.parents.get(joint) {
            Some(parent) => parent.map_or(0, |parent| parent + 1),
            None => joint,
        }
    }

    /// The link that carries the marker.
    pub fn hand_link(&self) -> usize {
        self.marker_link.unwrap_or(self.joints.len())
    }

    /// The bones at θ = 0, metres: a line for each branch, that of the marker first. An arm has one, its skeleton.
    pub fn bones_m(&self) -> Vec<Vec<[f64; 3]>> {
        // At θ = 0 corrections of readings count for nothing.
        let plain =
            |state: State| State { loads: None, corrections: vec![Correction::default(); state.joints.len()], ..state };
        let state = if self.parents.is_empty() { None } else { self.state() };
        match state.map(plain) {
            Some(state) => bones(&state, &vec![0.0; state.joints.len()]),
            None => vec![self.skeleton_m()],
        }
    }
}

/// The bones of a robot at readings (rad or m), metres.
fn bones(state: &State, positions: &[f64]) -> Vec<Vec<[f64; 3]>> {
    state.bones(positions).iter().map(|bone| arrays(bone)).collect()
}

/// The bones of a robot that branches at readings (rad or m), metres; empty for an arm, whose skeleton is all.
pub(crate) fn branching_bones(state: &State, positions: &[f64]) -> Vec<Vec<[f64; 3]>> {
    if state.tree.is_serial() { Vec::new() } else { bones(state, positions) }
}

/// An estimate as it is drawn beside the truth.
pub(crate) fn shown(estimate: &State, truth: Option<&State>) -> State {
    let estimate = estimate.measured();
    truth.map_or_else(|| estimate.clone().into_owned(), |truth| estimate.slid_towards(&truth.measured()))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, Point3};

    use super::*;
    use body_schema_engine::{
        model::{Device, Layout},
        sensing::MeasurementModel,
    };

    /// A robot that branches is told with its branches and comes back with them; of an arm not a word more is written than ever.
    #[test]
    fn branches_are_told_and_come_back() {
        let line = |x: f64, direction| Joint::Revolute(Line { point: Point3::new(x, 0.0, 0.0), direction });
        let joints = vec![line(0.0, Vector3::z_axis()), line(-0.5, Vector3::y_axis()), line(0.5, Vector3::y_axis())];
        let marker = Point3::new(0.9, 0.0, 0.0);
        let mut tree = State::branching(joints.clone(), vec![None, Some(0), Some(0)], (3, marker)).expect("a tree");
        let pose = Isometry3::translation(-0.8, 0.0, 0.1);
        tree.devices.push(Device {
            link: Some(2),
            pose,
            intrinsics: Some([500.0, 500.0, 320.0, 240.0]),
            distortion: None,
        });
        tree.loads = Some(tree.loads_under(Vector3::z_axis(), None).into());
        tree.corrections[2].compliance = [0.01, 0.0];
        let told = ModelReport::of_state(&tree);
        let back: ModelReport = serde_json::from_value(serde_json::to_value(&told).expect("JSON")).expect("a model");
        let state = back.state().expect("a state");
        assert_eq!((&state.tree, state.hand_link(), &state.loads), (&tree.tree, 3, &tree.loads));
        let readings = [0.3, 0.4, -0.5];
        assert_eq!(state.bones(&readings), tree.bones(&readings));
        let zero: Vec<Vec<[f64; 3]>> =
            vec![vec![[0.0; 3], [0.5, 0.0, 0.0], [0.9, 0.0, 0.0]], vec![[0.0; 3], [-0.5, 0.0, 0.0], [-0.8, 0.0, 0.1]]];
        assert_eq!(back.bones_m(), zero);
        assert!(ModelReport { parents: vec![None], ..told.clone() }.state().is_none(), "a parent for each joint");
        assert!(ModelReport { marker_link: Some(7), ..told }.state().is_none(), "there is no such link");
        let arm = ModelReport::of_state(&State::arm(joints, marker));
        let written = serde_json::to_value(&arm).expect("JSON");
        let keys: Vec<&str> = written.as_object().expect("an object").keys().map(String::as_str).collect();
        assert_eq!(keys, ["joints", "marker_covariance_m2", "marker_m"]);
        assert_eq!(arm.bones_m(), [arm.skeleton_m()]);
    }

    /// What data allow of a point stands beside what a learner knows of it, or not at all.
    #[test]
    fn what_is_allowed_stands_beside_what_is_known() {
        let direction = Vector3::z_axis();
        let joints = vec![Joint::Revolute(Line { point: Point3::origin(), direction }), Joint::Prismatic(direction)];
        let state = State::arm(joints, Point3::new(1.0, 0.0, 0.0));
        let layout = Arc::new(Layout::of_arm(&state, &[], false));
        let learned = layout.dimension();
        let knows_not = Belief::new(state, layout, Arc::new(MeasurementModel::tracker(0.01)));
        let knows = knows_not.clone().with_covariance(DMatrix::identity(learned, learned));
        let allowed = [Some(Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)), None];
        let told = |belief: &Belief| {
            let model = ModelReport::of_outcome(belief, None, &allowed);
            model.joints.iter().map(|joint| joint.allowed_point_covariance_m2).collect::<Vec<_>>()
        };
        assert_eq!(told(&knows), [Some([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]), None]);
        assert_eq!(told(&knows_not), [None, None]);
        assert_eq!(ModelReport::of_outcome(&knows, None, &[]), ModelReport::of_belief(&knows, None));
    }
}
