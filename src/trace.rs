//! [`Tracer`]: closest hit and occlusion. The only place that knows the BVH crate.

/// Rays against a scene.
pub struct Tracer {}
