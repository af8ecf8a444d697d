//! Rows that are refined keep their rays: 16 and 48 more are as good as 64 at once.

mod common;

use common::{
    bakes::within_sigma,
    exact,
    scenes::{Cuboid, rectangle},
    stage::Stage,
};
use glam::{DVec3, UVec2, Vec3, vec3};
use luxel::{
    atlas::{self, Coverage, Density, Unwrap},
    direct::{Direct, Kept, Sources},
    error::Error,
    math::CELLS,
    patches::Patches,
    progress::Silent,
    scene::{LightKind, Scene, Sky, World},
    trace::Tracer,
    transport::{FormFactors, Options, Receivers, Transport},
};
use std::collections::{HashMap, HashSet};

/// Half an edge of the sheet above the floor, and its height.
const HALF: f32 = 0.1;
const HEIGHT: f32 = 0.5;

/// A floor under the open sky, and whatever else.
fn floor(build: impl Fn(&mut Stage, u32)) -> Stage {
    let mut stage = Stage::new();
    let grey = stage.material(0.5, 0.0);
    rectangle(&mut stage, grey, [vec3(-0.5, 0.0, -0.5), Vec3::Z, Vec3::X], UVec2::splat(8));
    build(&mut stage, grey);
    stage.scene.sky = Sky::Uniform(Vec3::ONE);
    stage
}

/// A sheet hangs above the floor, so small that few rays meet it.
fn sheet() -> Stage {
    floor(|stage, _| {
        let sheet = stage.rgb(Vec3::splat(0.5), Vec3::ZERO, true);
        let edge = 2.0 * HALF;
        rectangle(stage, sheet, [vec3(-HALF, HEIGHT, -HALF), Vec3::Z * edge, Vec3::X * edge], UVec2::splat(8));
    })
}

/// A box stands on the floor: its side halves the texels of the sixth column.
fn under_a_box() -> Stage {
    floor(|stage, grey| drop(Cuboid::block(vec3(-0.6, -0.01, -0.6), vec3(0.1875, 0.3, 0.6)).all(stage, grey, 4)))
}

struct Ground<'s> {
    tracer: Tracer<'s>,
    coverage: Coverage,
    /// The floor's place on the page.
    corner: UVec2,
}

impl<'s> Ground<'s> {
    fn new(scene: &'s Scene, edge: u32, corner: UVec2) -> Self {
        let layout = atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), page_size: 8192 };
        let atlas = atlas::unwrap(scene, &layout, &scene.file, &Silent, &mut Vec::new()).expect("a layout");
        Ground { coverage: Coverage::new(&World::new(scene), &atlas), tracer: Tracer::new(World::new(scene)), corner }
    }

    /// The texels of the floor with their middles.
    fn floor(&self) -> Vec<(usize, Vec3)> {
        let at = |i: usize| self.coverage.texels[i].at.checked_sub(self.corner).filter(|at| at.max_element() < 8);
        let middle = |at: UVec2| (vec3(at.y as f32, 0.0, at.x as f32) + 0.5) / 8.0 - 0.5;
        let texels = (0..self.coverage.texels.len()).filter_map(|i| Some((i, middle(at(i)?).with_y(0.0))));
        texels.collect()
    }

    fn measured(&self, options: &Options) -> (Transport, Patches) {
        let mut patches = Patches::new(&self.tracer.world, &self.coverage, 0.98);
        let transport = Transport::measure(&self.tracer, &self.coverage, &mut patches, options, &Silent);
        (transport.expect("rows"), patches)
    }

    fn refined(&self, (transport, patches): (Transport, Patches), options: &Options) -> (Transport, Patches) {
        let mut patches = patches;
        let transport = transport.refine(&self.tracer, &self.coverage, &mut patches, options, &Silent).expect("rows");
        transport.validate(&patches).expect("sound rows");
        (transport, patches)
    }
}

/// Runs `check` on the ground of a stage.
fn on<T>(mut stage: Stage, check: impl FnOnce(&Ground) -> T) -> T {
    let (edge, corners) = stage.lay_out();
    check(&Ground::new(&stage.scene, edge, corners[0]))
}

/// Rays of a row.
fn rays(transport: &Transport, row: usize) -> usize {
    (1.0 / transport.rows.row(row).weight).round() as usize
}

/// Shadow rays that join others, below a sheet under a wide sun, whose back is found later: light is as exact as if all were
/// shot at once, for fewer rays.
#[test]
fn shadow_rays_join_those_of_before() {
    let mut stage = sheet();
    stage.light(LightKind::Directional { angle: 0.2 }, Vec3::ZERO, vec3(0.3, -1.0, 0.2), 1.0);
    on(stage, |ground| {
        let (transport, few) = ground.measured(&Options::of(16));
        let (_, many) = ground.refined((transport, few.clone()), &Options::of(64));
        let (tracer, coverage) = (&ground.tracer, &ground.coverage);
        let sources = Sources::new(tracer, &many);
        let at_once = |rays| Direct::measure(tracer, coverage, &many, &sources, rays, &Silent).expect("light");
        let (truth, fresh) = (at_once(4096), at_once(128));
        let mut kept = Kept::default();
        let first = Direct::refine(&mut kept, tracer, coverage, &few, &sources, 32, &Silent).expect("light");
        let joined = Direct::refine(&mut kept, tracer, coverage, &many, &sources, 128, &Silent).expect("light");
        assert!(few.len() < many.len() && joined.lights.len() == many.len(), "{} {}", few.len(), many.len());
        let off = |d: &Direct| {
            let squares = (0..few.len()).map(|i| f64::from((d.lights[i].x - truth.lights[i].x).powi(2)));
            libm::sqrt(squares.sum::<f64>() / few.len() as f64)
        };
        let errors = [&first, &joined, &fresh].map(off);
        let shot = [first.shadow_rays, joined.shadow_rays - first.shadow_rays, fresh.shadow_rays];
        assert!(errors[1] < 0.5 * errors[0] && errors[1] < 1.25 * errors[2], "{errors:?}");
        assert!(shot[1] < shot[2] * 4 / 5, "{shot:?}");
        // What is kept is what the rays have told, not what neighbours make of it: as many again are there already.
        let again = Direct::refine(&mut kept, tracer, coverage, &many, &sources, 128, &Silent).expect("light");
        assert_eq!((again.shadow_rays, &again.lights), (joined.shadow_rays, &joined.lights));
    });
}

/// The same of rays to a bright spot on the floor, below a table: what is sampled of it stays, the rays join.
#[test]
fn rays_to_bright_patches_join_those_of_before() {
    let mut stage = Stage::new();
    let grey = stage.material(0.7, 0.0);
    Cuboid::room(Vec3::ZERO, Vec3::ONE).all(&mut stage, grey, 12);
    Cuboid::block(vec3(0.2, 0.3, 0.2), vec3(0.5, 0.35, 0.5)).all(&mut stage, grey, 6);
    let cone = LightKind::Spot { cos_inner: 0.98, cos_outer: 0.97, radius: 0.0 };
    stage.light(cone, vec3(0.65, 0.9, 0.65), Vec3::NEG_Y, 1.0);
    on(stage, |ground| {
        let (tracer, coverage) = (&ground.tracer, &ground.coverage);
        let (_, patches) = ground.measured(&Options::of(16));
        let sources = Sources::new(tracer, &patches);
        let at_once = |rays| Direct::measure(tracer, coverage, &patches, &sources, rays, &Silent).expect("light");
        let (truth, fresh) = (at_once(1 << 14), at_once(256));
        let mut kept = Kept::default();
        let mut refined =
            |rays| Direct::refine(&mut kept, tracer, coverage, &patches, &sources, rays, &Silent).expect("light");
        let [first, joined] = [64, 256].map(&mut refined);
        assert_eq!(first.bounce.exitance, joined.bounce.exitance);
        let off = |d: &Direct| {
            let squares = d.bounce.irradiance.iter().zip(&truth.bounce.irradiance).map(|(a, b)| (a.x - b.x).powi(2));
            libm::sqrt(f64::from(squares.sum::<f32>()))
        };
        let errors = [&first, &joined, &fresh].map(off);
        // Edges keep theirs and are given nearly as many as all: they have more than at once.
        assert!(errors[1] < 0.6 * errors[0] && errors[1] < 0.95 * errors[2], "{errors:?}");
        assert!(joined.shadow_rays - first.shadow_rays < fresh.shadow_rays, "as many rays as if none were there");
    });
}

/// Each row holds the rays that it held, to the bit, and as many more as asked for; those of new backs are whole, too.
#[test]
fn what_is_measured_is_kept() {
    on(sheet(), |ground| {
        let (few, known) = ground.measured(&Options::of(16));
        let (many, patches) = ground.refined(ground.measured(&Options::of(16)), &Options::of(64));
        let backs = [known.backs.len(), patches.backs.len()];
        assert!(0 < backs[0] && backs[0] < backs[1] && patches.backs.starts_with(&known.backs), "{backs:?}");
        assert_eq!(patches.backs.iter().collect::<HashSet<_>>().len(), backs[1], "no back is there twice");
        assert_eq!(many.receivers, (0..patches.len() as u32).collect::<Vec<_>>());
        assert_eq!(many.stats.traced, 64 * many.receivers.len() as u64);
        for i in 0..many.receivers.len() {
            assert_eq!((rays(&many, i), patches.validity[i], patches.buried[i]), (64, 1.0, false), "row {i}");
        }
        // Columns by the places where rays ended, which none shares with another.
        let columns = |t: &Transport, i: usize| {
            let ends = t.rows.ends(i);
            let key = |spot: &Vec3| spot.to_array().map(f32::to_bits);
            ends.spots.iter().map(key).zip(ends.columns.iter().copied()).collect::<HashMap<_, _>>()
        };
        for i in 0..patches.fronts {
            let now = columns(&many, i);
            assert_eq!(now.len(), 64);
            for (spot, column) in columns(&few, i) {
                let sky = column as usize >= known.len();
                let expected = if sky { column + (patches.len() - known.len()) as u32 } else { column };
                assert_eq!(now.get(&spot), Some(&expected), "row {i}");
            }
            // The new ones end where their columns say.
            for (spot, column) in now {
                let spot = Vec3::from_array(spot.map(f32::from_bits));
                match patches.center.get(column as usize) {
                    // The diagonal of a texel of the sheet.
                    Some(center) => assert!(center.distance(spot) < 0.036, "row {i}, column {column}: {spot}"),
                    None => assert!(spot.length() > 10.0 && column < patches.len() as u32 + CELLS, "{spot}"),
                }
            }
        }
    });
}

/// The sheet as each texel of the floor sees it, and the cells of the sky as all do.
#[test]
fn refined_rows_are_as_good_as_rows_measured_at_once() {
    on(sheet(), |ground| {
        let (refined, patches) = ground.refined(ground.measured(&Options::of(16)), &Options::of(64));
        let (at_once, other) = ground.measured(&Options::of(64));
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let sheet = corners.map(|[x, z]| (vec3(x * HALF, HEIGHT, z * HALF)).as_dvec3());
        let floor = ground.floor();
        assert_eq!(floor.len(), 64);
        let share = |t: &Transport, i: usize| t.rows.row(i).split(t.patches as u32)[0].sum(|_| 1.0);
        let errors = |t: &Transport| -> Vec<f64> {
            let error = |&(i, middle): &(usize, Vec3)| {
                let low = middle.as_dvec3() - DVec3::new(0.0625, 0.0, 0.0625);
                let texel = [low, DVec3::X * 0.125, DVec3::Z * 0.125];
                let exact = exact::mean_over(texel, 8, |p| exact::element_to_polygon(p, DVec3::Y, &sheet));
                (share(t, i) - exact) / libm::sqrt(exact * (1.0 - exact) / 64.0)
            };
            floor.iter().map(error).collect()
        };
        let rms = |e: &[f64]| libm::sqrt(e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64);
        let found = [errors(&refined), errors(&at_once)];
        let [mean, _] = found.each_ref().map(|e| e.iter().sum::<f64>() / 64.0);
        println!("rms {:?} sigma, mean {mean}", found.each_ref().map(|e| rms(e)));
        found.iter().for_each(|e| assert!(within_sigma(e).is_ok()));
        assert!(rms(&found[0]) < 1.0 && mean.abs() < 3.0 / 8.0, "independent rays have 1 and 1/8");
        let cells = |t: &Transport| {
            let mut counts = vec![0.0; CELLS as usize];
            let sky = floor.iter().flat_map(|&(i, _)| t.rows.row(i).split(t.patches as u32)[1].columns);
            sky.for_each(|&c| counts[c as usize - t.patches] += 1.0);
            counts
        };
        let apart = cells(&refined).into_iter().zip(cells(&at_once)).filter(|(a, b)| a + b > 0.0);
        let apart: Vec<f64> = apart.map(|(a, b)| (a - b) / libm::sqrt(a + b)).collect();
        assert!(apart.len() > 100 && rms(&apart) < 1.2, "{} cells, {} sigma", apart.len(), rms(&apart));
        assert_eq!((patches.fronts, refined.eyes.len()), (other.fronts, at_once.eyes.len()));
        for (a, b) in refined.eyes.iter().zip(&at_once.eyes) {
            assert!(a.normal == b.normal && a.position.distance(b.position) < 0.02, "{a:?} {b:?}");
        }
    });
}

/// What a box covers is found by each lot of rays; a single ray that began under it does not bury the texel.
#[test]
fn open_parts_of_texels_are_those_of_both_lots() {
    for first in [1, 2, 16] {
        on(under_a_box(), |ground| {
            let before = ground.measured(&Options::of(first));
            let buried_before = before.1.buried.clone();
            let (transport, patches) = ground.refined(before, &Options::of(64));
            let mut opened = 0;
            for (i, middle) in ground.floor() {
                let (x, validity, buried) = (middle.x, patches.validity[i], patches.buried[i]);
                let found = format!("{first} rays first, x {x}: validity {validity}, buried {buried}");
                match x {
                    x if x < 0.125 => assert!(buried && validity == 1.0, "{found}"),
                    x if x > 0.25 => assert!(!buried && validity == 1.0, "{found}"),
                    _ => {
                        assert!(!buried && (0.4..0.6).contains(&validity), "{found}");
                        opened += usize::from(buried_before[i]);
                        // Half of the rays are shot again, a quarter once more: a sixteenth is lacking in the end.
                        assert!((55..=64).contains(&rays(&transport, i)), "{found}, {} rays", rays(&transport, i));
                    }
                }
            }
            assert!(first > 1 || opened > 0, "no single ray began under the box");
        });
    }
}

#[test]
fn threads_do_not_change_a_row() {
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let rows = |ground: &Ground| {
            let of_16 = ground.measured(&Options::of(16));
            let (t, patches) = ground.refined(ground.refined(of_16, &Options::of(32)), &Options::of(64));
            let ends = (0..t.rows.len()).map(|i| (t.rows.ends(i).columns.to_vec(), t.rows.ends(i).spots.to_vec()));
            (ends.collect::<Vec<_>>(), patches.backs, patches.validity)
        };
        pool.install(|| on(sheet(), rows))
    });
    assert!(one == two);
}

/// Rows without the places at which rays ended keep nothing of those that met nothing, but their number.
#[test]
fn rows_that_nobody_shares_are_refined_too() {
    let alone = |rays: u32| Options { reuse: false, ..Options::of(rays) };
    on(under_a_box(), |ground| {
        let (transport, patches) = ground.refined(ground.measured(&alone(16)), &alone(64));
        let whole = (0..transport.receivers.len()).filter(|&i| patches.validity[i] == 1.0 && !patches.buried[i]);
        let rows: Vec<usize> = whole.map(|i| rays(&transport, i)).collect();
        assert!(rows.len() > 16 && rows.iter().all(|&rays| rays == 64), "{rows:?}");
        assert!(transport.eyes.is_empty());
    });
}

/// Places are kept only where all rays of a row have one; groups are those of the patches that there are.
#[test]
fn groups_go_with_the_rays_that_are_shared() {
    on(sheet(), |ground| {
        let shared = Options::of(64);
        let alone = Options { reuse: false, ..shared };
        let (transport, patches) = ground.refined(ground.measured(&Options::of(16)), &shared);
        let groups = transport.groups.expect("groups");
        let members: Vec<u32> = (0..groups.len()).flat_map(|g| groups.members(g).to_vec()).collect();
        assert_eq!(members.len(), patches.len());
        assert_eq!(members.into_iter().collect::<HashSet<_>>().len(), patches.len(), "each patch once");
        let (transport, _) = ground.refined(ground.measured(&Options::of(16)), &alone);
        assert!(transport.groups.is_none() && transport.eyes.is_empty());
    });
}

#[test]
fn what_cannot_be_refined_is_refused() {
    let plain = Options::of(16);
    let hemicube = FormFactors::Hemicube { resolution: 4 };
    let adaptive = Options { receivers: Receivers::Auto, ..plain };
    let cases = [
        (plain, plain),
        (plain, Options::of(8)),
        (plain, Options { form_factors: hemicube, ..Options::of(64) }),
        (plain, Options { receivers: Receivers::Auto, ..Options::of(64) }),
        (adaptive, Options { receivers: Receivers::Auto, ..Options::of(64) }),
        (Options { form_factors: hemicube, ..plain }, Options::of(64)),
        (Options { reuse: false, ..plain }, Options::of(64)),
    ];
    on(sheet(), |ground| {
        for (before, after) in cases {
            let (transport, mut patches) = ground.measured(&before);
            assert!(!transport.can_refine(&after));
            let refused = transport.refine(&ground.tracer, &ground.coverage, &mut patches, &after, &Silent);
            assert!(matches!(refused, Err(Error::Usage(_))), "{before:?}, then {after:?}");
        }
        assert!(ground.measured(&plain).0.can_refine(&Options::of(17)));
    });
}
