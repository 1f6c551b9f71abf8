//! The lighting techniques, one folder each.
