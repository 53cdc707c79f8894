//! Movements of which each is seen through the channels that read there: that a target is held is read of its own socket alone.

use super::{Movement, SelectionError};
use crate::estimation::Belief;

/// The criterion of postures in one socket, all at once.
pub(super) type Values<'a> = Box<dyn Fn(&[Vec<f64>]) -> Vec<f64> + 'a>;

/// A belief as it is in a socket, or in none.
pub(super) type Held = (Option<usize>, Belief);

/// The belief as it is in each of these.
pub(super) fn held(belief: &Belief, sockets: impl Iterator<Item = Option<usize>>) -> Vec<Held> {
    sockets.map(|socket| (socket, belief.held_in(socket).into_owned())).collect()
}

/// The belief as it is in each socket of listed movements.
pub(super) fn held_by(belief: &Belief, movements: &[Movement]) -> Vec<Held> {
    let mut sockets: Vec<Option<usize>> = movements.iter().map(|movement| movement.socket).collect();
    sockets.sort_unstable();
    sockets.dedup();
    held(belief, sockets.into_iter())
}

/// The values of movements by what `values` makes of the belief in the socket of each; infinite in a socket that is not there.
pub(super) fn evaluate<'b>(
    held: &'b [Held],
    movements: &[Movement],
    values: impl Fn(&'b Belief) -> Result<Values<'b>, SelectionError>,
) -> Result<Vec<f64>, SelectionError> {
    let mut all = vec![f64::INFINITY; movements.len()];
    for (socket, held) in held {
        let places: Vec<usize> = (0..movements.len()).filter(|k| movements[*k].socket == *socket).collect();
        if places.is_empty() {
            continue;
        }
        let postures: Vec<Vec<f64>> = places.iter().map(|k| movements[*k].configuration.clone()).collect();
        places.into_iter().zip(values(held)?(&postures)).for_each(|(place, value)| all[place] = value);
    }
    Ok(all)
}
