//! The two doors: [`read`] gives a [`Document`] and a [`crate::scene::Scene`], [`write`] binds lightmaps to the document.
