//! Elementary functions with the same bits on every machine.
//!
//! Those of the standard library are the platform's: they differ in the last bit from one C library to another, and between processors
//! with and without fused multiplication. These are those of the crate `libm`, compiled as all of this is. The square root is exact
//! everywhere, and so are products: whole powers (`powi`) are left to the standard library.

pub use libm::{
    acos, asin, atan2, cbrt, cos, exp, expm1 as exp_m1, hypot, log as ln, log1p as ln_1p, pow as powf, sin,
    sincos as sin_cos,
};
