//! Movements in each of which a target is held in a socket.
//!
//! Where the socket is, is only believed, and so is where a posture brings the target: what is proposed lies on the believed
//! manifold `p(θ) = s` (see [`Manifold`]), and whoever carries it out pushes the target in. Candidates are uniform draws of the
//! joint box, projected; the best of them are polished along the tangent, by steps that are projected again.

use rand::{Rng, RngExt};

use super::{
    Movement, Scope, SelectionError,
    held::{Held, Values, evaluate, held},
};
use crate::{
    estimation::Belief,
    kinematics::JointBox,
    model::Manifold,
    optimize::{Differences, Polish, least, polish},
};

/// The sockets in which movements end.
#[derive(Clone, Debug, PartialEq)]
pub struct Sockets {
    limits: JointBox,
    count: usize,
    /// By socket the posture that it begins with, for as long as nothing was held there.
    beginnings: Vec<Movement>,
}

/// How many of the best draws are polished, how far, and how often the tangent is taken anew.
const POLISHED: usize = 3;
const POLISH: Polish = Polish { steps: 6, tolerance: 1e-3 };
const TANGENTS: usize = 2;
/// How far a polish may go from where its tangent touches, rad or m.
const REACH: f64 = 0.4;

impl Sockets {
    /// One socket for each of the postures that they begin with, within `limits`.
    pub fn new(limits: JointBox, beginnings: Vec<Vec<f64>>) -> Self {
        let count = beginnings.len();
        let beginning = |(socket, configuration)| Movement { configuration, row: None, socket: Some(socket) };
        Self { limits, count, beginnings: beginnings.into_iter().enumerate().map(beginning).collect() }
    }

    /// The posture that a socket begins with, of the first one in which nothing was held yet and of which that posture is
    /// within a scope. The others are gone to where they are believed to be.
    pub(super) fn beginning(&self, scope: &Scope<'_>) -> Option<&Movement> {
        self.beginnings.iter().find(|movement| scope.is_feasible(&movement.configuration))
    }

    /// Something was held in the socket of this movement.
    pub(super) fn use_up(&mut self, movement: &Movement) {
        self.beginnings.retain(|beginning| beginning.socket != movement.socket);
    }

    /// The believed postures in which the target is in a socket, in the box of a scope; `None` for a socket that no channel
    /// reads.
    fn manifold<'a>(&'a self, belief: &'a Belief, scope: &'a Scope<'_>, socket: usize) -> Option<Manifold<'a>> {
        let (_, target) = belief.measurement_model.holds(socket)?;
        let limits = scope.searched().unwrap_or(&self.limits);
        Some(Manifold::new(&belief.state, target, *belief.state.sockets.get(socket)?, limits))
    }

    /// The joint limits.
    pub(super) fn limits(&self) -> &JointBox {
        &self.limits
    }

    /// The movement to a posture that somebody else chose: into the socket to which the target is nearest, as believed.
    pub(super) fn movement_to(&self, belief: &Belief, configuration: Vec<f64>) -> Movement {
        let distance = |socket: usize| {
            let (_, target) = belief.measurement_model.holds(socket)?;
            Some((socket, (belief.state.target_at(target, &configuration) - belief.state.sockets[socket]).norm()))
        };
        let socket = least((0..self.count).filter_map(distance)).map(|(socket, _)| socket);
        Movement { configuration, row: None, socket }
    }

    /// A uniform draw of the joint box, projected into a socket chosen at random, and within a scope.
    pub(super) fn draw<R: Rng + ?Sized>(
        &self,
        belief: &Belief,
        scope: &Scope<'_>,
        rng: &mut R,
    ) -> Result<Movement, SelectionError> {
        let first = rng.random_range(0..self.count.max(1));
        let sockets = (0..self.count).map(|index| (first + index) % self.count);
        let drawn = sockets.into_iter().find_map(|socket| {
            let manifold = self.manifold(belief, scope, socket)?;
            let configuration = drawn_within(&manifold, scope, rng)?;
            Some(Movement { configuration, row: None, socket: Some(socket) })
        });
        drawn.ok_or(SelectionError::OutOfReach)
    }

    /// So many draws within a scope, in all sockets in turn; fewer where a socket is out of reach.
    pub(super) fn pool<R: Rng + ?Sized>(
        &self,
        belief: &Belief,
        scope: &Scope<'_>,
        count: usize,
        rng: &mut R,
    ) -> Vec<Movement> {
        let mut pool = Vec::with_capacity(count);
        for socket in 0..self.count {
            let Some(manifold) = self.manifold(belief, scope, socket) else { continue };
            for _ in 0..count.div_ceil(self.count) {
                let Some(configuration) = drawn_within(&manifold, scope, rng) else { break };
                pool.push(Movement { configuration, row: None, socket: Some(socket) });
            }
        }
        pool
    }

    /// The belief as it is in each socket: through the channels that read there.
    pub(super) fn held(&self, belief: &Belief) -> Vec<Held> {
        held(belief, (0..self.count).map(Some))
    }

    /// The best of a pool of movements, its best polished along their tangents; and its value, without the price of the travel
    /// there. `belief` says where the manifolds are, and `held` what movements in each socket are valued by.
    pub(super) fn best<'b>(
        &self,
        (belief, scope): (&Belief, &Scope<'_>),
        held: &'b [Held],
        pool: &[Movement],
        evaluations: &mut usize,
        values: impl Fn(&'b Belief) -> Result<Values<'b>, SelectionError>,
    ) -> Result<(Movement, f64), SelectionError> {
        if pool.is_empty() {
            return Err(SelectionError::OutOfReach);
        }
        *evaluations += pool.len();
        let mut found = evaluate(held, pool, &values)?;
        found.iter_mut().zip(pool).for_each(|(value, movement)| *value += scope.price(&movement.configuration));
        let mut order: Vec<usize> = (0..pool.len()).filter(|index| found[*index].is_finite()).collect();
        order.sort_by(|a, b| found[*a].total_cmp(&found[*b]));
        let mut polished = Vec::new();
        for index in order.into_iter().take(POLISHED) {
            let mut movement = pool[index].clone();
            let mut value = found[index];
            if let Some((socket, manifold)) = movement.socket.and_then(|k| Some((k, self.manifold(belief, scope, k)?)))
            {
                let values = values(&held[socket].1)?;
                for _ in 0..TANGENTS {
                    let (configuration, lower) =
                        along_tangent((&manifold, scope), &movement.configuration, value, evaluations, &values);
                    if lower >= value {
                        break;
                    }
                    (movement.configuration, value) = (configuration, lower);
                }
            }
            polished.push((movement, value));
        }
        let (movement, value) = least(polished).ok_or(SelectionError::NoFiniteCriterion)?;
        let price = scope.price(&movement.configuration);
        Ok((movement, value - price))
    }
}

/// Draws on a manifold before none within a scope is believed in.
const PATIENCE: usize = 100;

fn drawn_within<R: Rng + ?Sized>(manifold: &Manifold<'_>, scope: &Scope<'_>, rng: &mut R) -> Option<Vec<f64>> {
    (0..PATIENCE).map_while(|_| manifold.draw(rng)).find(|posture| scope.is_feasible(posture))
}

/// A better posture of the manifold near this one and within the scope, and its value; this one, where there is none.
fn along_tangent(
    (manifold, scope): (&Manifold<'_>, &Scope<'_>),
    start: &[f64],
    value: f64,
    evaluations: &mut usize,
    values: &Values<'_>,
) -> (Vec<f64>, f64) {
    let tangent = manifold.tangent(start);
    let at = |point: &Vec<f64>| {
        let mut posture = start.to_vec();
        for (x, along) in point.iter().zip(tangent.column_iter()) {
            posture.iter_mut().zip(along.iter()).for_each(|(q, along)| *q += REACH * (2.0 * x - 1.0) * along);
        }
        manifold.project(&posture).filter(|posture| scope.is_feasible(posture))
    };
    let evaluate = |points: &[Vec<f64>]| {
        let postures: Vec<Option<Vec<f64>>> = points.iter().map(at).collect();
        let landed: Vec<Vec<f64>> = postures.iter().flatten().cloned().collect();
        *evaluations += landed.len();
        let priced = values(&landed).into_iter().zip(&landed).map(|(value, posture)| value + scope.price(posture));
        let mut found = priced.collect::<Vec<f64>>().into_iter();
        postures.iter().map(|posture| posture.as_ref().and_then(|_| found.next()).unwrap_or(f64::INFINITY)).collect()
    };
    let (point, lower) = polish(&vec![0.5; tangent.ncols()], POLISH, Differences::Central, evaluate);
    match at(&point).filter(|_| lower < value) {
        Some(posture) => (posture, lower),
        None => (start.to_vec(), value),
    }
}
