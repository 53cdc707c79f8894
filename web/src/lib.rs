//! The panel of body-schema's page.
//!
//! ```text
//! wire      what the server itself says                  host       what passes between panel and page
//! settings  the visitor's choice                         address    the choice as it stands in the page's address
//! history   the numbers of every step, verdicts          seeds      the runs of other seeds
//! outcome   how each learner of a run ended
//! search    DIRECT's search, ready to be drawn           why        what was asked and answered about it
//! stories   what can be told, as data                    game       the movements that the visitor chooses
//! robot     a robot elsewhere, and what is said to it
//! panel     the state: all of the above                  words      plain words for the terms of the field
//! tour      going through a story, what its cards do     contest    playing the game
//! ending    how a run ended, in a sentence               status     what goes on, in a sentence
//! events    what happens, and what it does to the state  play       making steps and going through them
//! bands     running other seeds                          explain    asking why, and why not
//! opening   what a newcomer sees first                   turned     a scenario with other values than its file's
//! mirror    the state in words                           news       what is read out when it happens
//! keys      the keyboard                                 clicks     the pointer, where frames are slow
//! view/     how all of it looks
//! access    the same for those who do not see it         acts       what they do
//! shell     the WebAssembly that a browser runs (only there)
//! ```
//!
//! Each module uses only those above it. What the engine reports is read in the engine's own types.
//!
//! Nothing but `shell` knows of a browser: the page opens connections, asks the server and moves Rerun's viewer; the
//! panel decides. So tests drive it natively, by the labels that a visitor reads.

pub mod access;
pub mod acts;
mod address;
mod bands;
pub mod clicks;
pub mod colours;
mod contest;
pub mod ending;
mod events;
mod explain;
pub mod game;
pub mod history;
pub mod host;
pub mod keys;
mod mirror;
mod news;
mod opening;
pub mod outcome;
pub mod panel;
pub mod play;
pub mod robot;
pub mod search;
pub mod seeds;
pub mod settings;
#[cfg(target_arch = "wasm32")]
pub mod shell;
mod status;
pub mod stories;
mod tour;
pub mod turned;
pub mod view;
pub mod why;
pub mod wire;
pub mod words;

pub use panel::{Link, Panel};
