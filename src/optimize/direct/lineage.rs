//! Who descended from whom, and through it who lies near whom: what the surrogates of infeasible centres need.

use super::partition::Rectangles;
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
    parents: Vec<usize>,
    last_children: Vec<usize>,
    elder_siblings: Vec<usize>,
    /// Levels at birth, as many per rectangle as there are dimensions.
    birth_levels: Vec<u8>,
    /// The least value of a feasible centre among a rectangle and its descendants.
    least: Vec<f64>,
    /// Whether there is an infeasible centre among a rectangle and its descendants.
    obscured: Vec<bool>,
}

impl Lineage {
    /// Whether any centre is infeasible.
    pub fn any_infeasible(&self) -> bool {
        self.obscured.first().is_some_and(|&obscured| obscured)
    }

    /// Adds the next rectangle in line, in the shape it has now. The root is its own parent.
    pub fn add(&mut self, parent: usize, rectangles: &Rectangles) {
        let child = self.parents.len();
        self.parents.push(parent);
        self.last_children.push(0);
        self.elder_siblings.push(if child == 0 {
            0
        } else {
            std::mem::replace(&mut self.last_children[parent], child)
        });
        self.birth_levels.extend_from_slice(rectangles.levels(child));
        self.least.push(f64::INFINITY);
        self.obscured.push(false);
        let value = rectangles.values[child];
        let mut node = child;
        loop {
            // What is no news to a node is none to its ancestors.
            let news = match value {
                Some(value) => value < self.least[node],
                None => !self.obscured[node],
            };
            if !news {
                break;
            }
            match value {
                Some(value) => self.least[node] = value,
                None => self.obscured[node] = true,
            }
            node = self.parents[node];
        }
    }

    /// The least value at a feasible centre inside the doubled rectangle around an infeasible centre, or infinity.
    pub fn least_near(&self, infeasible: usize, rectangles: &Rectangles) -> f64 {
        let mut least = f64::INFINITY;
        self.descend(|node| {
            if self.least[node] >= least {
                return false;
            }
            let reach = |side| 2 * half_side_ticks(rectangles.levels(infeasible)[side]);
            if let Some(value) = rectangles.values[node]
                && within(rectangles, node, infeasible, reach)
            {
                least = least.min(value);
            }
            let birth = self.birth_levels(node, rectangles);
            within(rectangles, node, infeasible, |side| reach(side) + half_side_ticks(birth[side]))
        });
        least
    }

    /// Visits the infeasible rectangles that hold a point in their doubled rectangle.
    pub fn infeasible_near(&self, point: usize, rectangles: &Rectangles, mut visit: impl FnMut(usize)) {
        self.descend(|node| {
            if !self.obscured[node] {
                return false;
            }
            let reach = |levels: &[u8], side: usize| 2 * half_side_ticks(levels[side]);
            if rectangles.values[node].is_none()
                && within(rectangles, node, point, |side| reach(rectangles.levels(node), side))
            {
                visit(node);
            }
            // A descendant sticks out of its ancestor by half its own side when doubled, hence by no more than half
            // the ancestor's.
            within(rectangles, node, point, |side| reach(self.birth_levels(node, rectangles), side))
        });
    }

    fn birth_levels(&self, node: usize, rectangles: &Rectangles) -> &[u8] {
        &self.birth_levels[node * rectangles.dimension..][..rectangles.dimension]
    }

    /// Walks the tree from the root, into the children of those nodes for which `enter` says so.
    fn descend(&self, mut enter: impl FnMut(usize) -> bool) {
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            if !enter(node) {
                continue;
            }
            let mut child = self.last_children[node];
            while child != 0 {
                open.push(child);
                child = self.elder_siblings[child];
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
