//! Charts of states: tangent coordinates around one of them, and how they change with it.

use nalgebra::{DMatrix, DVector};

use super::{Layout, State};

/// The step of differences by which a state is changed, rad or m: what is changed is smooth.
const STEP: f64 = 1e-5;

impl State {
    /// The state at tangent coordinates δ (see [`Layout`]) in the chart at `self`; what is not learned stays.
    pub fn retract(&self, layout: &Layout, delta: &DVector<f64>) -> Self {
        let mut state = self.clone();
        for (block, range) in layout.blocks() {
            let moved = block.of(self).retract(&delta.rows(range.start, range.len()));
            block.put(&mut state, moved);
        }
        state
    }

    /// The tangent coordinates of `other` in the chart at `self`, the inverse of [`retract`](Self::retract); `None`
    /// where a block of `other` lies outside the chart (directions of lines 90 deg or more apart).
    pub fn local(&self, layout: &Layout, other: &Self) -> Option<DVector<f64>> {
        let mut delta = DVector::zeros(layout.dimension());
        for (block, range) in layout.blocks() {
            delta.rows_mut(range.start, range.len()).copy_from(&block.of(self).local(&block.of(other))?);
        }
        Some(delta)
    }

    /// How coordinates at `self` change (m × k) with `k` numbers by which `changed` changes the state, one at a time: central
    /// differences. `None` outside the chart.
    pub(crate) fn slopes_along(
        &self,
        layout: &Layout,
        k: usize,
        changed: impl Fn(usize, f64) -> Self,
    ) -> Option<DMatrix<f64>> {
        let mut slopes = DMatrix::zeros(layout.dimension(), k);
        for (index, mut column) in slopes.column_iter_mut().enumerate() {
            let to = |step: f64| self.local(layout, &changed(index, step));
            column.copy_from(&((to(STEP)? - to(-STEP)?) / (2.0 * STEP)));
        }
        Some(slopes)
    }

    /// The derivative J (m × m, block diagonal) of the change of chart from `self` to `self.retract(δ)`, at δ.
    pub fn transport(&self, layout: &Layout, delta: &DVector<f64>) -> DMatrix<f64> {
        let mut transport = DMatrix::zeros(layout.dimension(), layout.dimension());
        for (block, range) in layout.blocks() {
            let (start, length) = (range.start, range.len());
            let of_block = block.of(self).transport(&delta.rows(start, length));
            transport.view_mut((start, start), (length, length)).copy_from(&of_block);
        }
        transport
    }

    /// The derivative (m × m, block diagonal) of the change of chart from `self` to `there`, by the coordinates at `there`:
    /// of `self.local(there.retract(ε))` at ε = 0, whatever pivots the axes of `there` are written with. `None` outside the
    /// chart.
    pub fn change_of_chart(&self, layout: &Layout, there: &Self) -> Option<DMatrix<f64>> {
        let mut change = DMatrix::zeros(layout.dimension(), layout.dimension());
        for (block, range) in layout.blocks() {
            let of_block = block.of(self).change_of_chart(&block.of(there))?;
            change.view_mut((range.start, range.start), (range.len(), range.len())).copy_from(&of_block);
        }
        Some(change)
    }
}
