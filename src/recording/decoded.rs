//! Recordings read back, message by message.

use std::{
    any::Any,
    io::BufRead,
    panic::{AssertUnwindSafe, catch_unwind},
};

use re_log_encoding::DecoderApp;

use super::rerun::LogMsg;

/// The messages of a recording up to the first that cannot be read, and why it cannot.
pub(super) fn messages(stream: impl BufRead) -> impl Iterator<Item = Result<LogMsg, String>> {
    let (mut decoded, mut damage) = match guarded(|| DecoderApp::decode_eager(stream)) {
        Ok(Ok(decoded)) => (Some(decoded), None),
        Ok(Err(error)) => (None, Some(error.to_string())),
        Err(why) => (None, Some(why)),
    };
    std::iter::from_fn(move || {
        if let Some(why) = damage.take() {
            return Some(Err(why));
        }
        let why = match guarded(|| decoded.as_mut()?.next()) {
            Ok(None) => return None,
            Ok(Some(Ok(message))) => return Some(Ok(message)),
            Ok(Some(Err(error))) => error.to_string(),
            Err(why) => why,
        };
        decoded = None;
        Some(Err(why))
    })
}

/// What reads Arrow's buffers panics where a damaged message tells lengths beyond its end.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| said(&*panic))
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
