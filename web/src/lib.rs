//! The panel of body-schema's page.
//!
//! ```text
//! host      what passes between the panel and the page: events in, commands out
//! wire      what the server sends, as far as it is shown
//! panel     the state                                    events     what happens, and what it does to the state
//! settings  the visitor's choice                         address    the choice as it stands in the page's address
//! play      making steps and going through them          history    the numbers of every step, verdicts
//! why       DIRECT's search, ready to be drawn           seeds      other seeds in the background
//! mirror    the state in words                           keys       the keyboard
//! view/     how all of it looks
//! shell     the WebAssembly that a browser runs (only there)
//! ```
//!
//! Nothing but `shell` knows of a browser: the page opens connections, asks the server and moves Rerun's viewer; the
//! panel decides. So tests drive it natively, by the labels that a visitor reads.

mod address;
pub mod colours;
mod events;
pub mod history;
pub mod host;
pub mod keys;
mod mirror;
pub mod panel;
pub mod play;
pub mod seeds;
pub mod settings;
#[cfg(target_arch = "wasm32")]
pub mod shell;
pub mod view;
pub mod why;
pub mod wire;

pub use panel::{Link, Panel};
