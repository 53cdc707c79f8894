//! Grouping the rows of a table by posture.

use std::collections::HashMap;

/// The difference in every joint, rad or m, below which two postures are one: the repeatability of encoders.
pub const SAME: f64 = 1e-4;
/// The most neighbours of a row that are compared with it. Some are skipped only for a posture with more repeats, and the
/// others link them.
const NEIGHBOURS: usize = 256;

/// The posture of each row, numbered from 0 in the order in which postures first appear: rows whose joints all agree to
/// [`SAME`] are one posture, and so are rows that agree with one such row. Without repeats the posture's number is the row's.
pub fn postures(configurations: &[Vec<f64>]) -> Vec<usize> {
    let joints = configurations.iter().map(Vec::len).max().unwrap_or(0);
    // Rows that agree are near each other along any direction: one that has a share of every joint.
    let shares: Vec<f64> = (1..=joints).map(|joint| 1.0 + (joint as f64 * 0.618_034).fract()).collect();
    let along = |row: &Vec<f64>| row.iter().zip(&shares).map(|(q, share)| q * share).sum::<f64>();
    let along: Vec<f64> = configurations.iter().map(along).collect();
    let window = 1.000_001 * SAME * shares.iter().sum::<f64>();
    let agree = |a: usize, b: usize| {
        let (a, b) = (&configurations[a], &configurations[b]);
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME)
    };
    let mut order: Vec<usize> = (0..configurations.len()).collect();
    order.sort_by(|a, b| along[*a].total_cmp(&along[*b]));
    // Each row leads to an earlier one of its posture, and the first to itself.
    let mut leads: Vec<usize> = (0..configurations.len()).collect();
    for (at, &row) in order.iter().enumerate() {
        let before = order[..at].iter().rev().take(NEIGHBOURS);
        for &other in before.take_while(|other| along[row] - along[**other] <= window) {
            let (a, b) = (first(&mut leads, row), first(&mut leads, other));
            if a != b && agree(row, other) {
                leads[a.max(b)] = a.min(b);
            }
        }
    }
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    (0..leads.len())
        .map(|row| {
            let next = numbers.len();
            *numbers.entry(first(&mut leads, row)).or_insert(next)
        })
        .collect()
}

/// The row that a row's leads end at.
fn first(leads: &mut [usize], mut row: usize) -> usize {
    while leads[row] != row {
        leads[row] = leads[leads[row]];
        row = leads[row];
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_agree_are_one_posture_wherever_they_stand() {
        // About the edge of any grid, in another order, and by way of a third.
        let rows = [[0.5, 0.49996e-4], [0.7, 0.0], [0.500_05, 1.0e-4], [0.500_13, 1.0e-4], [0.7, 2e-4], [0.7, 0.0]];
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
        assert_eq!(postures(&rows), [0, 1, 0, 0, 2, 1]);
        assert_eq!(postures(&[]), [0; 0]);
    }

    #[test]
    fn distinct_rows_are_numbered_as_they_stand() {
        let rows: Vec<Vec<f64>> =
            (0..500).map(|row| (0..6).map(|joint| ((row * 7 + 3 * joint) as f64 * 0.61).sin()).collect()).collect();
        assert_eq!(postures(&rows), (0..500).collect::<Vec<_>>());
        // However long one is repeated.
        let still: Vec<Vec<f64>> = (0..3000).map(|row| vec![1.0 + 1e-5 * f64::from(row % 7), 2.0]).collect();
        assert_eq!(postures(&still), [0; 3000]);
    }
}
