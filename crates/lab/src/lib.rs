//! Compare, sweep and bench techniques against a reference.
