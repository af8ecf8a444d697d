//! The authors own layout.
