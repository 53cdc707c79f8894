//! What columns say before any robot is thought of: which stand still, which repeat another.

use crate::data::Data;

/// A column repeats another where a line through their values misses by less than this share of its range.
const COPY: f64 = 2e-3;
/// A column stands still where its range is below this, rad or m.
const STILL: f64 = 1e-9;
/// A column without a unit whose range is wider than this is not in radians or metres.
const WIDEST: f64 = 13.0;

/// What a column is, by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// It may drive a joint.
    Candidate,
    /// It has the same value in every row: nothing can be told of it.
    Constant,
    /// It is a line of another column: factor · other + constant.
    Copy {
        /// The column that it repeats.
        of: usize,
        /// Its units per unit of the other.
        factor: f64,
    },
    /// Its numbers are those of no joint: no unit is named, and they span more than two turns.
    Wide,
}

/// What every column is. Of columns that repeat each other the first that may drive a joint stays: one whose title names a unit before one
/// without.
pub fn audit(data: &Data) -> Vec<Kind> {
    let count = data.columns.len();
    let mut kinds = vec![Kind::Candidate; count];
    for (column, kind) in kinds.iter_mut().enumerate() {
        let range = data.range(column).map_or(0.0, |(low, high)| high - low);
        if range < STILL {
            *kind = Kind::Constant;
        } else if data.columns[column].kind.is_none() && range > WIDEST {
            *kind = Kind::Wide;
        }
    }
    let mut order: Vec<usize> = (0..count).filter(|column| kinds[*column] != Kind::Constant).collect();
    order.sort_by_key(|column| (kinds[*column] == Kind::Wide, data.columns[*column].kind.is_none(), *column));
    for (at, column) in order.iter().enumerate() {
        let firsts = order[..at].iter().filter(|other| !matches!(kinds[**other], Kind::Copy { .. }));
        let found = firsts.filter_map(|other| Some((*other, slope(data, *other, *column)?))).next();
        if let Some((of, factor)) = found {
            kinds[*column] = Kind::Copy { of, factor };
        }
    }
    kinds
}

/// The slope of a column over another, if it is a line of it.
fn slope(data: &Data, of: usize, column: usize) -> Option<f64> {
    let rows = data.rows.len();
    if rows < 4 {
        return None;
    }
    let mean = |column: usize| data.rows.iter().map(|row| row.positions[column]).sum::<f64>() / rows as f64;
    let (x, y) = (mean(of), mean(column));
    let (mut xx, mut xy) = (0.0, 0.0);
    for row in &data.rows {
        let by = row.positions[of] - x;
        xx += by * by;
        xy += by * (row.positions[column] - y);
    }
    let slope = xy / xx;
    let (low, high) = data.range(column)?;
    let misses = |row: &crate::data::Row| (row.positions[column] - y - slope * (row.positions[of] - x)).abs();
    let worst = data.rows.iter().map(misses).fold(0.0, f64::max);
    // A column that moved in one row alone is a line of any other that did.
    let moved = |column: usize| {
        let first = data.rows[0].positions[column];
        let step = COPY * data.range(column).map_or(0.0, |(low, high)| high - low);
        data.rows.iter().filter(|row| (row.positions[column] - first).abs() > step).count()
    };
    (worst < COPY * (high - low) && moved(column) > 1 && moved(of) > 1 && slope != 0.0).then_some(slope)
}
