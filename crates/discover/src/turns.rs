//! Which columns turn a body, in which order and about which directions: by measured rotations alone.
//!
//! Without places a chain is R(θ) = e^{w₁θ₁} … e^{wₙθₙ} R₀: two unknowns a joint, whatever slides is out of sight, and of a chain that lacks a
//! joint the best place and direction for it are known in closed form. With A, B the turns before and behind it and D = Aᵀ M Bᵀ,
//!
//! ```text
//! Σ tr((A e^{wα} B)ᵀ M) = c + w·b + wᵀ S w,   c = Σ cos α tr D,   b = Σ sin α vee(D − Dᵀ),   S = Σ (1 − cos α) (D + Dᵀ)/2
//! ```
//!
//! is to be greatest on the unit sphere. Chains grow by it column by column; several are kept (beam search), each column of a chain is taken
//! out and put back where it fits best, and all directions are fitted after every change.

use body_schema_engine::kinematics::chart;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitVector3, Vector2, Vector3};

use crate::damped::Damped;

/// A rotation and the positions by column relative to θ₀, rad.
#[derive(Clone, Debug)]
pub(crate) struct Turned {
    pub(crate) positions: Vec<f64>,
    pub(crate) measured: Matrix3<f64>,
}

/// A chain of turns.
#[derive(Clone, Debug)]
pub struct Turns {
    /// The columns from the ground, with the directions of their axes at θ₀.
    pub order: Vec<(usize, UnitVector3<f64>)>,
    /// R₀.
    pub(crate) home: Matrix3<f64>,
    /// Σ ‖R − M‖²/2 over the rows, rad².
    pub(crate) cost: f64,
}

pub(crate) fn rotation(direction: &UnitVector3<f64>, angle: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(direction, angle).into_inner()
}

impl Turns {
    pub(crate) fn cost_of(&self, rows: &[Turned]) -> f64 {
        let sum: f64 = rows.iter().map(|row| 3.0 - (self.at(row).transpose() * row.measured).trace()).sum();
        sum.max(1e-10 * rows.len() as f64)
    }

    fn at(&self, row: &Turned) -> Matrix3<f64> {
        let turn = self.order.iter().map(|(column, direction)| rotation(direction, row.positions[*column]));
        turn.fold(Matrix3::<f64>::identity(), |all, own| all * own) * self.home
    }

    /// This chain with one column more, at every place; the costs are those before any other direction gives way.
    pub(crate) fn grown(&self, rows: &[Turned], column: usize) -> Vec<Self> {
        let count = self.order.len() + 1;
        let mut forms = vec![(0.0, Vector3::zeros(), Matrix3::zeros()); count];
        for row in rows {
            let turns: Vec<Matrix3<f64>> =
                self.order.iter().map(|(of, direction)| rotation(direction, row.positions[*of])).collect();
            let mut behind = vec![self.home; count];
            for at in (0..count - 1).rev() {
                behind[at] = turns[at] * behind[at + 1];
            }
            let mut before = Matrix3::<f64>::identity();
            let (sin, cos) = body_schema_engine::elementary::sin_cos(row.positions[column]);
            for (at, (constant, linear, square)) in forms.iter_mut().enumerate() {
                let d: Matrix3<f64> = before.transpose() * row.measured * behind[at].transpose();
                *constant += cos * d.trace();
                let vee = Vector3::new(d.m32 - d.m23, d.m13 - d.m31, d.m21 - d.m12);
                *linear += vee * sin;
                *square += (d + d.transpose()) * (0.5 * (1.0 - cos));
                if at + 1 < count {
                    before *= turns[at];
                }
            }
        }
        let put = |(at, (constant, linear, square)): (usize, &(f64, Vector3<f64>, Matrix3<f64>))| {
            let (direction, value) = greatest(linear, square);
            let mut grown = self.clone();
            grown.order.insert(at, (column, direction));
            grown.cost = (3.0 * rows.len() as f64 - constant - value).max(1e-10 * rows.len() as f64);
            grown
        };
        forms.iter().enumerate().map(put).collect()
    }

    /// Takes every column out and puts it back where it fits best, as long as that helps.
    pub(crate) fn reorder(&mut self, rows: &[Turned]) {
        for _ in 0..2 {
            let before = self.cost;
            for at in 0..self.order.len() {
                let mut without = self.clone();
                let (column, _) = without.order.remove(at);
                let mut put = without.grown(rows, column);
                put.sort_by(|one, other| one.cost.total_cmp(&other.cost));
                for mut tried in put.into_iter().take(2) {
                    tried.fit(rows, 4);
                    if tried.cost < self.cost * (1.0 - 1e-6) {
                        *self = tried;
                    }
                }
            }
            if self.cost > before * (1.0 - 1e-3) {
                return;
            }
        }
    }

    /// Takes every pair of columns out and puts both back where they fit best, as long as that helps.
    pub(crate) fn reorder_pairs(&mut self, rows: &[Turned]) {
        let count = self.order.len();
        for (one, other) in (0..count).flat_map(|one| (0..one).map(move |other| (one, other))) {
            let mut without = self.clone();
            let pair = [without.order.remove(one).0, without.order.remove(other).0];
            without.fit(rows, 6);
            for [first, second] in [pair, [pair[1], pair[0]]] {
                let mut grown = without.grown(rows, first);
                grown.sort_by(|one, other| one.cost.total_cmp(&other.cost));
                for mut first in grown.into_iter().take(3) {
                    first.fit(rows, 6);
                    let mut whole = first.grown(rows, second);
                    whole.sort_by(|one, other| one.cost.total_cmp(&other.cost));
                    for mut tried in whole.into_iter().take(2) {
                        tried.fit(rows, 8);
                        if tried.cost < self.cost * (1.0 - 1e-6) {
                            *self = tried;
                        }
                    }
                }
            }
        }
    }

    /// Gauss–Newton with damping over all directions and R₀.
    pub(crate) fn fit(&mut self, rows: &[Turned], iterations: usize) {
        self.cost = self.cost_of(rows);
        let count = 2 * self.order.len() + 3;
        let mut damped = Damped::new(1e-9, 1e6);
        for _ in 0..iterations {
            let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
            let mut spins = vec![Vector3::zeros(); count];
            for row in rows {
                let mut before = Matrix3::<f64>::identity();
                for (index, (column, direction)) in self.order.iter().enumerate() {
                    let own = rotation(direction, row.positions[*column]);
                    let basis = chart::basis(direction);
                    for side in 0..2 {
                        let turn = direction.cross(&basis.column(side));
                        spins[2 * index + side] = before * (turn - own * turn);
                    }
                    before *= own;
                }
                for axis in 0..3 {
                    spins[count - 3 + axis] = before.column(axis).into_owned();
                }
                let found = before * self.home;
                let off =
                    (0..3).map(|axis| row.measured.column(axis).cross(&found.column(axis))).sum::<Vector3<f64>>() * 0.5;
                for one in 0..count {
                    gradient[one] += spins[one].dot(&off);
                    for other in 0..=one {
                        hessian[(one, other)] += spins[one].dot(&spins[other]);
                    }
                }
            }
            hessian.fill_upper_triangle_with_lower_triangle();
            let lowered = damped.step(&hessian, &gradient, |step| {
                let mut tried = self.clone();
                for (index, (_, direction)) in tried.order.iter_mut().enumerate() {
                    *direction =
                        chart::retract_direction(direction, &Vector2::new(step[2 * index], step[2 * index + 1]));
                }
                let turn = Vector3::new(step[count - 3], step[count - 2], step[count - 1]);
                tried.home = Rotation3::from_scaled_axis(turn).into_inner() * self.home;
                tried.cost = tried.cost_of(rows);
                (tried.cost < self.cost).then_some(tried)
            });
            let Some(tried) = lowered else { return };
            let is_done = self.cost - tried.cost < 1e-6 * self.cost;
            *self = tried;
            if is_done {
                return;
            }
        }
    }
}

/// The unit vector at which w·b + wᵀ S w is greatest, and the value. Ascent by w ← (b + 2 (S + μ I) w) normalised never falls where S + μ I
/// has no negative eigenvalue.
fn greatest(linear: &Vector3<f64>, square: &Matrix3<f64>) -> (UnitVector3<f64>, f64) {
    let lifted = (square + Matrix3::identity() * square.norm()) * 2.0;
    let value = |w: &UnitVector3<f64>| w.dot(linear) + w.dot(&(square * w.into_inner()));
    let climb = |start: UnitVector3<f64>| {
        let mut w = start;
        for _ in 0..40 {
            let next = linear + lifted * w.into_inner();
            w = UnitVector3::try_new(next, 1e-12).unwrap_or(w);
        }
        w
    };
    let mut best = (Vector3::z_axis(), f64::NEG_INFINITY);
    for start in directions().into_iter().step_by(3) {
        let w = climb(start);
        let found = value(&w);
        if found > best.1 {
            best = (w, found);
        }
    }
    best
}

/// 26 directions: to the faces, edges and corners of a cube.
pub(crate) fn directions() -> Vec<UnitVector3<f64>> {
    let of = |index: usize| {
        let [x, y, z] = [index % 3, index / 3 % 3, index / 9].map(|digit| digit as f64 - 1.0);
        UnitVector3::try_new(Vector3::new(x, y, z), 0.5)
    };
    (0..27).filter_map(of).collect()
}
