//! The options, their help and their ranges.

mod audit;
mod bake;
mod baked;
mod chart;
mod inspect;
mod light;
mod render;

pub use audit::Audit;
pub use bake::Bake;
pub use baked::Baked;
pub use chart::Chart;
pub use inspect::Inspect;
pub use light::Light;
pub use render::Render;

use clap::{
    Parser, Subcommand,
    builder::{PossibleValuesParser, RangedU64ValueParser, TypedValueParser},
};

/// Bakes global illumination into glTF scenes: glTF in, the same glTF with HDR lightmaps out.
#[derive(Debug, Parser)]
#[command(name = "luxel", version, arg_required_else_help = true, after_help = EXAMPLE)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLE: &str = "Example: luxel bake scene.glb --sun 40,35,100000 --sky 4000,5000,7000 --preview scene.png";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bake the light of a scene into lightmaps
    Bake(Box<Bake>),
    /// Measure how wrong the lightmaps of a baked file are, by a path tracer that knows nothing of how they were made
    Audit(Box<Audit>),
    /// Paint a picture of a baked file: matt surfaces from its lightmaps, what metals mirror by ray tracing
    Render(Box<Render>),
    /// Paint what the lightmaps of a baked file are like: density, charts, overlaps, validity, receivers,
    /// rows, error
    Inspect(Box<Inspect>),
    /// Chart speed against accuracy on a scene: rays, solvers, receivers, texels, threads
    Chart(Box<Chart>),
}

/// One of a closed set, by its name.
fn named<T: Copy + Send + Sync + 'static>(
    all: impl IntoIterator<Item = T>,
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let all: Vec<T> = all.into_iter().collect();
    let parser = PossibleValuesParser::new(all.iter().map(|t| name(*t)));
    parser.try_map(move |text| all.iter().copied().find(|t| name(*t) == text).ok_or("no such name"))
}

/// Threads that a person may ask for.
fn threads() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=1024)
}

#[cfg(test)]
mod tests {
    use super::{bake::unwrappers, *};
    use clap::CommandFactory;
    use luxel::{
        atlas::{PAGE_EDGES, Unwrap},
        lightmaps::Content,
        radiosity::Solver,
        transport::{FormFactors, Receivers},
    };

    fn parse(options: &[&str]) -> Result<Bake, clap::Error> {
        match Args::try_parse_from(["luxel", "bake", "a.glb"].iter().chain(options))?.command {
            Command::Bake(bake) => Ok(*bake),
            _ => unreachable!("it says bake"),
        }
    }

    #[test]
    fn the_options_are_sound() {
        Args::command().debug_assert();
    }

    #[test]
    fn defaults_are_those_of_the_library() {
        let (bake, options) = (parse(&[]).unwrap(), luxel::bake::Options::default());
        let transport = options.transport;
        assert_eq!((bake.rays, !bake.no_reuse, bake.receivers), (None, transport.reuse, transport.receivers));
        assert_eq!(bake.form_factors, transport.form_factors);
        assert_eq!(bake.light.max_reflectance, options.max_reflectance);
        assert_eq!((bake.solver, bake.bounces), (options.radiosity.solver, options.radiosity.bounces));
        assert_eq!(bake.content, options.content);
    }

    #[test]
    fn what_is_out_of_range_is_wrong_usage() {
        let wrong: &[&[&str]] = &[
            &["--resolution", "15"],
            &["--page-size", "8"],
            &["--resolution", "32769"],
            &["--resolution", "1024", "--texels-per-meter", "4"],
            &["--texels-per-meter", "0"],
            &["--texels-per-meter", "nan"],
            &["--texels-per-meter", "-3"],
            &["--keep-uv", "--unwrap", "xatlas"],
            &["--unwrap", "blender"],
            &["--exclude", "[a"],
            &["--rays", "0"],
            &["--rays", "65537"],
            &["--threads", "0"],
            &["--max-reflectance", "1"],
            &["--light-scale", "-1"],
            &["--light-scale", "inf"],
            &["--content", "half"],
            &["--camera", "Main"],
            &["--preview", "a.jpg"],
            &["--flat", "a.gltf"],
            &["--bounces", "-1"],
            &["--bounces", "1.5"],
            &["--bounces", "65537"],
            &["--bounces", "all"],
            &["--solver", "magic"],
            &["--solver", "Jacobi"],
            &["--receivers", "few"],
            &["--form-factors", "magic"],
            &["--form-factors", "rays,3"],
            &["--form-factors", "hemicube,"],
            &["--form-factors", "hemicube,7"],
            &["--form-factors", "hemicube,2"],
            &["--form-factors", "hemicube,514"],
            &["--solver", ""],
            &["--error", "0"],
            &["--error", "2%", "--rays", "4"],
            &["--time", "0"],
            &["--quality", "best"],
            &["--quality", "high", "--bounces", "2"],
            &["b.glb"],
        ];
        for options in wrong {
            let error = parse(options).expect_err(&format!("{options:?}"));
            assert_eq!(error.exit_code(), 2, "{options:?}");
        }
    }

    #[test]
    fn every_member_of_a_set_has_a_name() {
        for solver in Solver::ALL {
            assert_eq!(parse(&["--solver", solver.name()]).unwrap().solver, solver);
        }
        for form_factors in FormFactors::ALL {
            for text in [form_factors.name().to_string(), form_factors.to_string()] {
                assert_eq!(parse(&["--form-factors", &text]).unwrap().form_factors, form_factors, "{text}");
            }
        }
        for receivers in Receivers::ALL {
            assert_eq!(parse(&["--receivers", receivers.name()]).unwrap().receivers, receivers);
        }
        for content in Content::ALL {
            assert_eq!(parse(&["--content", content.name()]).unwrap().content, content);
        }
        for unwrap in unwrappers() {
            assert_eq!(parse(&["--unwrap", unwrap.name()]).unwrap().unwrap, Some(unwrap));
        }
        assert!(parse(&["--unwrap", Unwrap::Keep.name()]).is_err());
    }

    #[test]
    fn the_help_names_the_limits_of_pages() {
        let (least, most) = PAGE_EDGES.into_inner();
        let help = Args::command().find_subcommand_mut("bake").unwrap().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(help.matches(&format!("{least} to {most}")).count(), 2, "{help}");
    }

    #[test]
    fn negative_numbers_are_values() {
        for option in ["--resolution", "--page-size", "--rays", "--threads"] {
            let said = parse(&[option, "-1"]).unwrap_err().to_string();
            assert!(said.contains(&format!("invalid value '-1' for '{option}")), "{said}");
        }
        let bake = parse(&["--sun", "-90,45,1000", "--preview", "a.png", "--camera", "-1,0,0,0,0,0"]).unwrap();
        assert!(bake.light.sun.is_some() && bake.camera.is_some());
    }
}
