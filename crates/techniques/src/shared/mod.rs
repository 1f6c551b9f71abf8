//! What all techniques share: the BRDF and its table, sampling, colour, unit vectors, hashes.

pub mod albedo_table;
