//! Running blocking work without holding up other requests.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread::available_parallelism,
};

use tokio::{sync::Semaphore, task::spawn_blocking};
use tokio_util::sync::CancellationToken;

use super::problem::{Kind, Problem};
use body_schema_calibration::Progress;

/// The most jobs that wait for a core.
const MOST_WAITING: usize = 64;

/// Runs blocking work on a thread where it holds up no other request.
pub(super) async fn run_blocking<T, E>(work: impl FnOnce() -> Result<T, E> + Send + 'static) -> Result<T, Problem>
where
    T: Send + 'static,
    E: Into<Problem> + Send + 'static,
{
    match spawn_blocking(work).await {
        Ok(done) => done.map_err(Into::into),
        Err(error) => Err(Problem::new(Kind::Internal, format!("a part of the server failed: {error}"))),
    }
}

/// Jobs that take a core for a while: as many at a time as there are cores, and a queue.
pub(super) struct Jobs {
    cores: Arc<Semaphore>,
    waiting: AtomicUsize,
}

/// Whether the caller of a job still waits for it.
pub(super) struct Wanted(CancellationToken);

impl Wanted {
    /// Whether the caller no longer waits.
    pub(super) fn is_given_up(&self) -> bool {
        self.0.is_cancelled()
    }
}

impl Progress for Wanted {
    fn stage(&self, _what: &str, _steps: u64) {}

    fn tick(&self) {}

    fn is_given_up(&self) -> bool {
        self.is_given_up()
    }
}

impl Default for Jobs {
    fn default() -> Self {
        let cores = available_parallelism().map_or(1, usize::from);
        Self { cores: Arc::new(Semaphore::new(cores)), waiting: AtomicUsize::new(0) }
    }
}

impl Jobs {
    /// Runs a job when its turn has come. The job learns when the caller has gone.
    pub(super) async fn done<T, E>(
        &self,
        work: impl FnOnce(&Wanted) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Problem>
    where
        T: Send + 'static,
        E: Into<Problem> + Send + 'static,
    {
        let core = {
            let _waiting = Waiting::among(&self.waiting)?;
            let core = self.cores.clone().acquire_owned().await;
            core.map_err(|_| Problem::new(Kind::Internal, "no core is left for it"))?
        };
        let given_up = CancellationToken::new();
        let wanted = Wanted(given_up.clone());
        let _caller = given_up.drop_guard();
        run_blocking(move || {
            let _core = core;
            work(&wanted)
        })
        .await
    }
}

/// A waiting job, counted.
struct Waiting<'a>(&'a AtomicUsize);

impl<'a> Waiting<'a> {
    fn among(waiting: &'a AtomicUsize) -> Result<Self, Problem> {
        let one_more = |count| (count < MOST_WAITING).then_some(count + 1);
        match waiting.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more) {
            Ok(_) => Ok(Self(waiting)),
            Err(_) => {
                let detail = "the server has as much to compute as may wait; ask again later";
                Err(Problem::new(Kind::Busy, detail))
            }
        }
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::{sleep, timeout};

    use super::*;

    #[tokio::test]
    async fn a_job_hears_that_its_caller_has_gone_and_makes_room() {
        let jobs = Jobs { cores: Arc::new(Semaphore::new(1)), waiting: AtomicUsize::new(0) };
        let forever = jobs.done(|wanted| {
            while !wanted.is_given_up() {
                std::thread::sleep(Duration::from_millis(1));
            }
            Ok::<_, Problem>(())
        });
        assert!(timeout(Duration::from_millis(50), forever).await.is_err());
        let next = timeout(Duration::from_secs(10), jobs.done(|_| Ok::<_, Problem>(7))).await;
        assert_eq!(next.expect("a core").expect("done"), 7);
    }

    #[tokio::test]
    async fn more_than_may_wait_are_refused() {
        let jobs = Arc::new(Jobs { cores: Arc::new(Semaphore::new(0)), waiting: AtomicUsize::new(0) });
        let ask = |jobs: Arc<Jobs>| tokio::spawn(async move { jobs.done(|_| Ok::<_, Problem>(())).await });
        let waiting: Vec<_> = (0..MOST_WAITING).map(|_| ask(jobs.clone())).collect();
        while jobs.waiting.load(Ordering::Relaxed) < MOST_WAITING {
            sleep(Duration::from_millis(1)).await;
        }
        assert_eq!(jobs.done(|_| Ok::<_, Problem>(())).await.expect_err("busy").status, 503);
        waiting.iter().for_each(tokio::task::JoinHandle::abort);
        for one in waiting {
            assert!(one.await.is_err_and(|error| error.is_cancelled()));
        }
        assert_eq!(jobs.waiting.load(Ordering::Relaxed), 0);
        jobs.cores.add_permits(1);
        jobs.done(|_| Ok::<_, Problem>(())).await.expect("room again");
    }
}
