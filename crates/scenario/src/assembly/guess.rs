//! The learners' initial estimate: the truth with an error of the size that the scenario states.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::{ErrorDraw, InitialError, Known, Scenario};
use body_schema_engine::{
    kinematics::Joint,
    model::{Block, Correction, Element, State, anywhere},
};

impl Scenario {
    /// The true state with the error of the initial estimate: for each learned joint three Euler angles, then for a
    /// revolute one three coordinates; at last the marker.
    pub(super) fn perturbed(&self, error: &InitialError, rng: &mut ChaCha8Rng) -> State {
        let mut state = self.robot.state.clone();
        let layout = &self.robot.layout;
        // Readings are taken for what they say, whether what they are truly corrected by is learned or not.
        state.corrections.fill(Correction::default());
        for (index, joint) in state.joints.iter_mut().enumerate().filter(|(index, _)| layout.is_learned(*index)) {
            let truth = *joint;
            if error.draw == ErrorDraw::Anywhere {
                if let Element::Axis(drawn) = anywhere(&Element::Axis(*joint), error.point_m, rng) {
                    *joint = drawn;
                }
            } else {
                error.mislead(joint, rng);
            }
            // What of an axis is held is right.
            let Some(Known::Within { length_m, angle_rad, .. }) = self.prior.of(Block::Axis(index)) else { continue };
            match (joint, truth) {
                (Joint::Revolute(line), Joint::Revolute(truth)) => {
                    if angle_rad <= Known::EXACTLY {
                        line.direction = truth.direction;
                    }
                    if length_m <= Known::EXACTLY {
                        line.point = truth.point;
                    }
                }
                (Joint::Prismatic(direction), Joint::Prismatic(truth)) if angle_rad <= Known::EXACTLY => {
                    *direction = truth;
                }
                _ => {}
            }
        }
        if layout.block(Block::Target(0)).is_some() && self.prior.of(Block::Target(0)).is_none() {
            let marker = state.marker() + error.draw(error.marker_m, rng);
            state = state.with_marker(marker);
        }
        let held = |block: Block| match block {
            Block::Socket(socket) => self.robot.sockets.get(socket).filter(|socket| !socket.is_guessed),
            _ => None,
        };
        for (block, _) in layout.blocks().filter(|(block, _)| held(*block).is_none()) {
            let Some(known) = self.prior.of(block) else { continue };
            let guess = match (block, known) {
                (Block::Base, _) => known.displaced(&block.of(&state), rng),
                (Block::Offset(_) | Block::Ratio(_) | Block::Eccentricity(_) | Block::Compliance(..), _) => {
                    block.of(&state)
                }
                (_, Known::Anywhere { within_m }) => anywhere(&block.of(&state), within_m, rng),
                (_, known) => known.displaced(&block.of(&state), rng),
            };
            block.put(&mut state, guess);
        }
        // What is held there at first tells where a socket is that nobody has guessed.
        for (block, _) in layout.blocks() {
            if let (Block::Socket(socket), Some(spec)) = (block, held(block)) {
                state.sockets[socket] = state.target_at(spec.target, &spec.posture);
            }
        }
        // What its joints bear is what they would as guessed: the truth's loads are nobody's to know.
        let learns = layout.blocks().any(|(block, _)| matches!(block, Block::Compliance(..)));
        state.loads = learns.then(|| self.robot.loads(&state));
        state
    }
}

impl Known {
    /// An element with an error uniform up to the stated size.
    fn displaced(self, element: &Element, rng: &mut ChaCha8Rng) -> Element {
        let Self::Within { length_m, angle_rad, other } = self else { return element.clone() };
        let mut vector = |size: f64| Vector3::from_fn(|_, _| size * rng.random_range(-1.0..=1.0));
        match element {
            Element::Point(point) => Element::Point(point + vector(length_m)),
            Element::Pose(pose) => {
                let shift = vector(length_m);
                let angles = vector(angle_rad);
                let turn = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z);
                let translation = Translation3::from(pose.translation.vector + shift);
                Element::Pose(Isometry3::from_parts(translation, turn * pose.rotation))
            }
            Element::Numbers(numbers) => Element::Numbers(numbers.map(|x| x + other * rng.random_range(-1.0..=1.0))),
            Element::Axis(_) => element.clone(),
        }
    }
}

impl InitialError {
    /// Turns an axis, and moves a line.
    fn mislead(&self, joint: &mut Joint, rng: &mut ChaCha8Rng) {
        let angles = self.draw(self.angle_rad, rng);
        let turn = Rotation3::from_euler_angles(angles.x, angles.y, angles.z);
        let turned = |w: &UnitVector3<f64>| UnitVector3::new_normalize(turn * w.into_inner());
        match joint {
            Joint::Revolute(line) => {
                line.direction = turned(&line.direction);
                line.point += self.draw(self.point_m, rng);
            }
            Joint::Prismatic(direction) => *direction = turned(direction),
        }
    }

    fn draw(&self, size: f64, rng: &mut ChaCha8Rng) -> Vector3<f64> {
        Vector3::from_fn(|_, _| match self.draw {
            ErrorDraw::UpTo | ErrorDraw::Anywhere => size * rng.random_range(-1.0..=1.0),
            ErrorDraw::Exactly => size * if rng.random::<bool>() { 1.0 } else { -1.0 },
        })
    }
}
