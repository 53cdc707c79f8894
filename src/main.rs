//! Learn a robot's kinematic body schema from a few well-chosen movements.
fn main() {}
