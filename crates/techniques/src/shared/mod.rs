//! What all techniques share: the frame and scene bind groups and the WESL libraries.

pub mod albedo_table;
pub mod frame;
