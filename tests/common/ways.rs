//! [`Way`]: how a scene is baked; [`Runs`]: every solver on the rows of one estimator, which are measured once.

use super::{
    bakes::{Parts, Shot, try_shoot},
    stage::Stage,
};
use luxel::{
    atlas::{self, Atlas, Coverage},
    bake::Options,
    direct::{Direct, Sources, sky_cells},
    error::Result,
    lightmaps::Lightmaps,
    patches::Patches,
    progress::Silent,
    radiosity::{Radiosity, Solver},
    report::Report,
    scene::{Scene, World},
    trace::Tracer,
    transport::{FormFactors, Transport},
};
use std::{
    cell::{Cell, RefCell},
    collections::HashMap,
    rc::Rc,
};

/// An estimator and a solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Way {
    pub form_factors: FormFactors,
    pub solver: Solver,
}

impl Way {
    /// What it differs in from the default; none for the default itself.
    pub fn name(self) -> Option<String> {
        let form_factors = (self.form_factors != FormFactors::default()).then(|| self.form_factors.name());
        let solver = (self.solver != Solver::default()).then(|| self.solver.name());
        let names: Vec<&str> = form_factors.into_iter().chain(solver).collect();
        (!names.is_empty()).then(|| names.join(" and "))
    }

    /// Options, but by this way.
    pub fn of(self, mut options: Options) -> Options {
        options.transport.form_factors = self.form_factors;
        options.radiosity.solver = self.solver;
        options
    }
}

/// One case by one estimator. A case builds its stages in the same order for every solver: the rows of the first time
/// serve the others. By default it bakes, as users do.
pub struct Runs {
    pub way: Way,
    measured: RefCell<HashMap<usize, Rc<Measured>>>,
    next: Cell<usize>,
}

impl Runs {
    pub fn new(form_factors: FormFactors) -> Self {
        let way = Way { form_factors, ..Way::default() };
        Runs { way, measured: RefCell::default(), next: Cell::new(0) }
    }

    /// The case begins anew.
    pub fn by(&mut self, solver: Solver) -> &Self {
        self.way.solver = solver;
        self.next.set(0);
        self
    }

    /// The next stage of the case.
    pub fn shoot(&self, stage: Stage, options: Options) -> Result<Shot> {
        let at = self.next.replace(self.next.get() + 1);
        if self.way == Way::default() {
            return try_shoot(stage, options);
        }
        Shot::of(stage, self.way.of(options), |scene, options| {
            let known = self.measured.borrow().get(&at).cloned();
            let measured = match known {
                Some(measured) => measured,
                None => {
                    let measured = Rc::new(Measured::new(scene, options)?);
                    self.measured.borrow_mut().insert(at, measured.clone());
                    measured
                }
            };
            measured.solved(scene, options)
        })
    }
}

/// Rooms of a bake up to the one that solves.
struct Measured {
    atlas: Atlas,
    coverage: Coverage,
    patches: Patches,
    transport: Transport,
    direct: Direct,
    gathered: bool,
}

impl Measured {
    fn new(scene: &Scene, options: &Options) -> Result<Self> {
        let atlas = atlas::unwrap(scene, &options.atlas, &scene.file, &Silent, &mut Vec::new())?;
        let world = World::new(scene);
        let coverage = Coverage::new(&world, &atlas);
        options.transport.form_factors.check(coverage.texels.len())?;
        let tracer = Tracer::new(world);
        let mut patches = Patches::new(&tracer.world, &coverage, options.max_reflectance);
        let transport = Transport::measure(&tracer, &coverage, &mut patches, &options.transport, &Silent)?;
        transport.validate(&patches).expect("sound rows");
        let sources = Sources::new(&tracer, &patches);
        let direct = Direct::measure(&tracer, &coverage, &patches, &sources, options.shadow_rays, &Silent)?;
        let gathered = sources.gathered;
        Ok(Measured { atlas, coverage, patches, transport, direct, gathered })
    }

    fn solved(&self, scene: &Scene, options: &Options) -> Result<Parts> {
        let Measured { atlas, coverage, patches, transport, direct, gathered } = self;
        let sky = sky_cells(&scene.sky);
        let solved = Radiosity::solve(transport, patches, direct, &sky, *gathered, &options.radiosity, &Silent)?;
        let world = World::new(scene);
        let lightmaps = Lightmaps::new(&world, atlas, coverage, patches, direct, &solved, options.content);
        let irradiance = (0..patches.len()).map(|p| direct.total(p) + solved.indirect[p]).collect();
        let report = Report { texels: coverage.texels.len(), solver: solved.report, ..Report::default() };
        let (atlas, coverage, patches) = (atlas.clone(), coverage.clone(), patches.clone());
        Ok(Parts { atlas, coverage, patches, irradiance, lightmaps, report })
    }
}
