//! Work that would hold up other requests.

use tokio::task::spawn_blocking;

use super::problem::{Kind, Problem};

/// Does what takes long where it holds up no other request.
pub(super) async fn aside<T, E>(work: impl FnOnce() -> Result<T, E> + Send + 'static) -> Result<T, Problem>
where
    T: Send + 'static,
    E: Into<Problem> + Send + 'static,
{
    match spawn_blocking(work).await {
        Ok(done) => done.map_err(Into::into),
        Err(error) => Err(Problem::new(Kind::Internal, format!("a part of the server failed: {error}"))),
    }
}
