//! Linear images: EXR, HDR and PNG, colour, error metrics.
