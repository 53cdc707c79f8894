//! Chains that begin around one posture: where columns moved together.
//!
//! A hand that keeps looking at a board turns little while its joints turn far: no column explains anything until all are there. Near
//! one posture, though, all directions are told at once, whatever the order.

use nalgebra::{Cholesky, DMatrix, Matrix3, Rotation3, UnitVector3, Vector3};

use crate::turns::{Turned, Turns, rotation};

/// Around how many postures chains begin.
const CENTRES: usize = 24;
/// How many of the nearest rows they begin with, per column.
const NEAREST: [f64; 3] = [2.0, 3.0, 1.3];
/// Chains that miss by less than this on the mean, rad², need no rival.
const EXPLAINED: f64 = 0.02;
/// Columns with shorter regression vectors turn nothing, or are put in later.
const LEAST: f64 = 0.35;
/// By how much a column must lessen the cost to be put in later.
const PLAINLY: f64 = 0.9;

/// Chains that begin around one posture and grow outwards. Near it, log(R Rₘᵀ) = Σ wᵢ Δθᵢ to first order whatever the order of the joints, so that
/// all directions come out of one regression over the nearest rows, even where columns moved together so that the body kept its
/// rotation. The order then fits those rows, and more and more rows are taken in.
pub(crate) fn outwards(rows: &[Turned], still: &Turns, columns: &[usize]) -> Vec<Turns> {
    let spread: Vec<f64> = columns
        .iter()
        .map(|column| {
            (rows.iter().map(|row| row.positions[*column].powi(2)).sum::<f64>() / rows.len() as f64).sqrt().max(1e-9)
        })
        .collect();
    let gap = |one: &Turned, other: &Turned| -> f64 {
        let pairs = columns.iter().zip(&spread);
        pairs.map(|(column, spread)| ((one.positions[*column] - other.positions[*column]) / spread).powi(2)).sum()
    };
    let nearest = |centre: &Turned| -> Vec<Turned> {
        let mut near = rows.to_vec();
        near.sort_by(|one, other| gap(centre, one).total_cmp(&gap(centre, other)));
        near
    };
    let mut found: Vec<Turns> = Vec::new();
    for widths in NEAREST {
        let least = ((widths * columns.len() as f64) as usize + 6).min(rows.len());
        // The postures that have the most others near them.
        let mut centres: Vec<(f64, Vec<Turned>)> = rows
            .iter()
            .map(|row| {
                let near = nearest(row);
                (gap(row, &near[least - 1]), near)
            })
            .collect();
        centres.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (_, near) in centres.into_iter().take(CENTRES) {
            found.extend(outward(&near, still, columns, least));
            if found.last().is_some_and(|chain| chain.cost < EXPLAINED * rows.len() as f64) {
                return found;
            }
        }
    }
    found
}

/// One such chain, of rows from the centre outwards.
fn outward(near: &[Turned], still: &Turns, columns: &[usize], least: usize) -> Option<Turns> {
    let centre = near.first()?;
    let first = &near[..least];
    let count = columns.len() + 1;
    let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(count, count), DMatrix::<f64>::zeros(count, 3));
    for row in first {
        let log = Rotation3::from_matrix_unchecked(row.measured * centre.measured.transpose()).scaled_axis();
        let mut terms: Vec<f64> =
            columns.iter().map(|column| row.positions[*column] - centre.positions[*column]).collect();
        terms.push(1.0);
        for one in 0..count {
            (0..3).for_each(|axis| gradient[(one, axis)] += terms[one] * log[axis]);
            (0..count).for_each(|other| hessian[(one, other)] += terms[one] * terms[other]);
        }
    }
    (0..count).for_each(|index| hessian[(index, index)] += 1e-3 * first.len() as f64);
    let answer = Cholesky::new(hessian)?.solve(&gradient);
    // Those with the plainest directions first, each where it fits best.
    let mut directions: Vec<(usize, Vector3<f64>)> = columns
        .iter()
        .enumerate()
        .map(|(index, column)| (*column, Vector3::new(answer[(index, 0)], answer[(index, 1)], answer[(index, 2)])))
        .filter(|(_, vector)| (LEAST..1.0 / LEAST).contains(&vector.norm()))
        .collect();
    directions.sort_by(|one, other| (one.1.norm() - 1.0).abs().total_cmp(&(other.1.norm() - 1.0).abs()));
    // Written at the centre; R₀ there is what was measured.
    let shifted = |rows: &[Turned]| -> Vec<Turned> {
        let shift = |row: &Turned| {
            let positions = row.positions.iter().zip(&centre.positions).map(|(own, centre)| own - centre).collect();
            Turned { positions, measured: row.measured }
        };
        rows.iter().map(shift).collect()
    };
    let all = shifted(near);
    let mut chain = Turns { order: Vec::new(), home: centre.measured, cost: f64::INFINITY };
    for (column, vector) in directions {
        let direction = UnitVector3::try_new(vector, 1e-9)?;
        let put = |at: usize| {
            let mut grown = chain.clone();
            grown.order.insert(at, (column, direction));
            grown.cost = grown.cost_of(&all[..least]);
            grown
        };
        let tried = (0..=chain.order.len()).map(put);
        chain = tried.min_by(|one, other| one.cost.total_cmp(&other.cost))?;
    }
    let mut taken = least;
    loop {
        chain.fit(&all[..taken], 15);
        chain.reorder(&all[..taken]);
        if taken == all.len() {
            break;
        }
        taken = (taken + taken / 3).min(all.len());
    }
    // What the regression lost is put in again, as long as it helps plainly.
    for column in columns {
        if chain.order.iter().all(|(of, _)| of != column) {
            let grown = chain.grown(&all, *column);
            let mut best = grown.into_iter().min_by(|one, other| one.cost.total_cmp(&other.cost))?;
            best.fit(&all, 15);
            if best.cost < PLAINLY * chain.cost {
                chain = best;
                chain.reorder(&all);
            }
        }
    }
    // Back to θ₀: every direction is turned by the joints before it.
    let mut before = Matrix3::<f64>::identity();
    let mut order = Vec::new();
    for (column, direction) in &chain.order {
        order.push((*column, UnitVector3::new_normalize(before * direction.into_inner())));
        before *= rotation(direction, -centre.positions[*column]);
    }
    let mut whole = Turns { order, home: before * chain.home, cost: still.cost };
    whole.cost = whole.cost_of(near);
    Some(whole)
}
