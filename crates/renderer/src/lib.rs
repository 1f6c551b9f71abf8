//! Real-time shadows, indirect light and caustics on wgpu.
