//! The engine for Python: JSON texts in and out. The convenient interface is written in Python, beside this crate.
//!
//! The interpreter's lock is released while anything is computed. A session is behind a lock of its own, so that threads may
//! share it.

mod calibrated;
mod files;
mod refusal;
mod runs;
mod session;
mod waiting;

use pyo3::prelude::*;

#[pymodule]
fn _engine(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<session::Engine>()?;
    module.add_function(wrap_pyfunction!(session::setup_of_file, module)?)?;
    module.add_function(wrap_pyfunction!(session::setup_of_urdf, module)?)?;
    module.add_class::<calibrated::Calibrated>()?;
    module.add_function(wrap_pyfunction!(calibrated::calibrate_table, module)?)?;
    module.add_function(wrap_pyfunction!(calibrated::observability, module)?)?;
    module.add_function(wrap_pyfunction!(runs::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(runs::compare, module)?)
}
