//! Gauss-Seidel (gathering): receivers one after the other, each with what the ones before it have just received. A
//! sweep is worth about two plain iterations where light goes to and fro. In order, so on one thread.

use super::{Method, System, columns::Readers};
use glam::DVec3;

#[derive(Default)]
pub(super) struct GaussSeidel {
    readers: Option<Readers>,
}

/// Sweeps between two looks at the residual.
const SWEEPS: usize = 4;

impl Method for GaussSeidel {
    fn next(&mut self, system: &System, x: &mut Vec<DVec3>, mapped: &[DVec3]) -> Option<u64> {
        let readers = self.readers.get_or_insert_with(|| Readers::new(system));
        // The look was a plain iteration.
        x.copy_from_slice(mapped);
        let mut radiosity = system.radiosity(x);
        for _ in 0..SWEEPS {
            for (i, x) in x.iter_mut().enumerate() {
                let received = system.gathered(i, &radiosity);
                let change = received - *x;
                *x = received;
                readers.each(i, |p, weight| radiosity[p] += system.reflectance[p].as_dvec3() * (weight * change));
            }
        }
        Some(SWEEPS as u64 * system.entries())
    }
}
