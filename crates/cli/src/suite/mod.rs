//! `chiaro bench --suite`: a group of techniques side by side.

pub mod reference;
pub mod shadows;
