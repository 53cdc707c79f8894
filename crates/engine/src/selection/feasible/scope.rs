//! What may be proposed now.

use std::borrow::Cow;

use rand::Rng;

use super::{Constraints, feasible_sample::PATIENCE, travel};
use crate::{
    kinematics::JointBox,
    model::State,
    selection::{Actions, Movement, SelectionError, Situation},
    sensing::Servo,
};

/// What may be proposed in a [`Situation`]: a list of movements or a box, and in the box what the constraints leave of it.
///
/// Where a robot aims a camera by itself, a posture of the box stands for the one with the servo joints as they would aim in the robot
/// that is believed: [`aimed`](Self::aimed). What is evaluated and proposed is that one.
pub struct Scope<'a> {
    /// Where to choose from.
    pub domain: Domain<'a>,
    constraints: Option<&'a Constraints>,
    /// Where the robot stands, rad or m per joint, if that is known.
    from: Option<&'a [f64]>,
    /// The joints that aim a camera, and the robot as it is believed.
    servo: Option<(&'a Servo, &'a State)>,
}

/// Where to choose from.
pub enum Domain<'a> {
    /// One of a list of movements. All are feasible, and there is one at least.
    List {
        /// The movements.
        movements: Cow<'a, [Movement]>,
        /// The joint box; `None` for recorded ones.
        joints: Option<&'a JointBox>,
    },
    /// A posture that [is feasible](Scope::is_feasible).
    Box {
        /// The box to search: without constraints the joint box, all of it feasible; with them the smallest box that is sure
        /// to hold all that is.
        searched: Cow<'a, JointBox>,
        /// The joint box.
        joints: &'a JointBox,
    },
}

impl<'a> Scope<'a> {
    /// Of a situation.
    ///
    /// # Errors
    ///
    /// [`SelectionError::Exhausted`] if a list has come to its end; [`SelectionError::Infeasible`] if nothing in it is
    /// feasible, or a joint cannot come back within its limits.
    pub fn of(situation: &Situation<'a>) -> Result<Self, SelectionError> {
        let (constraints, from) = (situation.constraints, standing(situation));
        let servo = servo(situation);
        let domain = match (situation.actions, constraints) {
            (Actions::Pool(pool), _) if pool.is_empty() => return Err(SelectionError::Exhausted),
            (Actions::Pool(pool), None) => Domain::List { movements: Cow::Borrowed(pool), joints: None },
            (Actions::Pool(pool), Some(constraints)) => Domain::List {
                movements: Cow::Owned(constraints.of(from, pool.iter().cloned(), |movement| &movement.configuration)?),
                joints: None,
            },
            (Actions::Sockets(sockets), None) => {
                Domain::Box { searched: Cow::Borrowed(sockets.limits()), joints: sockets.limits() }
            }
            (Actions::Sockets(sockets), Some(constraints)) => {
                Domain::Box { searched: Cow::Owned(constraints.reach(from)?), joints: sockets.limits() }
            }
            (Actions::Box(joints), None) => Domain::Box { searched: left_by(servo, Cow::Borrowed(joints)), joints },
            (Actions::Box(joints), Some(constraints)) => match &constraints.allowed {
                Some(allowed) => {
                    let movement = |posture: &Vec<f64>| Movement::to(posture.clone());
                    let movements =
                        constraints.of(from, allowed.iter().map(movement), |movement| &movement.configuration)?;
                    Domain::List { movements: Cow::Owned(movements), joints: Some(joints) }
                }
                None => Domain::Box { searched: left_by(servo, Cow::Owned(constraints.reach(from)?)), joints },
            },
        };
        Ok(Self { domain, constraints, from, servo })
    }

    /// Of what could be proposed if every posture could be, recorded or not: to show how the criterion looks over the whole
    /// joint box. `None` where the constraints are a list. With the box to search.
    ///
    /// # Errors
    ///
    /// [`SelectionError::Infeasible`] if a joint cannot come back within its limits.
    pub fn around(
        situation: &Situation<'a>,
        joints: &'a JointBox,
    ) -> Result<Option<(Self, Cow<'a, JointBox>)>, SelectionError> {
        let (constraints, from) = (situation.constraints, standing(situation));
        if constraints.is_some_and(|constraints| constraints.allowed.is_some()) {
            return Ok(None);
        }
        let searched = constraints.map(|constraints| constraints.reach(from)).transpose()?;
        let servo = servo(situation);
        let searched = left_by(servo, searched.map_or(Cow::Borrowed(joints), Cow::Owned));
        let domain = Domain::Box { searched: searched.clone(), joints };
        Ok(Some((Self { domain, constraints, from, servo }, searched)))
    }

    /// The box to search; `None` where there is a list.
    pub fn searched(&self) -> Option<&JointBox> {
        match &self.domain {
            Domain::List { .. } => None,
            Domain::Box { searched, .. } => Some(searched),
        }
    }

    /// Whether anything is constrained: by constraints, or by joints that follow from the others.
    pub fn is_constrained(&self) -> bool {
        self.constraints.is_some() || self.servo.is_some()
    }

    /// The joints that follow from the others.
    pub fn following(&self) -> impl Iterator<Item = usize> {
        self.servo.into_iter().flat_map(|(servo, _)| servo.joints())
    }

    /// The posture that a posture of the box stands for: with the servo joints, if there are any, as they would aim.
    pub fn aimed(&self, posture: Vec<f64>) -> Vec<f64> {
        match self.servo {
            Some((servo, state)) => servo.aimed(state, &posture),
            None => posture,
        }
    }

    /// Whether a posture may be proposed now.
    pub fn is_feasible(&self, posture: &[f64]) -> bool {
        self.constraints.is_none_or(|constraints| constraints.allow(self.from, posture))
    }

    /// The values of all candidates, in order: not finite where one is not feasible, which `values` is never asked, and
    /// elsewhere its value and the price of the travel to it.
    pub fn evaluate(&self, candidates: &[Vec<f64>], values: impl FnOnce(&[Vec<f64>]) -> Vec<f64>) -> Vec<f64> {
        self.evaluate_beside(&[], candidates, values)
    }

    /// The same for movements that are planned beside others: the price is that of the travel from where the robot stands or
    /// from one of the `others`, whichever is nearest, as a tree that joins them all would grow.
    pub fn evaluate_beside(
        &self,
        others: &[Vec<f64>],
        candidates: &[Vec<f64>],
        values: impl FnOnce(&[Vec<f64>]) -> Vec<f64>,
    ) -> Vec<f64> {
        let aimed: Vec<Vec<f64>>;
        let candidates = match self.servo {
            Some((servo, state)) => {
                aimed = candidates.iter().map(|posture| servo.aimed(state, posture)).collect();
                &aimed
            }
            None => candidates,
        };
        let Some(constraints) = self.constraints else { return values(candidates) };
        let is_feasible: Vec<bool> = candidates.iter().map(|posture| constraints.allow(self.from, posture)).collect();
        let kept = candidates.iter().zip(&is_feasible).filter(|(_, is_feasible)| **is_feasible);
        let kept: Vec<Vec<f64>> = kept.map(|(posture, _)| posture.clone()).collect();
        let priced = values(&kept)
            .into_iter()
            .zip(&kept)
            .map(|(value, posture)| value + self.travel_cost(others.iter().map(Vec::as_slice), posture));
        let mut priced = priced.collect::<Vec<f64>>().into_iter();
        let mut value = |is_feasible: &bool| if *is_feasible { priced.next() } else { None };
        is_feasible.iter().map(|is_feasible| value(is_feasible).unwrap_or(f64::INFINITY)).collect()
    }

    /// What the travel to a posture costs, in units of the criterion.
    pub fn price(&self, posture: &[f64]) -> f64 {
        self.travel_cost([], posture)
    }

    /// The same beside other movements; see [`evaluate_beside`](Self::evaluate_beside).
    pub fn travel_cost<'p>(&self, others: impl IntoIterator<Item = &'p [f64]>, posture: &[f64]) -> f64 {
        let price = self.constraints.map_or(0.0, |constraints| constraints.price);
        if price == 0.0 {
            return 0.0;
        }
        let standing = self.from.map(|from| price * travel(from, posture));
        let beside = others.into_iter().map(|place| price * travel(place, posture));
        standing.into_iter().chain(beside).min_by(f64::total_cmp).unwrap_or(0.0)
    }

    /// A feasible posture, drawn uniformly.
    ///
    /// # Errors
    ///
    /// [`SelectionError::Infeasible`] if neither draws nor a search find a feasible posture.
    pub fn draw<R: Rng + ?Sized>(&self, limits: &JointBox, rng: &mut R) -> Result<Vec<f64>, SelectionError> {
        let mut draws = std::iter::repeat_with(|| self.aimed(limits.draw(rng))).take(PATIENCE);
        match draws.find(|posture| self.is_feasible(posture)) {
            Some(posture) => Ok(posture),
            None => self.some()?.into_iter().next().ok_or(SelectionError::Unaimed),
        }
    }

    /// Some feasible postures, one at least where anything is constrained, always the same ones: where a search over the box
    /// comes upon none.
    ///
    /// # Errors
    ///
    /// [`SelectionError::Infeasible`] if the constraints exclude every posture that was tried, [`SelectionError::Unaimed`] if they do
    /// once joints aim their camera.
    pub fn some(&self) -> Result<Vec<Vec<f64>>, SelectionError> {
        let some = self.constraints.map_or(Ok(Vec::new()), |constraints| constraints.some(self.from))?;
        let aimed = some.into_iter().map(|posture| self.aimed(posture));
        let feasible: Vec<Vec<f64>> = aimed.filter(|posture| self.is_feasible(posture)).collect();
        // Aimed, what was feasible may be so no more.
        if feasible.is_empty() && self.constraints.is_some() { Err(SelectionError::Unaimed) } else { Ok(feasible) }
    }

    /// The posture itself if it may be proposed, or else the nearest one to it, by travel, of some that may.
    ///
    /// # Errors
    ///
    /// [`SelectionError::Infeasible`] if the constraints exclude every posture that was tried.
    pub fn towards(&self, posture: Vec<f64>) -> Result<Vec<f64>, SelectionError> {
        if self.is_feasible(&posture) {
            return Ok(posture);
        }
        let candidates = match &self.domain {
            Domain::List { movements, .. } => movements.iter().map(|movement| movement.configuration.clone()).collect(),
            Domain::Box { searched, .. } => {
                let nearest = searched.from_unit(&searched.to_unit(&posture));
                if self.is_feasible(&nearest) {
                    return Ok(nearest);
                }
                self.some()?
            }
        };
        let nearest = candidates.into_iter().min_by(|a, b| travel(a, &posture).total_cmp(&travel(b, &posture)));
        nearest.ok_or(SelectionError::Exhausted)
    }
}

/// The joints that aim a camera, where a posture is chosen freely.
fn servo<'a>(situation: &Situation<'a>) -> Option<(&'a Servo, &'a State)> {
    let belief = situation.belief;
    let servo = belief.measurement_model.servo().filter(|_| matches!(situation.actions, Actions::Box(_)));
    servo.map(|servo| (servo, &belief.state))
}

/// What joints that aim a camera leave of a box to choose from.
fn left_by<'a>(servo: Option<(&Servo, &State)>, joints: Cow<'a, JointBox>) -> Cow<'a, JointBox> {
    match servo {
        Some((servo, _)) => Cow::Owned(servo.without(&joints)),
        None => joints,
    }
}

/// Where the robot stands, if that matters.
fn standing<'a>(situation: &Situation<'a>) -> Option<&'a [f64]> {
    situation.constraints.and_then(|constraints| situation.history.posture().or(constraints.start.as_deref()))
}
