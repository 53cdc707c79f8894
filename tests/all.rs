//! All tests of the program from outside, in one executable: to link it once takes less than to link one for each file.
//!
//! Some of one file: `cargo test --test all http::`; one test: `cargo test --test all http::trust::a_rewritten_session`.

mod arrows;
mod ask_tell;
mod bending;
mod browser;
mod bundle;
mod calibrate;
mod cases;
mod cli;
mod convergence;
mod direct;
mod doubts;
mod export;
mod first_file;
mod head_scenarios;
mod http;
mod limits;
mod measured;
mod mutated;
mod observability;
mod own_robot;
mod paper;
mod readme;
mod recording;
mod same_bits;
mod scenarios;
mod table;
mod tree;
mod urdf;
