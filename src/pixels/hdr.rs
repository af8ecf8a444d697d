//! HDR in: skies.
