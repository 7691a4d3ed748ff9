//! Requests on threads of their own, so that any thread can wait for them, also one of the caller's runtime.

use crate::error::{ArtifactError, Result};
use std::future::Future;
use std::sync::mpsc;
use tokio::runtime::{Builder, Runtime};

/// Threads that send requests.
const THREADS: usize = 2;

#[derive(Debug)]
pub(super) struct RequestThreads {
    /// `None` only while it is dropped.
    runtime: Option<Runtime>,
}

impl RequestThreads {
    pub(super) fn start() -> Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(THREADS).thread_name("remote").enable_all().build();
        let runtime = runtime.map_err(|error| ArtifactError::io("start threads for requests", error))?;
        Ok(Self { runtime: Some(runtime) })
    }

    /// Runs a request and blocks until it has ended.
    ///
    /// # Panics
    ///
    /// If the request panics.
    pub(super) fn wait<T: Send + 'static>(&self, request: impl Future<Output = T> + Send + 'static) -> T {
        let (sender, receiver) = mpsc::channel();
        let runtime = self.runtime.as_ref().expect("the threads run until they are dropped");
        runtime.spawn(async move {
            let _ = sender.send(request.await);
        });
        receiver.recv().expect("a request does not panic")
    }
}

impl Drop for RequestThreads {
    fn drop(&mut self) {
        // The usual end waits for the threads, which a thread of the caller's runtime may not do.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}
