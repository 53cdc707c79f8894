//! Laws of the experiments that shipped scenarios describe.

mod branches;
mod branching;
mod choices;
mod constrained;
mod counting;
mod designs;
mod holders;
mod lenses;
mod noises;
mod observability;
mod reports;
mod runs;
mod stereo;
