//! What more rows would bring.
//!
//! With P = L Lᵀ the covariance that rows and prior leave, I the information of the rows alone and J the Jacobian of the hand where
//! it is asked about, k times as many rows of the same kind leave
//!
//! ```text
//! (P⁻¹ + (k − 1) I)⁻¹ = L V diag(1 / (1 + (k − 1) μ)) Vᵀ Lᵀ,    Lᵀ I L = V diag(μ) Vᵀ
//! e²(k) = Σᵢ ‖J L vᵢ‖² / (1 + (k − 1) μᵢ)
//! ```
//!
//! so that what no row tells (μ = 0) never falls, whatever their number. Beside that stands what no parameter explains: residuals beyond
//! the σ that the sensor's maker promises, which may as well be noise unless the same posture was measured again and tells; and what
//! held-out rows are off beyond all that is expected.

use nalgebra::Cholesky;

use super::{Case, Figures, Fit, MoreRows, Noise};
use crate::model::Workspace;

/// Postures over which expected errors are taken, at most.
const WORKSPACE: usize = 300;
/// So many times the rows that there are is as many as anybody could measure.
const MOST: f64 = 1e3;
/// Deviations that chance is granted before held-out rows are said to be worse than expected.
const CHANCE: f64 = 2.0;

/// How the expected error falls: by direction, its share of the square now, and μ.
struct Falls(Vec<(f64, f64)>);

impl Falls {
    /// e²(k) / e²(1).
    fn at(&self, k: f64) -> f64 {
        self.0.iter().map(|(share, mu)| share / (1.0 + (k - 1.0) * mu)).sum()
    }
}

impl Case<'_> {
    /// What more rows would bring, by what is expected and by what held-out rows say, each of which was predicted by `share` of the
    /// rows; `repeats_m` is the noise that repeated postures tell, per coordinate.
    pub(super) fn more_rows(
        &self,
        fit: &Fit,
        held_out: Option<(&Figures, f64)>,
        noise: &[Noise],
        repeats_m: Option<f64>,
    ) -> MoreRows {
        let mm = |metres: f64| metres * 1e3;
        let (wanted, rows) = (mm(self.scenario.settled_below_m), fit.rows.len());
        let workspace = self.asked_about();
        let mut certain = fit.belief.clone();
        certain.model_error_m = 0.0;
        let from_parameters = certain.expected_error_m(&workspace).map(mm);
        let to_spare: f64 = fit.noise.iter().map(|noise| noise.equations - noise.absorbed).sum();
        let mut told = MoreRows {
            rows,
            expected_mm: None,
            from_parameters_mm: from_parameters,
            model_error_mm: mm(fit.belief.model_error_m),
            untold_mm: 0.0,
            held_out_mm: None,
            wanted_mm: wanted,
            rows_needed: None,
            rows_needed_if_noise: None,
            said: "nothing is predicted without rows".to_owned(),
        };
        let (Some(error), Some(falls)) = (from_parameters, self.falls(fit, &workspace)) else { return told };
        let sigmas = noise.iter().filter(|noise| noise.unit == "m");
        let sigma = sigmas.filter_map(|noise| Some((mm(noise.sigma), mm(noise.explaining_sigma?)))).next();
        if let (Some((_, explaining)), Some(repeats)) = (sigma, repeats_m.map(mm)) {
            // Repeats tell noise from all else.
            told.model_error_mm = (3.0 * (explaining.powi(2) - repeats.powi(2)).max(0.0)).sqrt();
        }
        if let (Some((figures, share)), Some((promised, _))) = (held_out, sigma)
            && let Some(rms) = figures.rms_mm
        {
            let noise = 3.0 * repeats_m.map_or(promised, mm).powi(2);
            let spread = CHANCE * (2.0 / (3.0 * figures.readings.max(1) as f64)).sqrt();
            let found = (rms * rms - noise).max(0.0);
            told.held_out_mm = Some(found.sqrt());
            let expected = told.model_error_mm.powi(2) + error * error * falls.at(share);
            let beyond = (rms * rms * (1.0 - spread) - noise - expected).max(0.0);
            told.model_error_mm = told.model_error_mm.hypot(beyond.sqrt());
        }
        let floor = told.model_error_mm;
        told.expected_mm = Some(error.hypot(floor));
        told.untold_mm = error * falls.at(MOST).sqrt();
        let least = fit.belief.layout.dimension().div_ceil(self.equations_of_a_row(fit).max(1));
        let needed = |floor: f64| {
            let enough = |k: f64| error * error * falls.at(k) + floor * floor <= wanted * wanted;
            let (mut few, mut many) = (1.0 / rows.max(1) as f64, MOST);
            if !enough(many) {
                return None;
            }
            for _ in 0..60 {
                let middle = (few * many).sqrt();
                (few, many) = if enough(middle) { (few, middle) } else { (middle, many) };
            }
            Some(((many * rows as f64).ceil() as u64).max(least as u64))
        };
        let is_told = to_spare >= 1.0;
        told.rows_needed = needed(floor).filter(|_| is_told);
        let may_be_noise = repeats_m.is_none() && floor > 0.0 && told.rows_needed.is_none();
        told.rows_needed_if_noise = needed(0.0).filter(|_| is_told && may_be_noise);
        told.said = said(&told, is_told);
        told
    }

    /// The postures of the table, spread over it: where the robot is asked about.
    fn asked_about(&self) -> Workspace {
        let all = self.rows.len();
        let count = all.min(WORKSPACE);
        let configurations = (0..count).map(|k| self.rows[k * all / count].positions.clone()).collect();
        Workspace { configurations, up_to_motion: self.scenario.robot.up_to_motion }
    }

    fn equations_of_a_row(&self, fit: &Fit) -> usize {
        let of = |row: &usize| self.rows[*row].observation.equations();
        fit.rows.iter().map(of).sum::<usize>() / fit.rows.len().max(1)
    }

    fn falls(&self, fit: &Fit, workspace: &Workspace) -> Option<Falls> {
        let belief = &fit.belief;
        let factor = Cholesky::new(belief.covariance.clone()?)?.l();
        let eigen = (factor.transpose() * self.information(fit) * &factor).symmetric_eigen();
        let moved = workspace.jacobian(&belief.state, &belief.layout) * factor * eigen.eigenvectors;
        let squares: Vec<f64> = moved.column_iter().map(|column| column.norm_squared()).collect();
        let total: f64 = squares.iter().sum();
        // Outliers hardly count in the covariance, so that a row may seem to tell more than everything.
        let shares =
            squares.iter().zip(eigen.eigenvalues.iter()).map(|(square, mu)| (square / total, mu.clamp(0.0, 1.0)));
        (total > 0.0 && total.is_finite()).then(|| Falls(shares.collect()))
    }
}

/// The same in words.
fn said(told: &MoreRows, is_told: bool) -> String {
    let MoreRows { rows, wanted_mm: wanted, model_error_mm: floor, untold_mm: untold, .. } = told;
    let error = told.from_parameters_mm.unwrap_or_default();
    if !is_told {
        return format!(
            "{rows} rows leave no equation to spare by which it could be told how good predictions are, or how many more rows they \
             take: measure more"
        );
    }
    let more = |needed: u64| needed.saturating_sub(*rows as u64);
    match (told.rows_needed, told.rows_needed_if_noise) {
        (Some(needed), _) if more(needed) == 0 => {
            let beside = if *floor > 0.0 {
                format!(", and {floor:.2} mm from what no parameter explains")
            } else {
                String::new()
            };
            format!(
                "{wanted:.2} mm are reached: {error:.2} mm are expected from what is not known of the parameters{beside}"
            )
        }
        (Some(needed), _) => format!(
            "about {} rows more of the same kind, {needed} in all, reach {wanted:.2} mm: {error:.2} mm come from what is not known of \
             the parameters, which falls with the number of rows",
            more(needed)
        ),
        (None, Some(needed)) => {
            let rows = if more(needed) == 0 {
                format!("{wanted:.2} mm are reached, with {error:.2} mm from what is not known of the parameters")
            } else {
                format!("about {} rows more, {needed} in all, reach {wanted:.2} mm", more(needed))
            };
            format!(
                "{floor:.2} mm are left beyond the σ that is stated. If that is noise of the sensor, {rows}; if it is what no parameter \
                 explains (gears, bending, a loose target), no number of rows does. The same posture measured several times would tell"
            )
        }
        (None, None) if untold > wanted => format!(
            "no number of rows like these reaches {wanted:.2} mm: {untold:.2} mm of the {error:.2} mm that are expected are in what none of \
             them tells, as said above; rows that tell it would"
        ),
        (None, None) => format!(
            "no number of rows reaches {wanted:.2} mm: {floor:.2} mm of the error is explained by no parameter (gears, bending, a loose \
             target), and more rows of the same kind do not make it smaller"
        ),
    }
}
