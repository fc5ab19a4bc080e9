//! `--aov`: layers of EXR files beside the picture.

use super::Blame;
use super::render_args::RenderArgs;
use anyhow::anyhow;
use opsr::image::exr::Layer;
use opsr::image::film::Window;
use opsr::integrator::aov::{Aovs, Centres, FirstHit, LightSplit, PixelTime};
use opsr::integrator::{Estimator, Picture, Settings, View};

/// A layer, or channels, that a render can add to its EXR files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Aov {
    /// Mean reflectance of the first surface.
    Albedo,
    /// Mean world normal of the first surface.
    Normal,
    /// Mean distance to the first surface; infinity where there is none.
    Depth,
    /// Channel A: share of the camera rays that meet a surface.
    Alpha,
    /// World position of the surface at the centre of the pixel.
    Position,
    /// Numbers of mesh and material at the centre of the pixel, from 1.
    Id,
    /// Light straight from emitters and the environment.
    Emission,
    /// Light scattered once.
    Direct,
    /// Light scattered more often.
    Indirect,
    /// Level of roughening that was chosen; --levels adds it anyhow.
    Level,
    /// Seconds spent on the paths of the pixel.
    Time,
}

/// Layers that a render adds.
pub(super) struct Layers<'a> {
    wanted: &'a [Aov],
    centres: Option<Centres>,
}

/// True if the layers need the light of a single level.
pub(super) fn splits_light(args: &RenderArgs) -> bool {
    let of = [Aov::Emission, Aov::Direct, Aov::Indirect];
    args.aov.iter().any(|aov| of.contains(aov))
}

/// An error for a layer that the render has not.
pub(super) fn check(args: &RenderArgs, settings: &Settings) -> anyhow::Result<()> {
    let wants = |aov| args.aov.contains(&aov);
    let light = splits_light(args);
    let path = matches!(settings.estimator, Estimator::Path { .. }) && settings.levels.is_empty();
    let what = if light && !path {
        "--aov emission, direct and indirect are of the path tracer with one level"
    } else if wants(Aov::Level) && settings.levels.is_empty() {
        "--aov level needs --levels"
    } else if wants(Aov::Time) && args.reproducible {
        "--aov time never makes the same file twice: not with --reproducible"
    } else {
        return Ok(());
    };
    Err(anyhow!(what)).usage()
}

/// Parts of the AOVs that are recorded along paths: the first surface, light, time.
pub(super) fn recorded(args: &RenderArgs) -> [bool; 3] {
    let any = |of: &[Aov]| of.iter().any(|aov| args.aov.contains(aov));
    [
        any(&[Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Alpha]) || args.resolve.denoise,
        any(&[Aov::Emission, Aov::Direct, Aov::Indirect]),
        any(&[Aov::Time]),
    ]
}

/// An empty record of the layers that are recorded along paths; `None` if there are none.
pub(super) fn record(args: &RenderArgs, window: Window) -> Option<Aovs> {
    let [first, light, time] = recorded(args);
    (first || light || time).then(|| Aovs {
        first: first.then(|| FirstHit::new(window)),
        light: light.then(|| LightSplit::new(window)),
        time: time.then(|| PixelTime::new(window)),
    })
}

impl<'a> Layers<'a> {
    /// Traces the centres of pixels, if they are wanted.
    pub(super) fn new(wanted: &'a [Aov], view: &View<'_>) -> Self {
        let centres = wanted.contains(&Aov::Position) || wanted.contains(&Aov::Id);
        Self {
            wanted,
            centres: centres.then(|| Centres::of(view)),
        }
    }

    /// Layers without those of pixel centres.
    pub(super) fn recorded(wanted: &'a [Aov]) -> Self {
        let centres = None;
        Self { wanted, centres }
    }

    /// The layers of a picture, in the order asked for.
    pub(super) fn of(&self, picture: &Picture) -> Vec<Layer> {
        let layer = |aov: &Aov| self.layer(*aov, picture);
        self.wanted.iter().filter_map(layer).collect()
    }

    fn layer(&self, aov: Aov, picture: &Picture) -> Option<Layer> {
        let aovs = picture.aovs.as_ref();
        let first = aovs.and_then(|a| a.first.as_ref());
        let light = aovs.and_then(|a| a.light.as_ref());
        let centres = self.centres.as_ref();
        let grey = |buffer: opsr::image::Buffer| buffer.pixels.iter().map(|p| p.x).collect();
        Some(match aov {
            Aov::Albedo => Layer::rgb("albedo", &first?.albedo()),
            Aov::Normal => Layer::xyz("normal", &first?.normal()),
            Aov::Depth => Layer::scalar("depth", grey(first?.depth())),
            Aov::Alpha => Layer {
                name: String::new(),
                channels: vec![("A", grey(first?.coverage()))],
            },
            Aov::Position => Layer::xyz("position", &centres?.position),
            Aov::Id => {
                let [mesh, material] = centres?.ids.clone();
                Layer {
                    name: "id".into(),
                    channels: vec![("mesh", mesh), ("material", material)],
                }
            }
            Aov::Emission => Layer::rgb("emission", &light?.emission()),
            Aov::Direct => Layer::rgb("direct", &light?.direct()),
            Aov::Indirect => Layer::rgb("indirect", &light?.indirect(&picture.film)),
            // Written with the other results of the levels.
            Aov::Level => return None,
            Aov::Time => Layer::scalar("time", aovs?.time.as_ref()?.seconds()),
        })
    }
}
