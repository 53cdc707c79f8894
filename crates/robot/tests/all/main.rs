//! Descriptions of robots whose joints branch.

mod branches;
mod trees;
