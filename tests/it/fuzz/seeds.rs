//! Small valid files of every format.

use crate::support::gltf::File;
use crate::support::root;
use ::exr::prelude as exrs;
use exrs::WritableImage;
use exrs::{AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, LineOrder};
use image::codecs::hdr::HdrEncoder;
use opsr::image::film::{Film, Window};
use opsr::image::{Buffer, exr, png};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::file::{Provenance, TableFile};
use opsr::regularise::{AttenuationTable, LEN, Lookup};
use opsr::scene::SceneParts;
use opsr_lab::gallery::{self, glb};
use opsr_lab::report::bench::results::Inset;
use std::path::Path;

/// Bytes of the file that `write` writes under a name.
fn bytes(name: &str, write: impl FnOnce(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    write(&path);
    std::fs::read(path).expect("a file")
}

pub(crate) fn gltf() -> Vec<Vec<u8>> {
    let good = crate::load::broken::good();
    let mut glass = SceneParts::default();
    glass.add(
        opsr_lab::gallery::materials::glass("glass", 1.5, 0.1),
        [opsr_lab::gallery::shapes::sphere(Vec3::ONE, 1.0, 0)],
    );
    let saved = [
        gallery::area_light_over_plane(),
        crate::support::scenes::two_mirrors(0.9, 0.01),
        glass,
    ];
    // Each scene as text and as binary.
    let mut files = vec![good.gltf(), good.glb()];
    for parts in saved {
        let glb = glb::to_glb(&parts).expect("a scene");
        files.push(File::from_glb(&glb).gltf());
        files.push(glb);
    }
    files
}

/// A cropped film with two to four samples per pixel.
pub(crate) fn film() -> Film {
    let window = Window {
        x: 2,
        y: 1,
        w: 9,
        h: 7,
    };
    let mut film = Film::cropped(UVec2::new(12, 10), window).expect("inside");
    for i in 0..film.pixels.len() {
        for s in 0..2 + i as u32 % 3 {
            film.push(i, Rgb::new(0.1, 0.5, 2.0) * (1 + s) as f32, s);
        }
    }
    film
}

fn picture() -> Buffer {
    Buffer::from_fn(9, 7, |x, y| Rgb::new(x as f32, y as f32, 0.25))
}

/// An EXR file as other programs write it, with half, float and integer channels.
pub(crate) fn foreign(compression: Compression, blocks: Blocks) -> Vec<u8> {
    let ramp: Vec<f32> = (0..63).map(|i| i as f32 / 8.0).collect();
    let halves = ramp.iter().map(|&x| exrs::f16::from_f32(x)).collect();
    let channels = [
        AnyChannel::new("R", FlatSamples::F16(halves)),
        AnyChannel::new("G", FlatSamples::F32(ramp.clone())),
        AnyChannel::new("B", FlatSamples::F32(ramp)),
        AnyChannel::new("id", FlatSamples::U32((0..63).collect())),
    ];
    let encoding = Encoding {
        compression,
        blocks,
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let layer = exrs::Layer::new((9, 7), exrs::LayerAttributes::default(), encoding, channels);
    let mut out = std::io::Cursor::new(Vec::new());
    let image = exrs::Image::from_layer(layer);
    image.write().to_buffered(&mut out).expect("a picture");
    out.into_inner()
}

pub(crate) fn exr() -> Vec<Vec<u8>> {
    let metadata = [("scene".to_owned(), "a.glb".to_owned())].into();
    let depth = exr::Layer {
        name: "depth".to_owned(),
        channels: vec![("", vec![1.5; 63])],
    };
    let tiles = Blocks::Tiles(exrs::Vec2(4, 4));
    vec![
        bytes("a.exr", |p| {
            exr::write_film(p, &film(), &[depth], &metadata).expect("written")
        }),
        bytes("a.exr", |p| {
            exr::write_rgb(p, &picture(), &metadata).expect("written")
        }),
        foreign(Compression::Uncompressed, Blocks::ScanLines),
        foreign(Compression::Uncompressed, tiles),
        foreign(Compression::RLE, tiles),
        foreign(Compression::ZIP1, Blocks::ScanLines),
        foreign(Compression::PIZ, Blocks::ScanLines),
        foreign(Compression::PXR24, tiles),
        foreign(Compression::B44, Blocks::ScanLines),
        foreign(Compression::B44A, tiles),
    ]
}

pub(crate) fn hdr() -> Vec<Vec<u8>> {
    let encoded = |w: usize, h: usize| {
        let pixels: Vec<_> = (0..w * h)
            .map(|i| image::Rgb([0.5, (i % 7) as f32, 900.0]))
            .collect();
        let mut out = Vec::new();
        HdrEncoder::new(&mut out)
            .encode(&pixels, w, h)
            .expect("a map");
        out
    };
    // Old run-length encoding: a texel, and a run that repeats it eleven times.
    let mut old_rle = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 12\n".to_vec();
    old_rle.extend([9, 8, 7, 128, 1, 1, 1, 11].repeat(2));
    vec![encoded(16, 8), encoded(5, 3), old_rle]
}

pub(crate) fn png() -> Vec<Vec<u8>> {
    let own = bytes("a.png", |p| {
        png::write(p, &picture(), 0.0).expect("written")
    });
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let grey = image::RgbImage::from_pixel(9, 9, image::Rgb([99; 3]));
    grey.write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .expect("a picture");
    let wide = image::ImageBuffer::from_pixel(3, 2, image::LumaA([0x1234u16, 7]));
    let wide = crate::support::gltf::png(&wide.into());
    vec![own, wide, jpeg.into_inner()]
}

/// Texture images: RGBA, grey and RGB, eight and sixteen bits, PNG and JPEG.
pub(crate) fn textures() -> Vec<Vec<u8>> {
    use crate::support::gltf::png;
    let at = |x: u32, y: u32| [(x * 90) as u8, (y * 70) as u8, 9, 200];
    let colours = image::RgbaImage::from_fn(3, 2, |x, y| image::Rgba(at(x, y)));
    let grey = image::GrayImage::from_fn(5, 3, |x, y| image::Luma([at(x, y)[0]]));
    let wide = image::ImageBuffer::from_fn(2, 2, |x, _| image::Rgb([x as u16 * 999, 7, 65535]));
    let jpeg = |picture: image::DynamicImage| {
        let mut out = std::io::Cursor::new(Vec::new());
        let format = image::ImageFormat::Jpeg;
        picture.write_to(&mut out, format).expect("a picture");
        out.into_inner()
    };
    let opaque = image::DynamicImage::from(colours.clone()).into_rgb8();
    vec![
        png(&colours.into()),
        png(&grey.clone().into()),
        png(&wide.into()),
        jpeg(opaque.into()),
        jpeg(grey.into()),
    ]
}

/// Results of a small bench, with and without pictures.
pub(crate) fn results() -> Vec<Vec<u8>> {
    use crate::bench::planted::{Planted, planted, recorded};
    let bright = Planted {
        energy: 1.02,
        ..planted("bright", 0.05, 4e-4)
    };
    let mut all = recorded(&[planted("plain", 0.1, 0.0), bright], 3);
    for inset in &mut all.insets {
        inset.pixels = Inset::encode(&Buffer::filled(4, 3, Rgb::splat(0.5)));
        inset.width = 4;
    }
    let mut bare = all.clone();
    bare.insets.clear();
    bare.products.clear();
    bare.cells.truncate(2);
    let json = |r| serde_json::to_vec(&r).expect("finite");
    vec![json(all), json(bare)]
}

/// Made-up provenance of a table.
pub(crate) fn provenance() -> Provenance {
    Provenance {
        opsr: "0.1.0".into(),
        loss: "MAPE + beta Var, \"visits\": []".into(),
        beta: 0.001,
        spp: 1024,
        model: "full".into(),
        optimiser: "Adam".into(),
        method: "replay".into(),
        steps: 10_000,
        seed: u64::MAX,
        scenes: vec![("box".into(), "00ff".into())],
        start: 0.5,
        visits: (0..LEN as u64).collect(),
    }
}

/// A table whose factors all differ, with 0, the smallest positive number and 1 among them.
pub(crate) fn table() -> TableFile {
    let mut table = AttenuationTable::constant(0.0);
    for (i, gamma) in table.gammas.iter_mut().enumerate() {
        *gamma = (i as f32 / (LEN - 1) as f32).powf(1.7);
    }
    table.gammas[1] = f32::from_bits(1);
    table.lookup = Lookup::Linear;
    table.scale = 0.7;
    let provenance = Some(provenance());
    TableFile { table, provenance }
}

pub(crate) fn tables() -> Vec<Vec<u8>> {
    let plain = TableFile {
        table: AttenuationTable::constant(0.5),
        provenance: None,
    };
    [plain, table()]
        .map(|t| t.to_json().expect("finite").into_bytes())
        .into()
}

pub(crate) fn manifests() -> Vec<Vec<u8>> {
    let committed = root().join("training_scenes/manifest.toml");
    vec![std::fs::read(committed).expect("a manifest")]
}

pub(crate) fn suites() -> Vec<Vec<u8>> {
    let suite = r#"baseline = "plain"
seeds = 5
times = [0.5, 1, 2.5]
samples = [1, 4, 16]
clock = "cpu"

[[scene]]
name = "box"
builtin = "caustic-box"
size = [128, 96]
crop = [0, 0, 32, 32]
inset = [1, 2, 3, 4]
max_vertices = 8
exposure = -1.5
reference_spp = 16384
methods = ["plain", "few"]

[[scene]]
name = "file"
file = "a.glb"
reference = "a.exr"
size = [64, 64]
distribution = "ggx"
camera = "1"

[[method]]
name = "plain"

[[method]]
name = "few"
table = 0.1
mode = "reuse"
consistent = 0.2

[[method]]
name = "learned"
table = "t.json"
table_scale = 0.5
lookup = "linear"
"#;
    vec![suite.into()]
}
