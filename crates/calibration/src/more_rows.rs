//! The error to expect after more rows.
//!
//! With P = L Lᵀ the covariance that rows and prior leave, I the information of the rows alone and J the Jacobian of the hand where it is
//! asked about, k times as many rows of the same kind leave
//!
//! ```text
//! (P⁻¹ + (k − 1) I)⁻¹ = L V diag(1 / (1 + (k − 1) μ)) Vᵀ Lᵀ,    Lᵀ I L = V diag(μ) Vᵀ
//! e²(k) = Σᵢ ‖J L vᵢ‖² / (1 + (k − 1) μᵢ)
//! ```
//!
//! so that the part that no row determines (μ = 0) never falls, whatever their number. The model error is added to that: residuals beyond
//! the σ that the sensor's maker promises, which may also be noise unless repeated postures show which; and the excess of held-out errors
//! over all that is expected.
//!
//! Rows know their own postures better than others. Where predictions are asked for at those postures, each is judged without the rows
//! that were measured there, with H whitened and A = H P Hᵀ:
//!
//! ```text
//! J P₋ᵣ Jᵀ = J P Jᵀ + C (I − A)⁻¹ Cᵀ,    C = J P Hᵀ
//! e²(k) (1 + own / k)
//! ```
//!
//! A target that meets itself in sockets is asked about at other places than those learned from. An error that is equal in all rows of
//! one place shows in no residual there, so residuals below the stated σ do not show that errors elsewhere are below σ. Rows then count
//! with the stated σ, as k = s² < 1 times as many, where s is the scale that was found.

use nalgebra::{Cholesky, DMatrix};

use super::{Case, Figures, Fit, MoreRows, Noise};
use body_schema_engine::{elementary::hypot, estimation::NoiseFit, model::Workspace};

/// The greatest multiple of the number of rows that is considered: more cannot be measured.
const MOST: f64 = 1e3;
/// The deviations attributed to chance before held-out rows count as worse than expected.
const CHANCE: f64 = 2.0;

/// The fall of the expected error with the number of rows.
struct Falls {
    /// For each direction its present share of the square, where rows may know their own postures, and μ.
    shares: Vec<(f64, f64)>,
    /// The excess of the square at present where rows do not know their own postures.
    own: f64,
}

impl Falls {
    /// e²(k) / e²(1).
    fn at(&self, k: f64) -> f64 {
        self.with_own(k) * (1.0 + self.own / k) / (1.0 + self.own)
    }

    fn with_own(&self, k: f64) -> f64 {
        self.shares.iter().map(|(share, mu)| share / (1.0 + (k - 1.0) * mu)).sum()
    }

    /// The error at k and its fall from there, rebased so that k counts as 1; `error` is the present error.
    fn from(self, k: f64, error: f64) -> (f64, Self) {
        let (square, whole) = (self.with_own(k), self.at(k));
        let of = |(share, mu): (f64, f64)| {
            let grown = 1.0 + (k - 1.0) * mu;
            (share / grown / square, k * mu / grown)
        };
        let shares = self.shares.into_iter().map(of).collect();
        (error * whole.sqrt(), Self { shares, own: self.own / k })
    }
}

impl Case<'_> {
    /// The error after more rows where the robot is `asked` about, from what is expected and from held-out rows, each of which was
    /// predicted by `share` of the rows; `repeats_m` is the noise of repeated postures, per coordinate.
    pub(super) fn more_rows(
        &self,
        fit: &Fit,
        asked: &Workspace,
        held_out: Option<(&Figures, f64)>,
        (noise, repeats_m): (&[Noise], Option<f64>),
    ) -> MoreRows {
        let mm = |metres: f64| metres * 1e3;
        let (wanted, rows) = (mm(self.scenario.settled_below_m), fit.rows.len());
        let falls = self.falls(fit, asked).map(|(error, falls)| falls.from(self.counted(fit, asked), mm(error)));
        let to_spare: f64 = fit.noise.iter().map(|noise| noise.equations - noise.absorbed).sum();
        let mut told = MoreRows {
            rows,
            expected_mm: None,
            from_parameters_mm: falls.as_ref().map(|(error, _)| *error),
            model_error_mm: mm(fit.belief.model_error_m),
            untold_mm: 0.0,
            held_out_mm: None,
            wanted_mm: wanted,
            rows_needed: None,
            rows_needed_if_noise: None,
            said: "nothing is predicted without rows".to_owned(),
        };
        let Some((error, falls)) = falls else { return told };
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
            told.model_error_mm = hypot(told.model_error_mm, beyond.sqrt());
        }
        let floor = told.model_error_mm;
        told.expected_mm = Some(hypot(error, floor));
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
        if is_told && self.scenario.robot.up_to_motion && !self.meets_itself() {
            told.said.push_str("; all of it up to one motion of everything, which nothing that was measured tells");
        }
        told
    }

    /// The number of rows that one row counts for where other places are asked about.
    fn counted(&self, fit: &Fit, asked: &Workspace) -> f64 {
        let learned = |place: &usize| *place < fit.state().sockets.len();
        if asked.places.iter().all(learned) {
            return 1.0;
        }
        let sum = |of: &dyn Fn(&NoiseFit) -> f64| fit.noise.iter().map(of).sum::<f64>();
        let equations = sum(&|noise| noise.equations);
        if equations > 0.0 { (sum(&|noise| noise.equations * noise.scale.powi(2)) / equations).min(1.0) } else { 1.0 }
    }

    fn equations_of_a_row(&self, fit: &Fit) -> usize {
        let of = |row: &usize| self.rows[*row].observation.equations();
        fit.rows.iter().map(of).sum::<usize>() / fit.rows.len().max(1)
    }

    /// p, root mean square, metres, and its fall.
    fn falls(&self, fit: &Fit, workspace: &Workspace) -> Option<(f64, Falls)> {
        let belief = &fit.belief;
        let factor = Cholesky::new(belief.covariance.clone()?)?.l();
        let eigen = (factor.transpose() * self.information(fit) * &factor).symmetric_eigen();
        let moved = workspace.jacobian(&belief.state, &belief.layout) * factor * eigen.eigenvectors;
        let squares: Vec<f64> = moved.column_iter().map(|column| column.norm_squared()).collect();
        let total: f64 = squares.iter().sum();
        // Outliers hardly count in the covariance, so that a row may seem to tell more than everything.
        let shares =
            squares.iter().zip(eigen.eigenvalues.iter()).map(|(square, mu)| (square / total, mu.clamp(0.0, 1.0)));
        let own = self.own(fit, workspace).map_or(0.0, |own| own / total);
        let error = (total * (1.0 + own) / workspace.configurations.len() as f64).sqrt();
        (total > 0.0 && total.is_finite()).then(|| (error, Falls { shares: shares.collect(), own }))
    }

    /// The excess of the sum of squares where no row knows its own posture.
    fn own(&self, fit: &Fit, workspace: &Workspace) -> Option<f64> {
        let belief = &fit.belief;
        let covariance = belief.covariance.as_ref()?;
        let jacobian = workspace.jacobian(&belief.state, &belief.layout);
        let mut sum = 0.0;
        for (index, asked) in workspace.configurations.iter().enumerate() {
            let own = fit.rows.iter().filter(|row| self.rows[**row].positions == *asked);
            let own: Vec<DMatrix<f64>> = own.map(|row| self.whitened(fit, *row)).collect();
            let columns: Vec<_> = own.iter().flat_map(|rows| rows.column_iter()).collect();
            if columns.is_empty() {
                continue;
            }
            let rows = DMatrix::from_columns(&columns);
            let known = covariance * &rows;
            let left = DMatrix::identity(rows.ncols(), rows.ncols()) - rows.tr_mul(&known);
            // Outliers hardly count in the covariance, so that a row may seem to tell more than everything.
            let Some(left) = Cholesky::new(left) else { continue };
            let moved = jacobian.rows(3 * index, 3) * known;
            sum += moved.dot(&left.solve(&moved.transpose()).transpose());
        }
        Some(sum)
    }
}

/// A sentence on these figures.
fn said(told: &MoreRows, is_told: bool) -> String {
    let MoreRows { rows, wanted_mm: wanted, model_error_mm: floor, untold_mm: untold, .. } = told;
    let (error, expected) = (told.from_parameters_mm.unwrap_or_default(), told.expected_mm.unwrap_or_default());
    if !is_told {
        return format!(
            "{rows} rows leave no equation to spare by which it could be told how good predictions are, or how many more rows they \
             take: measure more"
        );
    }
    let more = |needed: u64| needed.saturating_sub(*rows as u64);
    let beside =
        if *floor > 0.0 { format!(", and {floor:.2} mm from what no parameter explains") } else { String::new() };
    let sum =
        format!("{expected:.2} mm are expected, {error:.2} mm of it from what is not known of the parameters{beside}");
    match (told.rows_needed, told.rows_needed_if_noise) {
        (Some(needed), _) if more(needed) == 0 => format!("{wanted:.2} mm are reached: {sum}"),
        (Some(needed), _) => format!(
            "about {} rows more of the same kind, {needed} in all, reach {wanted:.2} mm: {sum}; what is not known falls with the number \
             of rows",
            more(needed)
        ),
        (None, Some(needed)) => {
            let rows = if more(needed) == 0 {
                format!("{wanted:.2} mm are reached")
            } else {
                format!("about {} rows more, {needed} in all, reach {wanted:.2} mm", more(needed))
            };
            format!(
                "{sum}. If the latter is noise of the sensor, {rows}; if it is what no parameter explains (gears, bending, a loose \
                 target), no number of rows does. The same posture measured several times would tell"
            )
        }
        (None, None) if untold > wanted => format!(
            "no number of rows like these reaches {wanted:.2} mm: {sum}; {untold:.2} mm are in what none of them tells, as said above; rows \
             that tell it would"
        ),
        (None, None) => format!(
            "no number of rows reaches {wanted:.2} mm: {sum} (gears, bending, a loose target), and more rows of the same kind do not make \
             that smaller"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However it goes on, the sentence says the same error as the JSON, with what it is made of.
    #[test]
    fn the_sentence_says_the_figures_of_the_report() {
        for (rows_needed, rows_needed_if_noise, untold_mm) in
            [(Some(10), None, 0.0), (Some(90), None, 0.0), (None, Some(10), 0.0), (None, None, 3.0), (None, None, 0.0)]
        {
            let told = MoreRows {
                rows: 20,
                expected_mm: Some(0.325),
                from_parameters_mm: Some(0.15),
                model_error_mm: 0.288,
                untold_mm,
                held_out_mm: None,
                wanted_mm: 1.0,
                rows_needed,
                rows_needed_if_noise,
                said: String::new(),
            };
            let said = said(&told, true);
            let sum = "0.33 mm are expected, 0.15 mm of it from what is not known of the parameters, and 0.29 mm from what no parameter";
            assert!(said.contains(&sum.replace("0.33", &format!("{:.2}", 0.325))), "{said}");
        }
    }

    /// Rows that count as half of them are worth half as many, and twice as many are then as good as all.
    #[test]
    fn rows_that_count_less_are_as_so_many_fewer() {
        let falls = || Falls { shares: vec![(0.5, 1.0), (0.3, 0.4), (0.2, 0.0)], own: 0.3 };
        let (error, fewer) = falls().from(0.5, 3.0);
        assert!((error - 3.0 * falls().at(0.5).sqrt()).abs() < 1e-12);
        for k in [0.3, 1.0, 2.0, 7.0] {
            let same = 9.0 * falls().at(0.5 * k);
            assert!((error * error * fewer.at(k) - same).abs() < 1e-12);
        }
    }
}
