//! OpenEXR out: lightmap pages.
