//! Counting equations and unknowns.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{
    kinematics::JointBox,
    model::{Layout, State, rank},
    sensing::Rig,
};

/// Movements in general position after which there are as many independent equations as there can be: the least N for
/// which the Jacobian of N of them has the rank that it has for many. It is the rank that counts, not the number of
/// parameters: what cannot be determined needs no equation.
///
/// A yardstick to draw beside curves, not a bound: a prior or loose thresholds can beat it.
pub fn movements_by_counting(state: &State, layout: &Layout, rig: &Rig, limits: &JointBox) -> usize {
    let (m, d) = (layout.dimension(), rig.equations());
    if m == 0 || d == 0 {
        return 0;
    }
    // A fixed stream of its own: what is general needs no seed.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let many = 2 * m.div_ceil(d) + 8;
    let mut stacked = DMatrix::zeros(many * d, m);
    for index in 0..many {
        let rows = rig.jacobian(state, layout, &limits.draw(&mut rng));
        stacked.rows_mut(index * d, d).copy_from(&rows.transpose());
    }
    let greatest = rank(&stacked);
    let reaches = |count: &usize| rank(&stacked.rows(0, count * d).into_owned()) >= greatest;
    (greatest.div_ceil(d).max(1)..many).find(reaches).unwrap_or(many)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        model::{Block, laws::random_arm},
        scenario::builtin,
    };

    /// As PAPER.md's counting has it where every parameter can be determined; and by rank where some cannot.
    #[test]
    fn equations_are_counted_by_rank() {
        for (name, expected) in [("arm-6dof", 8), ("arm-12dof", 16), ("head-fov", 6)] {
            let scenario = builtin(name).expect("built in");
            let (robot, rig) = (&scenario.robot, Rig::tracker(0.01));
            assert_eq!(movements_by_counting(&robot.state, &robot.layout, &rig, &robot.limits), expected, "{name}");
        }
        let arm = random_arm(&mut ChaCha8Rng::seed_from_u64(2), 4);
        let limits = JointBox::new(vec![(-1.0, 1.0); 4]).expect("limits");
        let rig = Rig::tracker(0.01);
        let axes = Layout::of_arm(&arm, &[], true);
        let with_base = Layout::new(&arm, (0..4).map(Block::Axis).chain([Block::Base, Block::Target(0)]));
        assert_eq!(with_base.dimension(), axes.dimension() + 6);
        let alone = movements_by_counting(&arm, &axes, &rig, &limits);
        assert_eq!(movements_by_counting(&arm, &with_base, &rig, &limits), alone, "the base adds nothing");
    }
}
