//! Tests of the panel in one program: each would be linked with what draws its pictures.

mod channels;
mod ending;
mod game;
mod history;
mod knobs;
mod names;
mod opening;
mod panel;
mod pictures;
mod robot;
mod stories;
mod support;
mod tour;
