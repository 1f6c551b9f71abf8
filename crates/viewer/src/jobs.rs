//! Work beside the frame: on a thread of its own, or, in the browser, at once.

#[cfg(not(target_arch = "wasm32"))]
pub use threaded::Jobs;

#[cfg(target_arch = "wasm32")]
pub use inline::Jobs;

#[cfg(not(target_arch = "wasm32"))]
mod threaded {
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::thread::JoinHandle;

    type Job<T> = Box<dyn FnOnce() -> T + Send>;

    /// One worker that does jobs in order; results of type `T` are fetched later.
    #[derive(Debug)]
    pub struct Jobs<T> {
        to_do: Option<Sender<Job<T>>>,
        results: Receiver<T>,
        worker: Option<JoinHandle<()>>,
    }

    impl<T: Send + 'static> Jobs<T> {
        /// Starts the worker; it calls `wake` whenever a result has arrived.
        pub fn new(wake: impl Fn() + Send + 'static) -> Self {
            let (to_do, queue) = channel::<Job<T>>();
            let (done, results) = channel();
            let work = move || {
                while let Ok(job) = queue.recv() {
                    if done.send(job()).is_err() {
                        break;
                    }
                    wake();
                }
            };
            let worker = std::thread::Builder::new().name("chiaro-worker".into()).spawn(work);
            let worker = worker.inspect_err(|e| tracing::error!("no worker thread: {e}")).ok();
            Self { to_do: Some(to_do), results, worker }
        }

        /// Puts a job at the end of the queue.
        pub fn start(&mut self, job: impl FnOnce() -> T + Send + 'static) {
            if let Some(to_do) = &self.to_do {
                // Fails only when the worker is gone, and with it whoever waits for the result.
                let _ = to_do.send(Box::new(job));
            }
        }

        /// A result that has arrived.
        pub fn poll(&mut self) -> Option<T> {
            self.results.try_recv().ok()
        }
    }

    impl<T> Drop for Jobs<T> {
        fn drop(&mut self) {
            // The worker may be in the driver's compiler, which must not outlive the process' clean-up.
            self.to_do = None;
            if let Some(worker) = self.worker.take() {
                let _ = worker.join();
            }
        }
    }
}

#[cfg(target_arch = "wasm32")]
mod inline {
    use std::collections::VecDeque;

    /// Does each job when it is started.
    #[derive(Debug)]
    pub struct Jobs<T> {
        results: VecDeque<T>,
    }

    impl<T> Jobs<T> {
        /// Nothing to start.
        pub fn new(_wake: impl Fn() + 'static) -> Self {
            Self { results: VecDeque::new() }
        }

        /// Does a job.
        pub fn start(&mut self, job: impl FnOnce() -> T) {
            self.results.push_back(job());
        }

        /// A result that has arrived.
        pub fn poll(&mut self) -> Option<T> {
            self.results.pop_front()
        }
    }
}
