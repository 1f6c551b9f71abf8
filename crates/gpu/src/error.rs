//! What a user of the GPU can act on.

/// Why the GPU could not do what was asked.
#[derive(Debug, Clone, thiserror::Error)]
pub enum GpuError {
    /// No adapter matches.
    #[error(
        "no graphics adapter {wanted}; found: {found}. Install a Vulkan driver (software: Debian's mesa-vulkan-drivers), \
         or name another adapter with CHIARO_ADAPTER"
    )]
    NoAdapter {
        /// What was asked for, in words.
        wanted: String,
        /// The adapters there are.
        found: String,
    },
    /// The adapter refused to make a device.
    #[error("{adapter} cannot give a device: {reason}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// The adapter lacks something that is needed.
    #[error("{adapter} lacks {what}")]
    Missing {
        /// The adapter's name.
        adapter: String,
        /// The limit or feature with its value and the value needed.
        what: String,
    },
    /// A shader does not link or validate.
    #[error("shader {name}: {message}")]
    Shader {
        /// The entry file.
        name: String,
        /// The linker's or validator's words, with the place.
        message: String,
    },
    /// The device is gone (driver reset, GPU removed).
    #[error("the GPU device was lost: {0}. Make a new device and upload the scene again")]
    DeviceLost(String),
    /// wgpu reported a validation or memory error.
    #[error("the GPU reported an error: {0}")]
    Device(String),
    /// More was asked for than the adapter can address.
    #[error("{what} needs {needed} {unit}, but this adapter allows {limit}: {advice}")]
    TooLarge {
        /// The thing that does not fit.
        what: String,
        /// Needed amount.
        needed: u64,
        /// Allowed amount.
        limit: u64,
        /// Unit of both.
        unit: &'static str,
        /// A way on.
        advice: &'static str,
    },
}

/// What `make` makes, or the validation error that it caused: error scopes belong to a thread, and pipelines are made on
/// many, where the caller's scope does not reach.
pub(crate) fn caught<T>(device: &wgpu::Device, make: impl FnOnce() -> T) -> Result<T, GpuError> {
    // A browser tells errors later than anyone here could wait for.
    if cfg!(target_arch = "wasm32") {
        return Ok(make());
    }
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let made = make();
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    match std::pin::pin!(scope.pop()).poll(&mut context) {
        std::task::Poll::Ready(Some(error)) => Err(GpuError::Device(error.to_string())),
        _ => Ok(made),
    }
}
