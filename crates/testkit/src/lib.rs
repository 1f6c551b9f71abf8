//! Headless device, golden images and references for tests.
