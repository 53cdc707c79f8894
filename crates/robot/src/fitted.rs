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
        let nominal = self.state();
        let (wanted, found) = (nominal.joints.len(), state.joints.len());
        let is_same_kind = |(one, other): (&Joint, &Joint)| one.kind() == other.kind();
        if wanted != found || nominal.tree != state.tree || !nominal.joints.iter().zip(&state.joints).all(is_same_kind)
        {
            return Err(Unwritable::Joints { found, wanted });
        }
        let mut learned = nominal.joints.iter().zip(&state.joints).zip(&state.corrections);
        let mut chain = self.clone();
        // The frame of every link at θ = 0, as described and as learned.
        let mut links = vec![(Isometry3::identity(), Isometry3::identity())];
        for segment in &mut chain.segments {
            let (described, frame) = links[segment.parent.map_or(0, |parent| parent + 1)];
            let described = described * segment.origin;
            let Some(((nominal, joint), correction)) = segment.kind.moves().and_then(|_| learned.next()) else {
                links.push((described, frame * segment.origin));
                continue;
            };
            let moved = moved(segment, nominal, joint)? * described;
            let origin = frame.inverse() * moved * segment.motion(offset(segment, correction)?);
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
