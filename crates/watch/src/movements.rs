//! Movements that tell best which change it is, and how large; and what sightings can show at all.
//!
//! With the explanations of an alarm as one Gaussian of all suspects' changes a (means and covariances weighed by their probabilities,
//! so that a suspect that is unlikely counts little), a movement with readings r = Hδ + G a + ε tells of a
//!
//! ```text
//! I(r; a) = ½ ln det(I + H P Hᵀ + G C Gᵀ) − ½ ln det(I + H P Hᵀ)        (nats)
//! ```
//!
//! and that is what is chosen by, one movement after the other, each given those before it. What they leave of each suspect's size is
//! what would be known if it is that one.

use body_schema_engine::{elementary::ln, sensing::Observation};
use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{
    Suspect, Watch,
    body::Linear,
    evidence::Turn,
    filter::{Filter, Heard, Part},
    posterior::{Amount, standing},
};

/// The movements that are told.
const TOLD: usize = 3;
/// The most suspects that are told apart.
const SUSPECTS: usize = 6;

/// Movements that tell best.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Movements {
    /// The joints' positions, rad or m, in the order in which they tell most.
    pub positions: Vec<Vec<f64>>,
    /// What each tells of the change beyond those before it, nats.
    pub tells_nats: Vec<f64>,
    /// What is to be expected of each suspect's size after all of them, if it is that one: standard deviations.
    pub leaves: Vec<Expected>,
}

/// What is to be expected of a suspect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// The suspect.
    pub suspect: Suspect,
    /// Its name.
    pub name: String,
    /// Its probability now.
    pub probability: f64,
    /// Its size as it is known now, with the deviation that the movements would leave.
    pub amounts: Vec<Amount>,
    /// The distance between the readings that it predicts and those that the likeliest suspect does, in standard deviations over all the
    /// movements; null of the likeliest. From 4 on they are told apart.
    pub apart_sds: Option<f64>,
}

/// A posture at which something may be seen.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The joints' positions, rad or m.
    pub positions: &'a [f64],
    /// What was seen there: which readings there would be again.
    pub observation: &'a Observation,
}

impl Watch {
    /// The movements that would tell best of what stands, among `known` postures and `others` at which something is seen; `None` while no
    /// change stands, or where no movement tells anything.
    pub fn movements(&self, known: &[Known<'_>], others: &[Vec<f64>]) -> Option<Movements> {
        let null = self.told_by().nulls().first()?;
        let groups = standing(self.told_by().nulls());
        let changed = |turn: Turn| if let Turn::Change(index) = turn { Some(index) } else { None };
        let suspects: Vec<(usize, f64, DVector<f64>, DMatrix<f64>)> = groups
            .into_iter()
            .filter_map(|group| Some((changed(group.turn)?, group.probability, group.mean, group.covariance)))
            // Of what has no numbers no movement tells a size.
            .filter(|(.., mean, _)| !mean.is_empty())
            .take(SUSPECTS)
            .collect();
        let body = self.body();
        let likeliest = suspects.first()?.0;
        let mut candidates: Vec<(Vec<f64>, Linear)> =
            known.iter().map(|it| (it.positions.to_vec(), body.linear(it.positions, it.observation, None))).collect();
        candidates.extend(others.iter().map(|positions| (positions.clone(), body.prospect(positions))));
        candidates.retain(|(_, linear)| linear.body.iter().all(|x| x.is_finite()) && linear.body.amax() > 0.0);

        // δ as the likeliest explanation has it, without the changes; then all suspects' changes as one Gaussian.
        let mut base = null.filter.clone();
        let parts: Vec<Part> = base.parts().collect();
        parts.into_iter().filter(|part| *part != Part::Body).for_each(|part| base.drop(part));
        let mut all = base.clone();
        for (index, ..) in &suspects {
            all.add(Part::Change(*index), &DVector::zeros(body.changes[*index].units.len()));
        }
        all.correlate(&moments(&suspects));

        let (mut positions, mut tells_nats, mut taken) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..TOLD {
            let tells = |linear: &Linear| {
                let heard = Heard { linear, posture: None, noise: 1.0 };
                // Both have heard of the movements before, so that δ is as well known in one as in the other.
                Some(0.5 * (all.log_determinant(&heard)? - base.log_determinant(&heard)?))
            };
            let best = candidates.iter().enumerate().filter_map(|(index, (_, linear))| Some((index, tells(linear)?)));
            let (index, nats) = best.filter(|it| it.1.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))?;
            let (place, linear) = candidates.swap_remove(index);
            let heard = Heard { linear: &linear, posture: None, noise: 1.0 };
            all.shrink(&heard);
            base.shrink(&heard);
            positions.push(place);
            tells_nats.push(nats);
            taken.push(linear);
        }
        let leaves = suspects.iter().map(|(index, probability, mean, covariance)| {
            let mut filter = null.filter.clone();
            let parts: Vec<Part> = filter.parts().collect();
            parts.into_iter().filter(|part| *part != Part::Body).for_each(|part| filter.drop(part));
            filter.add(Part::Change(*index), &DVector::zeros(mean.len()));
            filter.correlate(covariance);
            taken.iter().for_each(|linear| filter.shrink(&Heard { linear, posture: None, noise: 1.0 }));
            let left = filter.of(Part::Change(*index)).map(|it| it.1.diagonal()).unwrap_or_default();
            let change = &body.changes[*index];
            let amount = |k: usize| super::posterior::amount(change, k, mean[k], left[k]);
            Expected {
                suspect: change.suspect,
                name: change.suspect.name(&body.names),
                probability: *probability,
                amounts: (0..mean.len()).map(amount).collect(),
                apart_sds: (*index != likeliest).then(|| apart(&taken, (*index, mean), (likeliest, &suspects[0].2))),
            }
        });
        let leaves = leaves.collect();
        Some(Movements { positions, tells_nats, leaves })
    }

    /// The deviation to which sightings at `known` postures determine each number of a change of the `suspect` that has happened just
    /// before them, if nothing is known of its size: rad or m; infinite where they say nothing. `None` of no suspect of this robot.
    ///
    /// A change of z of these deviations shifts what is predicted of all these sightings together by z standard deviations, the
    /// calibration's uncertainty and the noise counted.
    pub fn deviations(&self, suspect: Suspect, known: &[Known<'_>]) -> Option<Vec<f64>> {
        /// A prior of so many of a suspect's deviations counts as none.
        const WIDE: f64 = 100.0;
        let body = self.body();
        let index = body.changes.iter().position(|change| change.suspect == suspect)?;
        let mut filter = self.told_by().nulls().first()?.filter.clone();
        let parts: Vec<Part> = filter.parts().collect();
        parts.into_iter().filter(|part| !matches!(part, Part::Body)).for_each(|part| filter.drop(part));
        let wide = &body.changes[index].deviations * WIDE;
        filter.add(Part::Change(index), &wide.component_mul(&wide));
        for it in known {
            let linear = body.linear(it.positions, it.observation, None);
            filter.shrink(&Heard { linear: &linear, posture: None, noise: 1.0 });
        }
        let (_, covariance) = filter.of(Part::Change(index))?;
        let left = |k: usize| {
            let information = 1.0 / covariance[(k, k)] - 1.0 / (wide[k] * wide[k]);
            if information > 0.0 { 1.0 / information.sqrt() } else { f64::INFINITY }
        };
        Some((0..wide.len()).map(left).collect())
    }
}

/// The covariance of all suspects' changes together, each being what has happened with its probability: pₛ (Cₛ + mₛ mₛᵀ) − pₛ pₜ mₛ mₜᵀ.
fn moments(suspects: &[(usize, f64, DVector<f64>, DMatrix<f64>)]) -> DMatrix<f64> {
    let total: usize = suspects.iter().map(|it| it.2.len()).sum();
    let mut mean = DVector::zeros(total);
    let mut moments = DMatrix::zeros(total, total);
    let mut from = 0;
    for (_, probability, of, covariance) in suspects {
        let k = of.len();
        mean.rows_mut(from, k).copy_from(&(of * *probability));
        let second = (covariance + of * of.transpose()) * *probability;
        moments.view_mut((from, from), (k, k)).copy_from(&second);
        from += k;
    }
    moments - &mean * mean.transpose()
}

/// The distance between what two changes predict of the movements, in deviations of the noise.
fn apart(taken: &[Linear], one: (usize, &DVector<f64>), other: (usize, &DVector<f64>)) -> f64 {
    let of = |linear: &Linear| {
        (linear.changes[one.0].tr_mul(one.1) - linear.changes[other.0].tr_mul(other.1)).norm_squared()
    };
    taken.iter().map(of).sum::<f64>().sqrt()
}

impl Filter {
    /// Gives the last parts this covariance.
    fn correlate(&mut self, covariance: &DMatrix<f64>) {
        self.set_last(covariance);
    }

    /// ln det S of a sighting.
    fn log_determinant(&self, heard: &Heard<'_>) -> Option<f64> {
        let s = self.spread(heard);
        let factor = Cholesky::new(s)?;
        Some(2.0 * factor.l_dirty().diagonal().iter().map(|x| ln(*x)).sum::<f64>())
    }

    /// Learns the covariance that a sighting leaves, whatever is read.
    fn shrink(&mut self, heard: &Heard<'_>) {
        if let Some(predicted) = self.predict(heard) {
            self.update(heard, &predicted, 1.0);
        }
    }
}
