//! What `opsr render` was asked, resolved: the method and the shape of the picture.

use super::Blame;
use super::render_args::{Mode, RenderArgs};
use anyhow::anyhow;
use opsr::files::hex;
use opsr::image::film::Window;
use opsr::integrator::{Method, Settings};
use opsr::math::UVec2;
use opsr::regularise::TableTuning;
use opsr::regularise::file::TableFile;
use opsr::regularise::rules::Mollifier;

/// A pair such as `640x480`.
pub(super) fn size(text: &str) -> Result<UVec2, String> {
    let numbers = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match numbers {
        Some((Ok(w @ 1..=65536), Ok(h @ 1..=65536))) => Ok(UVec2::new(w, h)),
        _ => Err("expected WIDTHxHEIGHT, such as 640x480, from 1 to 65536 each".into()),
    }
}

/// A window such as `10,20,32,32`.
pub(super) fn window(text: &str) -> Result<Window, String> {
    let numbers: Result<Vec<u32>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, w, h]) => Ok(Window { x, y, w, h }),
        _ => Err("expected X,Y,WIDTH,HEIGHT in pixels from the top left".into()),
    }
}

/// How the factors of a table are scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// As a pilot finds best.
    Auto,
    /// By this, instead of the table's own scale.
    By(f32),
}

/// A scale such as `0.5` or `auto`.
pub(super) fn scale(text: &str) -> Result<Scale, String> {
    if text == "auto" {
        return Ok(Scale::Auto);
    }
    match text.parse::<f32>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(Scale::By(x)),
        _ => Err("expected a number above 0, or auto".into()),
    }
}

/// The method, and the hash of its table where there is one.
pub(super) struct Chosen {
    pub(super) method: Method,
    pub(super) table_hash: Option<String>,
}

/// Resolves the options that say how to regularise.
pub(super) fn method(args: &RenderArgs) -> anyhow::Result<Chosen> {
    let reuse = args.mode == Mode::Reuse;
    let lambda = args.consistent.unwrap_or(0.0);
    let plain = |method| {
        Ok(Chosen {
            method,
            table_hash: None,
        })
    };
    let compared = !matches!(args.mode, Mode::Default | Mode::Reuse);
    if compared && (args.opsr_table.is_some() || args.gamma.is_some() || lambda > 0.0) {
        let what = "this --mode has a rule of its own: no --opsr-table, --gamma or --consistent";
        return Err(anyhow!(what)).usage();
    }
    match args.mode {
        Mode::Pbrt => return plain(Method::Pbrt),
        Mode::FilterGlossy => return plain(Method::FilterGlossy(args.filter)),
        Mode::RoughnessClamp => return plain(Method::RoughnessClamp),
        Mode::Mollifier => return plain(Method::Mollifier(Mollifier::RADIUS)),
        Mode::Default | Mode::Reuse => {}
    }
    if let Some(gamma) = args.gamma {
        return plain(Method::Constant {
            gamma,
            reuse,
            lambda,
        });
    }
    let Some(path) = &args.opsr_table else {
        if args.consistent.is_some() || reuse {
            let what = "--consistent and --mode reuse need --opsr-table or --gamma";
            return Err(anyhow!(what)).usage();
        }
        return plain(Method::Plain);
    };
    let file = TableFile::load(path).input()?;
    let mut table = file.table.tuned(TableTuning {
        scale: 1.0,
        contrast: args.table_contrast,
    });
    if let Some(Scale::By(scale)) = args.table_scale {
        if args.table_energy.is_some() {
            return Err(anyhow!("--table-energy needs --table-scale auto")).usage();
        }
        table.scale = scale;
    }
    if let Some(lookup) = args.lookup {
        table.lookup = lookup.into();
    }
    let table_hash = Some(hex(&file.digest()));
    Ok(Chosen {
        method: Method::Table {
            table,
            reuse,
            lambda,
        },
        table_hash,
    })
}

/// The settings with that method.
pub(super) fn settings(args: &RenderArgs, method: Method) -> Settings {
    Settings {
        method,
        max_vertices: args.max_depth,
        seed: args.seed,
        ..Settings::default()
    }
}
