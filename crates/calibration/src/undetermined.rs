//! The directions that the rows cannot determine, in words.
//!
//! With Λ the information of the rows alone, scaled to a unit diagonal, directions whose eigenvalue is less than 10⁻¹² of the
//! greatest are determined by no row: there the estimate stays as described. Also named are parameters whose deviation has
//! hardly fallen from the prior's.

use nalgebra::DMatrix;

use super::{Case, Fit, Parameters};
use body_schema_engine::model::{Block, listed, null_space};
use body_schema_scenario::WorldSpec;

/// The share of a parameter that undetermined directions must hold for it to be named.
const NAMED: f64 = 0.05;
/// The share of the prior's deviation above which a deviation has hardly fallen.
const HARDLY: f64 = 0.9;

impl Case<'_> {
    /// The determined and undetermined parameters of a fit.
    pub(super) fn determined(&self, fit: &Fit) -> Parameters {
        let layout = &*fit.belief.layout;
        let free = self.undetermined(fit);
        let mut undetermined: Vec<String> = self.unread().into_iter().collect();
        undetermined.extend(self.names.undetermined(fit.state(), layout, &free, "these rows"));
        undetermined.extend(self.hardly(fit, &free));
        Parameters { learned: layout.dimension(), rank: layout.dimension() - free.ncols(), undetermined }
    }

    /// The fit with the covariance of the written files: a direction that no row determines is as the file has it, and has no
    /// deviation.
    pub(super) fn in_gauge(&self, fit: &Fit) -> Fit {
        let free = self.undetermined(fit);
        let mut shown = fit.clone();
        let fixed = || {
            let covariance = fit.belief.covariance.as_ref().filter(|_| free.ncols() > 0)?;
            let weighed = free.tr_mul(&covariance.clone().cholesky()?.solve(&free));
            Some(covariance - &free * weighed.cholesky()?.inverse() * free.transpose())
        };
        if let Some(covariance) = fixed() {
            shown.belief.covariance = Some(covariance);
        }
        shown
    }

    /// A sentence on the joints that the table has no column of.
    fn unread(&self) -> Option<String> {
        let WorldSpec::Measured { measurements, .. } = &self.scenario.world else { return None };
        let unread = measurements.unread.clone();
        let held = match unread.len() {
            0 => return None,
            1 => "it is held at 0 and stays",
            _ => "they are held at 0 and stay",
        };
        Some(format!(
            "the table has no column of {}, with which nothing moves that is measured: {held} as described",
            listed(unread)
        ))
    }

    /// An orthonormal basis of the directions that no row determines (m × k).
    fn undetermined(&self, fit: &Fit) -> DMatrix<f64> {
        let belief = &fit.belief;
        let mut information = self.information(fit);
        if let Some(known) = self.known {
            let nowhere = vec![0.0; belief.state.joints.len()];
            let rows = belief.measurement_model.equations_of(&belief.state, &belief.layout, &nowhere, known).rows;
            information += &rows * rows.transpose();
        }
        null_space(&information)
    }

    /// The information of a fit's rows about its parameters, without the prior (m × m).
    pub(super) fn information(&self, fit: &Fit) -> DMatrix<f64> {
        let belief = &fit.belief;
        let m = belief.layout.dimension();
        let mut information = DMatrix::zeros(m, m);
        for row in fit.rows.iter().map(|row| &self.rows[*row]) {
            let rows = belief
                .measurement_model
                .equations_of(&belief.state, &belief.layout, &row.positions, &row.observation)
                .rows;
            information += &rows * rows.transpose();
        }
        information
    }

    /// A sentence on the blocks whose every coordinate is known hardly better than before.
    fn hardly(&self, fit: &Fit, free: &DMatrix<f64>) -> Option<String> {
        let layout = &*fit.belief.layout;
        let covariance = fit.belief.covariance.as_ref()?;
        // As the rows have them: what shrinks with the scale of the prior alone is not told by rows.
        let prior = match (self.chain(layout), &fit.scales) {
            (Some(chain), Some(scales)) => chain.covariance(scales).diagonal().map(|x| x.max(0.0).sqrt()),
            _ => self.deviations(layout),
        };
        let share = |coordinate: usize| covariance[(coordinate, coordinate)].sqrt() / prior[coordinate];
        let is_told = |coordinate: usize| free.ncols() > 0 && free.row(coordinate).norm_squared() > NAMED;
        let hardly = |(block, range): (Block, std::ops::Range<usize>)| {
            let untold = range.clone().all(|coordinate| share(coordinate) > HARDLY) && !range.clone().all(is_told);
            untold.then(|| self.names.block(block))
        };
        let names: Vec<String> = layout.blocks().filter_map(hardly).collect();
        (!names.is_empty()).then(|| {
            format!(
                "these rows say next to nothing of {}: what is known has hardly grown beyond the prior; add rows in which the \
                 joints behind it move farther",
                listed(names)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use body_schema_scenario::{Scenario, builtin};

    /// What is undetermined of a real robot whose scenario is changed so, and its fit's covariance as it was and in the file's gauge.
    fn untold(name: &str, change: impl Fn(String) -> String) -> (Parameters, DMatrix<f64>, [DMatrix<f64>; 2]) {
        let nominal = builtin(name).expect("built in");
        let text = change(nominal.source.clone());
        let scenario = Scenario::parse("my.toml", &text, &|file| nominal.data_file(file)).expect("valid");
        let case = Case::new(&scenario).expect("measured");
        let rows: Vec<usize> = (0..case.rows.len()).collect();
        let nominal = case.nominal(&rows).expect("fitted");
        let fit = case.fit(&case.writable(), &rows, Some(nominal.state())).expect("fitted");
        let covariance = |fit: &Fit| fit.belief.covariance.clone().expect("kept");
        let free = case.undetermined(&fit);
        (case.determined(&fit), free, [covariance(&fit), covariance(&case.in_gauge(&fit))])
    }

    #[test]
    fn directions_are_told_by_their_meaning() {
        for (name, first) in [("ur10-camera", "shoulder_pan_joint"), ("tiago-mocap-3", "torso_lift_joint")] {
            let (Parameters { learned, rank, undetermined }, ..) = untold(name, |text| text);
            assert_eq!(learned - rank, 6, "{name}");
            let said = format!("where the base stands cannot be separated from where {first} and all that it carries");
            assert!(undetermined.len() == 1 && undetermined[0].starts_with(&said), "{undetermined:?}");
            assert!(undetermined[0].contains("6 directions in which both move together"), "{undetermined:?}");
        }
        let learned = "[robot]\noffsets = [\"elbow_joint\", \"wrist_1_joint\"]";
        let offsets = |text: String| text.replacen("[robot]", learned, 1);
        let (Parameters { undetermined, .. }, ..) = untold("ur10-camera", offsets);
        assert!(
            undetermined.iter().any(|said| said.starts_with("the zeros of elbow_joint and wrist_1_joint")),
            "{undetermined:?}"
        );
    }

    /// In the file's gauge nothing is known of what is fixed, and what rows tell is known as well as before.
    #[test]
    fn what_is_fixed_has_no_deviation() {
        let (_, free, [before, after]) = untold("ur10-camera", |text| text);
        let inverse = before.clone().cholesky().expect("positive").inverse();
        let across = free.tr_mul(&inverse);
        assert!((&across * &after).amax() < 1e-6 * (&across * &before).amax());
        for seed in 0..20 {
            // A combination that rows tell: across all that they do not.
            let some = DVector::from_fn(before.nrows(), |row, _| ((row * 7 + seed * 13) as f64).sin());
            let told = &some - &free * free.tr_mul(&some);
            let [one, other] = [&before, &after].map(|covariance| told.dot(&(covariance * &told)));
            assert!((one - other).abs() < 1e-6 * one, "{one} {other}");
        }
        assert!((0..before.nrows()).all(|k| after[(k, k)] <= before[(k, k)] * (1.0 + 1e-9)));
    }
}
