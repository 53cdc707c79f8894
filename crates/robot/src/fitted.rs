//! A chain with learned axes.

use nalgebra::Isometry3;

use super::{Chain, Segment, Unwritable};
use body_schema_engine::{
    kinematics::Joint,
    model::{Correction, State},
};

/// The difference (metres, radians) below which two numbers count as equal: what rounding does to products of frames.
const SAME: f64 = 1e-12;

/// A description with the axes of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The chain with the state's axes and offsets. With the state's joints, `e^{ξ₁θ₁} … e^{ξₙθₙ} frames[n]`, the product along the
    /// way to link n, is the pose of that link at readings q where θ = q + offset: equal to [`Chain::links`] of this chain at q.
    pub chain: Chain,
    /// The frame fixed to each link of the state, link 0 the base, at θ = 0 in the base link's frame. The base's frame
    /// is the identity, and of a link with a tip it is that tip's: see [`Chain::bodies`].
    pub frames: Vec<Isometry3<f64>>,
}

impl Chain {
    /// The chain whose kinematic model is `state`, whose joints are this chain's moving ones, in the gauge that the
    /// [module](super) describes. [`State::base`] and targets are not part of it: a target's place on link i is
    /// `frames[i]⁻¹ place` in the frame that is fixed to that link.
    ///
    /// # Errors
    ///
    /// [`Unwritable::Joints`] if the state has other joints, [`Unwritable::Correction`] if a reading is corrected by
    /// more than an offset, [`Unwritable::Turned`] if an axis is more than a right angle from the description's.
    pub fn fitted(&self, state: &State) -> Result<Fitted, Unwritable> {
        self.fitted_with(state, &[])
    }

    /// The same where links have moved rigidly since: each by the number of the joint that carries it, counted from 0, and the motion, in
    /// the base link's frame at θ = 0, of all that is behind it. The origins of what such a link carries take it up, so that everything
    /// behind moves as it did. [`Fitted::frames`] are those of `state`.
    ///
    /// # Errors
    ///
    /// Those of [`fitted`](Self::fitted).
    pub fn fitted_with(&self, state: &State, moved_links: &[(usize, Isometry3<f64>)]) -> Result<Fitted, Unwritable> {
        let nominal = self.state();
        let (wanted, found) = (nominal.joints.len(), state.joints.len());
        let is_same_kind = |(one, other): (&Joint, &Joint)| one.kind() == other.kind();
        if wanted != found || nominal.tree != state.tree || !nominal.joints.iter().zip(&state.joints).all(is_same_kind)
        {
            return Err(Unwritable::Joints { found, wanted });
        }
        let mut learned = nominal.joints.iter().zip(&state.joints).zip(&state.corrections).enumerate();
        // The joint that carries each segment's link, where it moves.
        let mut joints: Vec<Option<usize>> = Vec::new();
        let mut chain = self.clone();
        // The frame of every link at θ = 0, as described and as learned.
        let mut links = vec![(Isometry3::identity(), Isometry3::identity())];
        for segment in &mut chain.segments {
            let (described, frame) = links[segment.parent.map_or(0, |parent| parent + 1)];
            let described = described * segment.origin;
            let carrier = segment.parent.and_then(|parent| joints[parent]);
            let taken_up = moved_links.iter().find(|(joint, _)| carrier == Some(*joint));
            let taken_up = taken_up.map(|(_, motion)| frame.inverse() * motion * frame);
            let Some((number, ((nominal, joint), correction))) = segment.kind.moves().and_then(|_| learned.next())
            else {
                links.push((described, frame * segment.origin));
                joints.push(None);
                if let Some(motion) = taken_up {
                    segment.origin = motion * segment.origin;
                }
                continue;
            };
            joints.push(Some(number));
            let moved = moved(segment, nominal, joint)? * described;
            let origin = frame.inverse() * moved * segment.motion(offset(segment, correction)?);
            let origin = taken_up.map_or(origin, |motion| motion * origin);
            if (origin.translation.vector - segment.origin.translation.vector).norm() > SAME {
                segment.origin.translation = origin.translation;
            }
            if origin.rotation.angle_to(&segment.origin.rotation) > SAME {
                segment.origin.rotation = origin.rotation;
            }
            links.push((described, moved));
        }
        let frames = self.bodies().into_iter().map(|link| links[link].1).collect();
        Ok(Fitted { chain, frames })
    }
}

/// The smallest motion that takes the described axis to the learned one, by less than a right angle.
fn moved(segment: &Segment, described: &Joint, learned: &Joint) -> Result<Isometry3<f64>, Unwritable> {
    let (from, to) = (described.direction(), learned.direction());
    let turned = from.angle(&to);
    if turned > std::f64::consts::FRAC_PI_2 {
        return Err(Unwritable::Turned { joint: segment.name.clone(), turned_deg: turned.to_degrees() });
    }
    Ok(described.motion_to(learned))
}

/// The offset of a reading, rad or m, if the reading has no other correction.
fn offset(segment: &Segment, correction: &Correction) -> Result<f64, Unwritable> {
    let Correction { offset, .. } = *correction;
    if *correction == (Correction { offset, ..Correction::default() }) {
        Ok(offset)
    } else {
        Err(Unwritable::Correction { joint: segment.name.clone() })
    }
}

#[cfg(test)]
mod tests {
    use body_schema_engine::kinematics::rotation;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::Urdf;

    /// All that a joint's link carries moves rigidly with it, along and about axes as well: e^{ξ₁θ₁} … e^{ξⱼθⱼ} M e^{ξθ} … frames.
    #[test]
    fn what_a_link_carries_moves_with_it() {
        let urdf = Urdf::parse(include_str!("../../../scenarios/tiago.urdf")).expect("a description");
        let chain = urdf.chain("base_footprint", "arm_tool_link").expect("a chain");
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut vector = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        let mut state = chain.state();
        for joint in &mut state.joints {
            *joint = joint.transformed(&Isometry3::new(vector(0.003), vector(0.01)));
        }
        let fitted = chain.fitted(&state).expect("near").chain;
        let count = state.joints.len();
        for joint in 0..count - 1 {
            let motion = Isometry3::from_parts(
                Translation3::from(vector(0.01)),
                rotation::exp(&UnitQuaternion::identity(), &vector(0.02)),
            );
            let bent = chain.fitted_with(&state, &[(joint, motion)]).expect("near").chain;
            let positions: Vec<f64> = (0..count).map(|_| vector(1.0).x).collect();
            let before: Isometry3<f64> = (state.joints.iter().zip(&positions).take(joint + 1))
                .fold(Isometry3::identity(), |at, (joint, position)| at * joint.exp(*position));
            let wanted = before * motion * before.inverse() * fitted.tip_at(&positions);
            let found = bent.tip_at(&positions);
            let off = found.inverse() * wanted;
            assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-12, "joint {joint}: {off}");
            // What stands before it, and the joint itself, have not moved.
            let links = |chain: &Chain| chain.moving().take(joint + 1).map(|it| it.origin).collect::<Vec<_>>();
            assert_eq!(links(&bent), links(&fitted));
        }
    }
}
