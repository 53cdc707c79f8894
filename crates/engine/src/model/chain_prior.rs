//! The prior of a described robot: each joint's errors are local, and move everything behind the joint.
//!
//! A description places every joint's frame relative to the one before. What is wrong there, an origin that was measured badly or a zero
//! that was set badly, moves all that the joint carries. With ε_i the twist (v, ω) by which the origin o_i of joint i is off, and z_i the
//! error of the zero of its reading, to first order
//!
//! ```text
//! δ = Σᵢ Jᵢ εᵢ + Kᵢ zᵢ,       ε ~ N(0, diag(σₚ², σ_d²)),   z ~ N(0, σ_z²)
//! P₀ = Σᵢ Jᵢ Σ_ε Jᵢᵀ + σ_z² Kᵢ Kᵢᵀ + D
//! ```
//!
//! where a twist at o moves a point x by v + ω × (x − o) and a direction w by ω × w:
//!
//! | block of δ | moved by ε_i | moved by z_i, the twist (0, w_i), or (w_i, 0) of a joint that slides |
//! |---|---|---|
//! | axis of joint j, in its own chart | j = i, or i moves j | i moves j |
//! | target or device on link l | i moves l | i moves l |
//!
//! with joints counted from 0. Joint i moves what descends from it and nothing on other branches: in an arm joints j > i and links l > i,
//! link l being behind joint l − 1. D holds the variances of what is no error of the chain: where the base
//! stands, where on its link a target is. So a target that is known to a millimetre *on its link* moves with the chain; for a target of
//! which little is known D dominates. Where the zeros are blocks of their own ([`Block::Offset`]) they are not counted among the axes a
//! second time.
//!
//! Origins have a scale, and so has every single zero: σₚ stands for s σₚ, σ_d for s σ_d, σ_z for s_i σ_z, see [`Scales`]. The stated
//! deviations are s = 1. How large the errors of one description are is learned from the evidence of the measurements, with a weak prior of
//! the scales (a spike and a slab, on a [grid](ChainPrior::GRID)): with probability w there is next to no error of the kind, else ln s ~
//! N(0, d²). Origins come off one machine and share their scale; a zero is set by hand, and one that is off says nothing of the others.
//!
//! *Held axes.* An axis that is not learned is taken to be exact in the frame of the base. So P₀ is conditioned on it: only errors along
//! the chain that leave it in place, to [`HELD`](ChainPrior::HELD), count.

use std::sync::OnceLock;

use nalgebra::{Cholesky, DMatrix, DVector, Point3, Vector3};

use super::{Block, Element, Layout, State};
use crate::{
    elementary::{exp, ln},
    kinematics::{Joint, chart},
};

/// The errors along a chain, as standard deviations per coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainErrors {
    /// σₚ: the deviation of a joint's origin in the frame before it, metres.
    pub point_m: f64,
    /// σ_d: the deviation of that frame's rotation, radians.
    pub direction_rad: f64,
    /// σ_z: the deviation of the zero of a joint that turns, radians.
    pub zero_rad: f64,
    /// σ_z: the deviation of the zero of a joint that slides, metres.
    pub zero_m: f64,
}

/// The factors by which errors along a chain are larger than stated.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Scales {
    /// s: the factor of shifts and turns of origins.
    pub origins: f64,
    /// s_i: the factor of each reading's zero.
    pub zeros: Vec<f64>,
}

/// A covariance of tangent coordinates as a function of the scales of two kinds of error.
#[derive(Clone, Debug)]
pub struct ChainPrior {
    /// The roots of P₀'s parts for origins and for zeros, m × k, at a scale of 1; the rows of held coordinates stand
    /// last.
    roots: [DMatrix<f64>; 2],
    /// D, with (1e-6)² for held coordinates.
    own: DVector<f64>,
    /// How many of the rows are held: the last ones.
    held: usize,
    /// Learned coordinates whose deviation is so small that they are held too.
    fixed: Vec<usize>,
    /// P₀⁻¹ by place on the grid, computed when it is first asked for.
    inverted: Vec<OnceLock<Option<Inverted>>>,
}

/// P₀⁻¹ at some scales, and ln det P₀.
#[derive(Clone, Debug)]
pub(crate) struct Inverted {
    pub information: DMatrix<f64>,
    pub log_determinant: f64,
}

impl Inverted {
    fn of(covariance: DMatrix<f64>) -> Option<Self> {
        let factor = Cholesky::new(covariance)?;
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|x| ln(*x)).sum::<f64>();
        Some(Self { information: factor.inverse(), log_determinant })
    }

    /// P₀⁻¹ after the covariance has grown by K diag(v) Kᵀ, K of m rows (Woodbury).
    pub fn with(&self, columns: &DMatrix<f64>, variances: &[f64]) -> Option<Self> {
        let off: Vec<usize> = (0..variances.len()).filter(|k| variances[*k] > NONE * NONE).collect();
        if off.is_empty() {
            return Some(self.clone());
        }
        let columns =
            DMatrix::from_fn(columns.nrows(), off.len(), |i, k| columns[(i, off[k])] * variances[off[k]].sqrt());
        let carried = &self.information * &columns;
        let mut within = columns.tr_mul(&carried);
        (0..off.len()).for_each(|k| within[(k, k)] += 1.0);
        let factor = Cholesky::new(within)?;
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|x| ln(*x)).sum::<f64>();
        let information = &self.information - &carried * factor.solve(&carried.transpose());
        Some(Self { information, log_determinant: self.log_determinant + log_determinant })
    }
}

/// The scale that stands for next to no error.
const NONE: f64 = 1e-3;

impl ChainPrior {
    /// The standard deviation of held coordinates, m or rad.
    pub const HELD: f64 = 1e-6;
    /// The scales that are tried; the first stands for no error at all.
    pub const GRID: &'static [f64] = &[NONE, 0.1, 0.16, 0.25, 0.4, 0.63, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0];
    /// w: the probability that origins are right, and that a zero is right.
    const RIGHT: [f64; 2] = [0.6, 0.8];
    /// d: the standard deviation of the logarithm of a scale, for origins and for zeros.
    const SPREAD: [f64; 2] = [1.0, 1.5];

    /// The prior of `layout` around `guess`, the joints' origins being where `origins` has them (frame of the guess at θ = 0,
    /// metres). Joints that share a zero, one following the other, make up one entry of `readings`: (joint, multiplier) each.
    ///
    /// `own` holds the deviations that are no errors of the chain, one per coordinate; those of axes count only where they
    /// are [`HELD`](Self::HELD) or less.
    pub fn new(
        guess: &State,
        layout: &Layout,
        origins: &[Point3<f64>],
        readings: &[Vec<(usize, f64)>],
        errors: ChainErrors,
        own: &DVector<f64>,
    ) -> Self {
        let is_axis = |block: &Block| matches!(block, Block::Axis(_));
        let missing = (0..guess.joints.len()).map(Block::Axis).filter(|block| layout.block(*block).is_none());
        let held_layout = Layout::new(guess, missing);
        let (learned, held) = (layout.dimension(), held_layout.dimension());
        let blocks: Vec<(Block, usize)> = (layout.blocks().map(|(block, range)| (block, range.start)))
            .chain(held_layout.blocks().map(|(block, range)| (block, learned + range.start)))
            .collect();
        // What an error of a joint carries along: all that hangs on the joint, and its own axis where that `begins` with it.
        let carried = |twist: &Twist, begins: bool, column: &mut [f64]| {
            for (block, start) in &blocks {
                let hangs = |link: usize| guess.tree.moves(twist.joint, link);
                let moves = match *block {
                    Block::Axis(joint) => (begins && joint == twist.joint) || hangs(guess.tree.link_before(joint)),
                    Block::Target(target) => hangs(guess.targets[target].link),
                    Block::Device(device) => guess.devices[device].link.is_some_and(hangs),
                    _ => false,
                };
                if moves {
                    twist.moves(&block.of(guess), &mut column[*start..]);
                }
            }
        };
        let rows = learned + held;
        let mut of_origins = DMatrix::zeros(rows, 6 * guess.joints.len());
        for (joint, origin) in origins.iter().enumerate() {
            for k in 0..6 {
                let unit = Vector3::ith(k % 3, if k < 3 { errors.point_m } else { errors.direction_rad });
                let (linear, angular) = if k < 3 { (unit, Vector3::zeros()) } else { (Vector3::zeros(), unit) };
                let twist = Twist { joint, at: *origin, linear, angular };
                let place = (6 * joint + k) * rows;
                carried(&twist, true, &mut of_origins.as_mut_slice()[place..place + rows]);
            }
        }
        let mut of_zeros = DMatrix::zeros(rows, readings.len());
        for (index, reading) in readings.iter().enumerate() {
            let mut sum = DVector::zeros(rows);
            for &(joint, multiplier) in
                reading.iter().filter(|(joint, _)| layout.block(Block::Offset(*joint)).is_none())
            {
                let w = guess.joints[joint].direction().into_inner() * multiplier;
                let (linear, angular) = match guess.joints[joint] {
                    Joint::Revolute(_) => (Vector3::zeros(), w * errors.zero_rad),
                    Joint::Prismatic(_) => (w * errors.zero_m, Vector3::zeros()),
                };
                let at = guess.joints[joint].line().map_or(Point3::origin(), |line| line.point);
                let mut column = DVector::zeros(rows);
                carried(&Twist { joint, at, linear, angular }, false, column.as_mut_slice());
                sum += column;
            }
            of_zeros.set_column(index, &sum);
        }
        let mut variances = DVector::from_element(rows, Self::HELD * Self::HELD);
        let mut fixed = Vec::new();
        for (block, range) in layout.blocks() {
            for k in range {
                let sd = own[k];
                variances[k] = if is_axis(&block) { 0.0 } else { sd * sd };
                if sd <= Self::HELD {
                    fixed.push(k);
                }
            }
        }
        let inverted = vec![OnceLock::new(); Self::GRID.len()];
        Self { roots: [of_origins, of_zeros], own: variances, held, fixed, inverted }
    }

    /// The scales of the stated deviations, all 1.
    pub fn stated(&self) -> Scales {
        Scales { origins: 1.0, zeros: vec![1.0; self.roots[1].ncols()] }
    }

    /// P₀ (m × m) with these scales.
    pub fn covariance(&self, scales: &Scales) -> DMatrix<f64> {
        let mut all = DMatrix::from_diagonal(&self.own);
        let [origins, zeros] = &self.roots;
        all.gemm(scales.origins * scales.origins, origins, &origins.transpose(), 1.0);
        let mut zeros = zeros.clone();
        zeros.column_iter_mut().zip(&scales.zeros).for_each(|(mut column, scale)| column *= *scale);
        all.gemm(1.0, &zeros, &zeros.transpose(), 1.0);
        let learned = all.nrows() - self.held;
        let conditions: Vec<usize> = self.fixed.iter().copied().chain(learned..all.nrows()).collect();
        let mut covariance = all.view((0, 0), (learned, learned)).into_owned();
        if !conditions.is_empty() {
            let across = all.select_columns(&conditions).rows(0, learned).into_owned();
            let mut among =
                DMatrix::from_fn(conditions.len(), conditions.len(), |i, j| all[(conditions[i], conditions[j])]);
            for (k, place) in conditions.iter().enumerate() {
                // Of what is held the rows hold its variance already.
                if *place < learned {
                    among[(k, k)] += Self::HELD * Self::HELD;
                }
            }
            if let Some(among) = Cholesky::new(among) {
                covariance -= &across * among.solve(&across.transpose());
            }
            // What rounding leaves of a coordinate that is known exactly.
            for k in &self.fixed {
                covariance[(*k, *k)] = covariance[(*k, *k)].max(Self::HELD * Self::HELD);
            }
        }
        (&covariance + covariance.transpose()) * 0.5
    }

    /// P₀⁻¹ with the scale of origins at a place of the [grid](Self::GRID), where no zero is off; `None` where rounding leaves P₀ no
    /// covariance.
    pub(crate) fn inverted(&self, origins: usize) -> Option<&Inverted> {
        let zeros = || vec![NONE; self.roots[1].ncols()];
        let invert = || Inverted::of(self.covariance(&Scales { origins: Self::GRID[origins], zeros: zeros() }));
        self.inverted[origins].get_or_init(invert).as_ref()
    }

    /// The change (one column each) that a zero off by one deviation makes to the learned coordinates, at some scale of origins.
    /// Where no axis is held, these are the columns of the roots.
    pub(crate) fn zeros(&self, origins: f64) -> DMatrix<f64> {
        let columns = self.roots[1].ncols();
        let learned = self.own.len() - self.held;
        if self.held == 0 && self.fixed.is_empty() {
            return self.roots[1].clone();
        }
        let with = |zero: Option<usize>| {
            let zeros = (0..columns).map(|column| if Some(column) == zero { 1.0 } else { NONE }).collect();
            self.covariance(&Scales { origins, zeros })
        };
        let without = with(None);
        let mut found = DMatrix::zeros(learned, columns);
        for column in 0..columns {
            // One zero makes a difference of rank one.
            let difference = with(Some(column)) - &without;
            let largest = difference.diagonal().imax();
            let variance = difference[(largest, largest)];
            if variance > 0.0 {
                found.set_column(column, &(difference.column(largest) / variance.sqrt()));
            }
        }
        found
    }

    /// ln of the prior probability of each scale on the [grid](Self::GRID), for origins and for a zero.
    pub(crate) fn log_probabilities() -> [Vec<f64>; 2] {
        [0, 1].map(|kind| {
            let slab = |scale: &f64| exp(-0.5 * (ln(*scale) / Self::SPREAD[kind]).powi(2));
            let rest = &Self::GRID[1..];
            let total: f64 = rest.iter().map(slab).sum();
            let right = Self::RIGHT[kind];
            std::iter::once(ln(right)).chain(rest.iter().map(|scale| ln((1.0 - right) * slab(scale) / total))).collect()
        })
    }

    /// The standard deviation of every coordinate, at scales of 1.
    pub fn deviations(&self) -> DVector<f64> {
        self.covariance(&self.stated()).diagonal().map(|variance| variance.max(0.0).sqrt())
    }
}

/// A twist of all that a joint carries.
struct Twist {
    joint: usize,
    at: Point3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl Twist {
    /// Adds how it moves an element, in the chart there.
    fn moves(&self, element: &Element, coordinates: &mut [f64]) {
        let shift = |x: &Point3<f64>| self.linear + self.angular.cross(&(x - self.at));
        let mut add = |from: usize, values: &[f64]| {
            coordinates[from..].iter_mut().zip(values).for_each(|(x, value)| *x += value);
        };
        match element {
            Element::Axis(joint) => {
                let w = joint.direction();
                let basis = chart::basis(&w).transpose();
                let turn = basis * self.angular.cross(&w);
                match joint.line() {
                    Some(line) => {
                        add(0, (basis * shift(&line.point)).as_slice());
                        add(2, turn.as_slice());
                    }
                    None => add(0, turn.as_slice()),
                }
            }
            Element::Point(point) => add(0, shift(point).as_slice()),
            Element::Pose(pose) => {
                add(0, shift(&Point3::from(pose.translation.vector)).as_slice());
                add(3, self.angular.as_slice());
            }
            Element::Numbers(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3};
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::{
        kinematics::Line,
        model::{Place, Target, random::random_direction},
    };

    /// A described chain, or several that branch: for each joint its frame in the one that carries it, and its axis there.
    struct Described {
        tree: crate::kinematics::Tree,
        origins: Vec<Isometry3<f64>>,
        axes: Vec<UnitVector3<f64>>,
        slides: Vec<bool>,
        target: Isometry3<f64>,
    }

    impl Described {
        fn random(rng: &mut ChaCha8Rng, joints: usize) -> Self {
            let mut pose = || {
                let mut vector = |size: f64| Vector3::from_fn(|_, _| size * rng.random_range(-1.0..1.0));
                Isometry3::new(vector(0.3), vector(1.5))
            };
            let origins = (0..joints).map(|_| pose()).collect();
            let target = pose();
            let axes = (0..joints).map(|_| random_direction(rng)).collect();
            let slides = (0..joints).map(|_| rng.random_range(0..4) == 0).collect();
            Self { tree: crate::kinematics::Tree::default(), origins, axes, slides, target }
        }

        /// This one with joints that hang anywhere before them.
        fn branching(self, rng: &mut ChaCha8Rng) -> Self {
            let parents = (0..self.origins.len()).map(|joint| rng.random_range(0..=joint).checked_sub(1)).collect();
            Self { tree: crate::kinematics::Tree::new(parents).expect("a tree"), ..self }
        }

        /// The robot with its joints at zeros that are off by so much, and the frames of its joints.
        fn state(&self, zeros: &[f64]) -> (State, Vec<Point3<f64>>) {
            let (mut links, mut joints, mut origins) = (vec![Isometry3::identity()], Vec::new(), Vec::new());
            for (joint, origin) in self.origins.iter().enumerate() {
                let mut frame: Isometry3<f64> = links[self.tree.link_before(joint)] * origin;
                let at: Point3<f64> = frame.translation.vector.into();
                let direction = UnitVector3::new_normalize(frame * self.axes[joint].into_inner());
                let slides = self.slides[joint];
                joints.push(if slides {
                    Joint::Prismatic(direction)
                } else {
                    Joint::Revolute(Line { point: at, direction })
                });
                origins.push(at);
                frame *= if slides {
                    Translation3::from(self.axes[joint].into_inner() * zeros[joint]).into()
                } else {
                    let turn = UnitQuaternion::from_axis_angle(&self.axes[joint], zeros[joint]);
                    Isometry3::from_parts(Translation3::identity(), turn)
                };
                links.push(frame);
            }
            let place = links[self.origins.len()] * self.target;
            let mut state = State { tree: self.tree.clone(), ..State::arm(joints, place.translation.vector.into()) };
            state.targets.push(Target { link: self.origins.len(), place: Place::Pose(place) });
            (state, origins)
        }

        /// With origins and zeros off as is said of them.
        fn perturbed(&self, errors: ChainErrors, rng: &mut ChaCha8Rng) -> State {
            let mut normal = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
            let origins = self.origins.iter().map(|origin| {
                let shift = Vector3::from_fn(|_, _| normal(errors.point_m));
                let turn = Vector3::from_fn(|_, _| normal(errors.direction_rad));
                origin * Isometry3::new(shift, turn)
            });
            let origins = origins.collect();
            let zeros = self.slides.iter().map(|slides| normal(if *slides { errors.zero_m } else { errors.zero_rad }));
            let zeros: Vec<f64> = zeros.collect();
            let (tree, axes, slides) = (self.tree.clone(), self.axes.clone(), self.slides.clone());
            Self { tree, origins, axes, slides, target: self.target }.state(&zeros).0
        }
    }

    /// Small, so that what is of second order is lost in the noise of the draws.
    const ERRORS: ChainErrors = ChainErrors { point_m: 5e-4, direction_rad: 1e-3, zero_rad: 2e-3, zero_m: 8e-4 };
    const NOTHING: f64 = 1e-9;

    fn singly(joints: usize) -> Vec<Vec<(usize, f64)>> {
        (0..joints).map(|joint| vec![(joint, 1.0)]).collect()
    }

    fn prior(state: &State, layout: &Layout, origins: &[Point3<f64>]) -> ChainPrior {
        // Of axes what is stated one by one does not count.
        let own = DVector::from_iterator(
            layout.dimension(),
            layout.blocks().flat_map(|(block, range)| {
                range.map(move |_| if matches!(block, Block::Axis(_)) { 0.01 } else { NOTHING })
            }),
        );
        ChainPrior::new(state, layout, origins, &singly(origins.len()), ERRORS, &own)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// P₀ is the covariance of tangent coordinates of robots whose every frame is off in the one before, targets with them.
        #[test]
        fn the_covariance_is_that_of_chains_that_are_off_link_by_link(seed: u64, joints in 2_usize..7, branches: bool) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let described = Described::random(&mut rng, joints);
            let described = if branches { described.branching(&mut rng) } else { described };
            let (state, origins) = described.state(&vec![0.0; joints]);
            let layout = Layout::new(&state, (0..joints).map(Block::Axis).chain([Block::Target(0), Block::Target(1)]));
            let mut own = DVector::from_element(layout.dimension(), 0.01);
            for target in [Block::Target(0), Block::Target(1)] {
                own.rows_range_mut(layout.block(target).expect("learned")).fill(2e-6);
            }
            let chain = ChainPrior::new(&state, &layout, &origins, &singly(joints), ERRORS, &own);
            let expected = chain.covariance(&chain.stated());
            let draws = 4000;
            let mut found = DMatrix::zeros(layout.dimension(), layout.dimension());
            for _ in 0..draws {
                let delta = state.local(&layout, &described.perturbed(ERRORS, &mut rng)).expect("near");
                found += &delta * delta.transpose() / f64::from(draws);
            }
            for i in 0..layout.dimension() {
                for j in 0..layout.dimension() {
                    // Six deviations of a sample covariance, √((1 + ρ²)/n) in units of both.
                    let unit = (expected[(i, i)] * expected[(j, j)]).sqrt();
                    let away = (found[(i, j)] - expected[(i, j)]) / unit;
                    prop_assert!(away.abs() < 6.0 * (2.0 / f64::from(draws)).sqrt() + 0.01, "{i} {j}: {away}");
                }
            }
        }

        /// Two limbs on one trunk, their joints by turns: of each limb the prior is that of an arm of its joints alone, and what both
        /// share is what the trunk's errors make of them.
        #[test]
        fn the_prior_of_a_limb_is_that_of_an_arm(seed: u64, trunk in 1_usize..3, each in 1_usize..4) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let one = Described::random(&mut rng, trunk + each);
            let mut other = Described::random(&mut rng, trunk + each);
            other.origins[..trunk].copy_from_slice(&one.origins[..trunk]);
            other.axes[..trunk].copy_from_slice(&one.axes[..trunk]);
            other.slides[..trunk].copy_from_slice(&one.slides[..trunk]);
            let zeros = vec![0.0; trunk + each];
            let arms = [one, other].map(|described| described.state(&zeros));
            // The joints of each limb in the tree.
            let places = [0, 1].map(|arm| (0..trunk).chain((0..each).map(move |k| trunk + 2 * k + arm)).collect::<Vec<_>>());
            let mut tree = State::arm(vec![arms[0].0.joints[0]; trunk + 2 * each], arms[0].0.marker());
            let mut parents = vec![None; trunk + 2 * each];
            let mut origins = vec![Point3::origin(); trunk + 2 * each];
            for (places, (arm, of_arm)) in places.iter().zip(&arms) {
                for (k, place) in places.iter().enumerate() {
                    (tree.joints[*place], origins[*place]) = (arm.joints[k], of_arm[k]);
                    parents[*place] = k.checked_sub(1).map(|before| places[before]);
                }
            }
            tree.tree = crate::kinematics::Tree::new(parents).expect("a tree");
            tree.targets[0].link = places[0][trunk + each - 1] + 1;
            let layout = Layout::new(&tree, (0..tree.joints.len()).map(Block::Axis).chain([Block::Target(0)]));
            // Nothing is held: what is held of one limb would tell of the trunk.
            let covariance = |state: &State, layout: &Layout, origins: &[Point3<f64>]| {
                let own = DVector::from_element(layout.dimension(), 0.01);
                let chain = ChainPrior::new(state, layout, origins, &singly(origins.len()), ERRORS, &own);
                chain.covariance(&chain.stated())
            };
            let whole = covariance(&tree, &layout, &origins);
            for (index, (places, (arm, of_arm))) in places.iter().zip(&arms).enumerate() {
                // The first limb carries the target.
                let target = (index == 0).then_some(Block::Target(0));
                let own = Layout::new(arm, (0..arm.joints.len()).map(Block::Axis).chain(target));
                let expected = covariance(arm, &own, of_arm);
                let blocks = places.iter().map(|place| Block::Axis(*place)).chain(target);
                let rows: Vec<usize> = blocks.filter_map(|block| layout.block(block)).flatten().collect();
                prop_assert_eq!(rows.len(), own.dimension());
                let found = DMatrix::from_fn(rows.len(), rows.len(), |i, j| whole[(rows[i], rows[j])]);
                prop_assert!((found - &expected).amax() < 1e-12 * expected.amax().max(1e-3), "limb {index}");
            }
        }

        /// What is held stays, and of all chains those are left that leave it where it is: what is expected of the rest given that.
        #[test]
        fn what_is_held_conditions_the_rest(seed: u64, joints in 3_usize..7) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, origins) = Described::random(&mut rng, joints).state(&vec![0.0; joints]);
            let held = rng.random_range(0..joints);
            let all = Layout::new(&state, (0..joints).map(Block::Axis));
            let some = Layout::new(&state, (0..joints).filter(|joint| *joint != held).map(Block::Axis));
            let full = prior(&state, &all, &origins);
            let full = full.covariance(&full.stated());
            let chain = prior(&state, &some, &origins);
            let found = chain.covariance(&chain.stated());
            let of = all.block(Block::Axis(held)).expect("learned");
            let rest: Vec<usize> = (0..all.dimension()).filter(|k| !of.contains(k)).collect();
            let of: Vec<usize> = of.collect();
            let pick = |rows: &[usize], columns: &[usize]| full.select_rows(rows).select_columns(columns);
            let inverse = pick(&of, &of).try_inverse().expect("positive");
            let across = pick(&rest, &of);
            let expected = pick(&rest, &rest) - &across * inverse * across.transpose();
            prop_assert!((&found - &expected).amax() < 1e-6 * full.amax(), "{}", (&found - &expected).amax());
            prop_assert!(found.cholesky().is_some());
            // A direction that is held is a condition as well.
            let mut own = DVector::from_element(all.dimension(), 0.01);
            let direction = all.direction(held).expect("learned");
            own.rows_range_mut(direction.clone()).fill(1e-6);
            let chain = ChainPrior::new(&state, &all, &origins, &singly(joints), ERRORS, &own);
            let found = chain.covariance(&chain.stated());
            prop_assert!(direction.clone().all(|k| found[(k, k)].sqrt() < 2e-6));
            prop_assert!(found.clone().cholesky().is_some());
            prop_assert!((0..all.dimension()).all(|k| found[(k, k)] <= full[(k, k)] * (1.0 + 1e-9) + 1e-11));
        }

        /// Zeros that are off make the inverse that they make by Woodbury's formula.
        #[test]
        fn zeros_are_added_to_what_is_inverted(seed: u64, joints in 2_usize..7) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (state, origins) = Described::random(&mut rng, joints).state(&vec![0.0; joints]);
            let layout = Layout::new(&state, (0..joints).map(Block::Axis));
            let chain = prior(&state, &layout, &origins);
            let place = rng.random_range(1..ChainPrior::GRID.len());
            let mut scales = Scales { origins: ChainPrior::GRID[place], zeros: vec![NONE; joints] };
            scales.zeros[rng.random_range(0..joints)] = 1.5;
            let variances: Vec<f64> = scales.zeros.iter().map(|scale| scale * scale).collect();
            let with = chain.inverted(place).expect("positive").with(&chain.zeros(scales.origins), &variances);
            let with = with.expect("positive");
            let covariance = chain.covariance(&scales);
            let unit = &with.information * &covariance - DMatrix::identity(layout.dimension(), layout.dimension());
            prop_assert!(unit.amax() < 1e-3, "{}", unit.amax());
            let log = Inverted::of(covariance).expect("positive").log_determinant;
            prop_assert!((with.log_determinant - log).abs() < 1e-3);
        }
    }

    /// A joint whose offset is learned has no zero beside it.
    #[test]
    fn zeros_are_not_counted_twice() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (state, origins) = Described::random(&mut rng, 4).state(&[0.0; 4]);
        let axes = (0..4).map(Block::Axis);
        let with = Layout::new(&state, axes.clone().chain((0..4).map(Block::Offset)));
        let chain = prior(&state, &with, &origins);
        let without = prior(&state, &Layout::new(&state, axes), &origins);
        let nothing = Scales { origins: 1.0, zeros: vec![0.0; 4] };
        let m = without.covariance(&nothing).nrows();
        let found = chain.covariance(&chain.stated()).view((0, 0), (m, m)).into_owned();
        assert!((found - without.covariance(&nothing)).amax() < 1e-15);
    }
}
