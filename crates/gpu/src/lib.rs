//! A thin layer over wgpu: device choice, frame recorder, shader linking.
