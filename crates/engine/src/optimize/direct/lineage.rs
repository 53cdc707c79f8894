//! Who descended from whom, and through it who lies near whom: what the surrogates of infeasible centres need.

use super::partition::{Record, Rectangles};
use super::ternary::{half_side_ticks, ticks};

/// The relative amount by which a surrogate exceeds the feasible value it is borrowed from.
const SURCHARGE: f64 = 1e-6;

/// The surrogate of an infeasible centre whose best feasible neighbour has this value: infinite if that is.
pub fn surrogate(value: f64) -> f64 {
    value + SURCHARGE * value.abs()
}

/// The tree of divisions. The node of a rectangle stands for the space it had at birth, in which all its
/// descendants lie; that is what makes the tree a spatial index.
///
/// Rectangle 0 is the root and nobody's child, so a 0 ends every list of children.
#[derive(Debug, Clone, Default)]
pub struct Lineage {
    /// None as long as all centres are feasible, when nobody asks.
    nodes: Vec<Node>,
}

/// A rectangle in the tree; 0, the root, where there is no child or sibling.
#[derive(Debug, Clone)]
struct Node {
    last_child: usize,
    elder_sibling: usize,
    /// The least value of a feasible centre among a rectangle and its descendants.
    least: f64,
    /// Whether there is an infeasible centre among a rectangle and its descendants.
    obscured: bool,
}

impl Lineage {
    /// Whether any centre is infeasible.
    pub fn any_infeasible(&self) -> bool {
        self.nodes.first().is_some_and(|root| root.obscured)
    }

    /// Puts all rectangles into the tree that are not there yet, once there is an infeasible centre among them.
    pub fn grow(&mut self, records: &[Record]) {
        (self.nodes.len()..records.len()).for_each(|node| self.plant(node, records));
    }

    /// Puts the next rectangle into the tree.
    fn plant(&mut self, child: usize, records: &[Record]) {
        let (value, parent) = (records[child].value(), records[child].parent);
        let elder_sibling =
            self.nodes.get_mut(parent).map_or(0, |parent| std::mem::replace(&mut parent.last_child, child));
        self.nodes.push(Node { elder_sibling, last_child: 0, least: f64::INFINITY, obscured: false });
        let mut node = child;
        loop {
            // What is no news to a node is none to its ancestors.
            let known = &mut self.nodes[node];
            let news = match value {
                Some(value) => value < known.least,
                None => !known.obscured,
            };
            if !news {
                break;
            }
            match value {
                Some(value) => known.least = value,
                None => known.obscured = true,
            }
            node = records[node].parent;
        }
    }

    /// The least value at a feasible centre inside the doubled rectangle around an infeasible centre, or infinity.
    pub fn least_near(&self, infeasible: usize, rectangles: &Rectangles) -> f64 {
        let mut least = f64::INFINITY;
        self.descend(|node| {
            if self.nodes[node].least >= least {
                return false;
            }
            let reach = |side| 2 * half_side_ticks(rectangles.levels(infeasible)[side]);
            if let Some(value) = rectangles.records[node].value()
                && within(rectangles, node, infeasible, reach)
            {
                least = least.min(value);
            }
            let birth = rectangles.birth_levels(node);
            within(rectangles, node, infeasible, |side| reach(side) + half_side_ticks(birth[side]))
        });
        least
    }

    /// Visits the infeasible rectangles that hold a point in their doubled rectangle.
    pub fn infeasible_near(&self, point: usize, rectangles: &Rectangles, mut visit: impl FnMut(usize)) {
        self.descend(|node| {
            if !self.nodes[node].obscured {
                return false;
            }
            let reach = |levels: &[u8], side: usize| 2 * half_side_ticks(levels[side]);
            if rectangles.records[node].value().is_none()
                && within(rectangles, node, point, |side| reach(rectangles.levels(node), side))
            {
                visit(node);
            }
            // A descendant sticks out of its ancestor by half its own side when doubled, hence by no more than half
            // the ancestor's.
            within(rectangles, node, point, |side| reach(rectangles.birth_levels(node), side))
        });
    }

    /// Walks the tree from the root, into the children of those nodes for which `enter` says so.
    fn descend(&self, mut enter: impl FnMut(usize) -> bool) {
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            if !enter(node) {
                continue;
            }
            let mut child = self.nodes[node].last_child;
            while child != 0 {
                open.push(child);
                child = self.nodes[child].elder_sibling;
            }
        }
    }
}

/// Whether two centres are no further apart than `reach` along every side. Exact, since centres often lie right on
/// the border.
fn within(rectangles: &Rectangles, a: usize, b: usize, reach: impl Fn(usize) -> i64) -> bool {
    let pairs = rectangles.centre(a).iter().zip(rectangles.centre(b));
    pairs.enumerate().all(|(side, (&a, &b))| (ticks(a) - ticks(b)).abs() <= reach(side))
}
