//! Beam search over chains of turns: they grow column by column, and several are kept.

use body_schema_engine::elementary::ln;
use nalgebra::Rotation3;

use crate::{
    data::{Data, Reading, Row},
    outwards::outwards,
    turns::{Turned, Turns},
};

/// Where more chains than this are kept, pairs of columns are also taken out and put back.
const THOROUGH: usize = 20;

/// Chains that explain the rotations of a body's first target, the most plausible first. `columns` are those that may turn; `beam_width` chains
/// are kept at every length.
pub fn search(data: &Data, middle: &[f64], columns: &[usize], beam_width: usize) -> Vec<Turns> {
    let rows: Vec<Turned> = data.rows.iter().filter_map(|row| turned(row, middle)).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    let mut begun = Turns { order: Vec::new(), home: rows[rows.len() / 2].measured, cost: f64::INFINITY };
    begun.fit(&rows, 20);
    let around = if beam_width > THOROUGH { outwards(&rows, &begun, columns) } else { Vec::new() };
    let mut beam = vec![begun];
    let mut found = beam.clone();
    for _ in columns {
        let mut next: Vec<Turns> = Vec::new();
        for chain in &beam {
            let absent = columns.iter().filter(|column| chain.order.iter().all(|(taken, _)| taken != *column));
            let mut grown: Vec<Turns> = absent.flat_map(|column| chain.grown(&rows, *column)).collect();
            grown.sort_by(|one, other| one.cost.total_cmp(&other.cost));
            next.extend(grown.into_iter().take(beam_width));
        }
        keep(&mut next, 3 * beam_width);
        next.iter_mut().for_each(|chain| chain.fit(&rows, 6));
        keep(&mut next, beam_width);
        next.iter_mut().for_each(|chain| chain.reorder(&rows));
        keep(&mut next, beam_width);
        let Some(best) = next.first() else { break };
        let before = beam.first().map_or(f64::INFINITY, |chain| chain.cost);
        let is_better = -ln(best.cost) + ln(before) > 0.0;
        found.extend(next.iter().take(4).cloned());
        if !is_better {
            break;
        }
        beam = next;
    }
    found.extend(around);
    if beam_width > THOROUGH {
        found.sort_by(|one, other| one.cost.total_cmp(&other.cost));
        found.iter_mut().take(5).for_each(|chain| chain.reorder_pairs(&rows));
    }
    found.iter_mut().for_each(|chain| chain.fit(&rows, 30));
    let evidence = |chain: &Turns| {
        let equations = 3.0 * rows.len() as f64;
        let free = 2.0 * chain.order.len() as f64 + 3.0;
        -0.5 * equations * ln(chain.cost) - 0.5 * free * ln(equations)
    };
    found.sort_by(|one, other| evidence(other).total_cmp(&evidence(one)));
    found
}

fn turned(row: &Row, middle: &[f64]) -> Option<Turned> {
    let Some(Some(Reading::Pose(pose))) = row.readings.first() else { return None };
    let positions = row.positions.iter().zip(middle).map(|(position, middle)| position - middle).collect();
    Some(Turned { positions, measured: Rotation3::from(pose.rotation).into_inner() })
}

/// The best of different orders.
fn keep(chains: &mut Vec<Turns>, most: usize) {
    chains.sort_by(|one, other| one.cost.total_cmp(&other.cost));
    let mut seen: Vec<Vec<usize>> = Vec::new();
    chains.retain(|chain| {
        let order: Vec<usize> = chain.order.iter().map(|(column, _)| *column).collect();
        let is_new = !seen.contains(&order);
        if is_new {
            seen.push(order);
        }
        is_new
    });
    chains.truncate(most);
}
