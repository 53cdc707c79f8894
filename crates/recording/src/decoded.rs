//! Reading recordings back, message by message.

use std::{
    any::Any,
    cell::Cell,
    io::BufRead,
    panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook},
    sync::Once,
};

use re_log_encoding::{DecodeError, DecoderApp};

use super::{rerun::LogMsg, stream::Frames};

/// The messages of a recording up to the first unreadable one, and then the reason.
pub(super) fn messages(stream: impl BufRead) -> impl Iterator<Item = Result<LogMsg, String>> {
    let mut decoded = Some(DecoderApp::decode_lazy(Frames::new(stream)));
    std::iter::from_fn(move || {
        let why = match guarded(|| decoded.as_mut()?.next()) {
            Ok(None) => return None,
            Ok(Some(Ok(message))) => return Some(Ok(message)),
            Ok(Some(Err(error))) => what(error),
            Err(why) => why,
        };
        decoded = None;
        Some(Err(why))
    })
}

fn what(error: DecodeError) -> String {
    match error {
        DecodeError::Read(error) => error.to_string(),
        other => other.to_string(),
    }
}

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` and returns a panic as an error: Arrow's reader of buffers panics where a damaged message states lengths beyond
/// its end.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_GUARDED.get() {
                others(panic);
            }
        }));
    });
    IS_GUARDED.set(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_GUARDED.set(false);
    done.map_err(|panic| said(&*panic))
}

fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("a message that cannot be decoded").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_told_as_damage() {
        assert_eq!(guarded(|| 1), Ok(1));
        assert_eq!(guarded(|| -> u8 { panic!("beyond the end: {}", 5) }), Err("beyond the end: 5".to_owned()));
        assert_eq!(guarded(|| -> u8 { panic!("beyond") }), Err("beyond".to_owned()));
    }
}
