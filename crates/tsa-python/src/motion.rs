//! A motion that another thread leads.

use crate::errors::{broken, error, of_kind, wrong};
use crate::locked;
use crate::rig::{Shared, stop};
use pyo3::prelude::*;
use rigctl::failure::Failure;
use rigctl::session::Session;
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::time::Duration;

/// How often a call that waits for another thread looks at Python's signals.
pub(crate) const LOOK: Duration = Duration::from_millis(20);

/// What a motion ended with, once it has.
#[derive(Default)]
struct End {
    result: Mutex<Option<Result<String, (&'static str, String)>>>,
    there: Condvar,
}

/// A motion that another thread leads.
#[pyclass(frozen)]
pub(crate) struct Motion {
    shared: Arc<Shared>,
    end: Arc<End>,
}

#[pymethods]
impl Motion {
    #[getter]
    fn done(&self) -> bool {
        locked(&self.end.result).is_some()
    }

    /// The result; `None` if it has not ended after a time (s).
    fn wait(&self, py: Python<'_>, seconds: Option<f64>) -> PyResult<Option<String>> {
        let limit = match seconds.map(Duration::try_from_secs_f64) {
            None => None,
            Some(Ok(limit)) => Some(limit),
            Some(Err(e)) => return Err(wrong(format!("timeout: {e}"))),
        };
        let start = std::time::Instant::now();
        loop {
            let ended = py.detach(|| {
                let result = locked(&self.end.result);
                if result.is_some() {
                    return result.clone();
                }
                let waited = self.end.there.wait_timeout(result, LOOK);
                waited.unwrap_or_else(PoisonError::into_inner).0.clone()
            });
            if let Some(result) = ended {
                return result.map(Some).map_err(|(kind, text)| of_kind(kind, &text));
            }
            if let Err(signal) = py.check_signals() {
                py.detach(|| stop(&mut self.shared.alone())).map_err(error)?;
                return Err(signal);
            }
            if limit.is_some_and(|limit| start.elapsed() >= limit) {
                return Ok(None);
            }
        }
    }
}

impl Motion {
    /// Begins it in a thread of its own.
    pub(crate) fn begin<T: serde::Serialize>(
        py: Python<'_>,
        shared: &Arc<Shared>,
        run: impl FnOnce(&mut Session) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<Self> {
        let (shared, end) = (shared.clone(), Arc::new(End::default()));
        let motion = Self { shared: shared.clone(), end: end.clone() };
        let (began, begins) = mpsc::channel();
        std::thread::Builder::new()
            .spawn(move || {
                let result = shared.work(|session, _| {
                    // The caller goes on once the session is this thread's.
                    let _ = began.send(());
                    run(session)
                });
                let result = match result {
                    Ok(ended) => serde_json::to_string(&ended).map_err(|e| ("failed", e.to_string())),
                    Err(failure) => Err((failure.kind(), failure.message().unwrap_or_default())),
                };
                *locked(&end.result) = Some(result);
                end.there.notify_all();
            })
            .map_err(broken)?;
        // Nothing comes if the rig is closed, which `wait` says.
        let _ = py.detach(move || begins.recv());
        Ok(motion)
    }
}
