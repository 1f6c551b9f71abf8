//! Work on all cores that touches the device. In the browser, where wgpu's objects stay on one thread, it is done in turn.

#[cfg(not(target_arch = "wasm32"))]
pub use threaded::{all, each, join};

#[cfg(target_arch = "wasm32")]
pub use inline::{all, each, join};

#[cfg(not(target_arch = "wasm32"))]
mod threaded {
    use rayon::iter::{IntoParallelIterator, ParallelIterator};

    /// Does two things at once.
    pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
        rayon::join(a, b)
    }

    /// Does several things at once; they begin in this order.
    pub fn all(work: &mut [&mut (dyn FnMut() + Send)]) {
        rayon::scope_fifo(|scope| work.iter_mut().for_each(|work| scope.spawn_fifo(|_| work())));
    }

    /// `make(0)` to `make(count - 1)` at once, in this order; of several errors the first.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn each<T: Send, E: Send>(
        count: usize,
        make: impl Fn(usize) -> Result<T, E> + Send + Sync,
    ) -> Result<Vec<T>, E> {
        let made: Vec<_> = (0..count).into_par_iter().map(make).collect();
        made.into_iter().collect()
    }
}

#[cfg(target_arch = "wasm32")]
mod inline {
    /// Does two things.
    pub fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
        (a(), b())
    }

    /// Does several things.
    pub fn all(work: &mut [&mut dyn FnMut()]) {
        work.iter_mut().for_each(|work| work());
    }

    /// `make(0)` to `make(count - 1)`.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn each<T, E>(count: usize, make: impl Fn(usize) -> Result<T, E>) -> Result<Vec<T>, E> {
        (0..count).map(make).collect()
    }
}
