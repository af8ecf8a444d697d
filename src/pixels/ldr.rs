//! PNG, JPEG and WebP in, PNG out.
