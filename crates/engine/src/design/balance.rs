//! The best shares of given movements.
//!
//! With the rows Hᵢ of movement i and the shares p, f(p) = tr(W M⁻¹) has
//!
//! ```text
//! ∂f/∂pᵢ = −φᵢ = −N tr(Hᵢ M⁻¹ W M⁻¹ Hᵢᵀ)
//! ∂²f/∂pᵢ∂pⱼ = 2 N² tr(Hᵢ M⁻¹ W M⁻¹ Hⱼᵀ · Hⱼ M⁻¹ Hᵢᵀ)
//! ```
//!
//! and is convex. It is minimised over the simplex by Newton's method: each step minimises the quadratic model over the
//! simplex, damped (Levenberg 1944) where poses teach nearly the same. Where shares are balanced, no φᵢ exceeds Σ pⱼ φⱼ, and
//! those that have a share are equal to it.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Problem;

/// A design: movements with their shares.
pub(super) struct Shares<'a> {
    problem: &'a Problem,
    /// N.
    movements: f64,
    /// Hᵀ of all, whitened (m × dK).
    rows: DMatrix<f64>,
    shares: DVector<f64>,
}

/// The value of a design's shares.
pub struct Standing {
    /// tr(W M⁻¹).
    pub trace: f64,
    /// S = N M⁻¹ W M⁻¹.
    pub sensitivity: DMatrix<f64>,
    /// Σ pᵢ φᵢ.
    pub mean: f64,
    inverse: DMatrix<f64>,
    /// φᵢ.
    values: DVector<f64>,
}

impl Standing {
    /// max φᵢ.
    fn greatest(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }
}

/// The share of a promised first-order decrease that a step must keep; Newton's step keeps half of it.
const KEPT: f64 = 0.1;
/// The least damping on the diagonal, as a fraction of its mean: poses that teach the same leave the Hessian singular.
const DAMPING: f64 = 1e-10;
/// Solutions within a step, and how many of them in a row may leave as many shares on the wrong side.
const PIVOTS: usize = 40;
const PATIENCE: usize = 3;
const STEPS: usize = 60;
/// The share below which a pose leaves the design.
const NEGLIGIBLE: f64 = 1e-5;

impl<'a> Shares<'a> {
    /// The shares of the given poses.
    pub fn new(problem: &'a Problem, movements: f64, poses: &[Vec<f64>], shares: Vec<f64>) -> Self {
        let rows = DMatrix::zeros(problem.layout.dimension(), 0);
        let mut new = Self { problem, movements, rows, shares: DVector::zeros(0) };
        new.join(poses);
        new.shares = DVector::from_vec(shares);
        new
    }

    /// Adds poses, at first without a share.
    pub fn join(&mut self, poses: &[Vec<f64>]) {
        let (d, before) = (self.problem.measurement_model.equations(), self.rows.ncols());
        let rows = std::mem::replace(&mut self.rows, DMatrix::zeros(0, 0));
        self.rows = rows.resize_horizontally(before + d * poses.len(), 0.0);
        for (index, pose) in poses.iter().enumerate() {
            if let Some(rows) = self.problem.seen(pose) {
                self.rows.columns_mut(before + d * index, d).copy_from(&rows);
            }
        }
        let count = self.shares.len();
        self.shares =
            std::mem::replace(&mut self.shares, DVector::zeros(0)).resize_vertically(count + poses.len(), 0.0);
    }

    /// The share of each pose.
    pub fn shares(&self) -> &[f64] {
        self.shares.as_slice()
    }

    /// The value of these shares; `None` if they leave a direction undetermined.
    pub fn standing(&self) -> Option<Standing> {
        self.standing_at(&self.shares)
    }

    fn standing_at(&self, shares: &DVector<f64>) -> Option<Standing> {
        let d = self.problem.measurement_model.equations().max(1);
        let weights = &self.problem.weights;
        let mut scaled = self.rows.clone();
        for (column, mut row) in scaled.column_iter_mut().enumerate() {
            row *= self.movements * shares[column / d];
        }
        let mut m = self.problem.prior.clone();
        m.gemm(1.0, &scaled, &self.rows.transpose(), 1.0);
        let inverse = Cholesky::new(m)?.inverse();
        let sensitivity = &inverse * weights.scale(&inverse) * self.movements;
        let products = &sensitivity * &self.rows;
        let mut values = DVector::zeros(shares.len());
        for (column, (product, row)) in products.column_iter().zip(self.rows.column_iter()).enumerate() {
            values[column / d] += product.dot(&row);
        }
        let mean = values.dot(shares);
        Some(Standing { trace: weights.trace(&inverse), sensitivity, mean, inverse, values })
    }

    /// Balances the shares until no φᵢ exceeds their mean by more than `tolerance` of the trace, and drops poses without a
    /// share. Returns whether each pose is kept, and the value of the shares.
    pub fn balance(&mut self, tolerance: f64) -> Option<(Vec<bool>, Standing)> {
        let mut standing = self.standing()?;
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            if standing.greatest() - standing.mean <= tolerance * standing.trace {
                break;
            }
            let Some(next) = self.step(&standing, &mut damping) else { break };
            standing = next;
        }
        let kept: Vec<bool> = self.shares.iter().map(|share| *share >= NEGLIGIBLE).collect();
        if kept.contains(&false) {
            let d = self.problem.measurement_model.equations();
            let keep: Vec<usize> = (0..kept.len()).filter(|index| kept[*index]).collect();
            self.rows = self.rows.select_columns(&equations(d, &keep));
            self.shares = self.shares.select_rows(&keep);
            self.shares /= self.shares.sum();
            standing = self.standing()?;
        }
        Some((kept, standing))
    }

    /// A step that lowers the trace; `None` if there is none.
    fn step(&mut self, standing: &Standing, damping: &mut f64) -> Option<Standing> {
        let values = &standing.values;
        let open: Vec<usize> =
            (0..values.len()).filter(|index| self.shares[*index] > 0.0 || values[*index] > standing.mean).collect();
        let hessian = self.hessian(standing, &open);
        while *damping <= 1.0 {
            let aim = self.aim(values, (&open, &hessian), *damping);
            if let Some(found) = aim.and_then(|aim| self.go(standing, aim - &self.shares, 0.25)) {
                *damping = (*damping * 0.1).max(DAMPING);
                return Some(found);
            }
            *damping *= 100.0;
        }
        *damping = DAMPING;
        // Towards the one pose that is favoured most, where no model leads.
        let mut favoured = -&self.shares;
        favoured[values.imax()] += 1.0;
        self.go(standing, favoured, 1e-6)
    }

    /// Follows a direction until the trace falls as promised, halving the step down to `shortest` of the way.
    fn go(&mut self, standing: &Standing, direction: DVector<f64>, shortest: f64) -> Option<Standing> {
        let promised = standing.values.dot(&direction);
        let mut length = 1.0;
        while promised > 0.0 && length >= shortest {
            let trial = (&self.shares + &direction * length).map(|share| share.max(0.0));
            let found = self.standing_at(&trial);
            if let Some(found) = found.filter(|found| found.trace <= standing.trace - KEPT * length * promised) {
                self.shares = trial;
                return Some(found);
            }
            length *= 0.5;
        }
        None
    }

    /// The shares that minimise the quadratic model over the simplex, by block pivoting (Júdice and Pires 1994): all shares that
    /// are on the wrong side change sides at once, and where that does not help, one at a time.
    fn aim(
        &self,
        values: &DVector<f64>,
        (open, hessian): (&[usize], &DMatrix<f64>),
        damping: f64,
    ) -> Option<DVector<f64>> {
        let mut hessian = hessian.clone();
        let damping = damping * hessian.trace() / open.len().max(1) as f64;
        (0..open.len()).for_each(|i| hessian[(i, i)] += damping);
        // H q = c − λ where a share is left, H q ≥ c − λ where none is, Σ q = 1.
        let c = values.select_rows(open) + &hessian * self.shares.select_rows(open);
        let mut is_free = vec![true; open.len()];
        let (mut fewest, mut patience) = (usize::MAX, PATIENCE);
        let mut q = DVector::zeros(open.len());
        for _ in 0..PIVOTS {
            let free: Vec<usize> = (0..open.len()).filter(|index| is_free[*index]).collect();
            let factor = Cholesky::new(hessian.select_columns(&free).select_rows(&free))?;
            let u = factor.solve(&c.select_rows(&free));
            let v = factor.solve(&DVector::from_element(free.len(), 1.0));
            let multiplier = (u.sum() - 1.0) / v.sum();
            q.fill(0.0);
            free.iter().zip(u.iter().zip(v.iter())).for_each(|(place, (u, v))| q[*place] = u - v * multiplier);
            let missing = &c - &hessian * &q;
            let is_wrong = |index: &usize| match is_free[*index] {
                true => q[*index] < 0.0,
                false => missing[*index] - multiplier > 1e-9 * multiplier.abs(),
            };
            let wrong: Vec<usize> = (0..open.len()).filter(is_wrong).collect();
            let Some(last) = wrong.last() else { break };
            patience = if wrong.len() < fewest { PATIENCE } else { patience.saturating_sub(1) };
            fewest = fewest.min(wrong.len());
            let changing = if patience > 0 { &wrong[..] } else { std::slice::from_ref(last) };
            changing.iter().for_each(|index| is_free[*index] ^= true);
        }
        q.apply(|share| *share = share.max(0.0));
        let total = q.sum();
        let mut aim = DVector::zeros(values.len());
        open.iter().zip(q.iter()).for_each(|(place, share)| aim[*place] = share / total);
        (total.is_finite() && total > 0.0).then_some(aim)
    }

    /// ∂²f of these shares.
    fn hessian(&self, standing: &Standing, open: &[usize]) -> DMatrix<f64> {
        let d = self.problem.measurement_model.equations();
        let rows = self.rows.select_columns(&equations(d, open));
        let transposed = rows.transpose();
        let spread = &transposed * (&standing.inverse * &rows);
        let weighed = &transposed * (&standing.sensitivity * &rows);
        let block = |i: usize, j: usize| -> f64 {
            (d * j..d * (j + 1))
                .map(|column| {
                    (d * i..d * (i + 1)).map(|row| spread[(row, column)] * weighed[(row, column)]).sum::<f64>()
                })
                .sum()
        };
        let mut hessian = DMatrix::zeros(open.len(), open.len());
        for j in 0..open.len() {
            for i in 0..=j {
                hessian[(i, j)] = 2.0 * self.movements * block(i, j);
                hessian[(j, i)] = hessian[(i, j)];
            }
        }
        hessian
    }
}

/// The columns of these movements, d each.
fn equations(d: usize, movements: &[usize]) -> Vec<usize> {
    movements.iter().flat_map(|index| d * index..d * (index + 1)).collect()
}
