//! The first surfaces of a frame: at every pixel's centre, with their positions in the previous and the next frame.

use crate::glints::glint;
use opsr::image::film::Window;
use opsr::integrator::{View, centre};
use opsr::math::{Rgb, UVec2, Vec2, Vec3};
use opsr::scene::{Hit, Scene};
use rayon::prelude::*;

/// A surface at the centre of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Place in world space; not finite where there is no surface.
    pub position: Vec3,
    /// Shading normal, in 127ths.
    normal: [i8; 3],
    /// Reflectance, in 255ths.
    albedo: [u8; 3],
    /// Light of the lamps that it shows: the upper half of a single-precision number.
    glint: u16,
}

// Every frame of a window stores a point for every pixel.
const _: () = assert!(size_of::<SurfacePoint>() == 20);

impl SurfacePoint {
    const NONE: Self = Self {
        position: Vec3::INFINITY,
        normal: [0; 3],
        albedo: [0; 3],
        glint: 0,
    };

    /// A surface with a place, a unit normal and a reflectance in [0, 1].
    pub fn new(position: Vec3, normal: Vec3, albedo: Rgb) -> Self {
        Self {
            position,
            normal: (normal * 127.0).to_array().map(|x| x.round() as i8),
            albedo: (albedo * 255.0).to_array().map(|x| x.round() as u8),
            glint: 0,
        }
    }

    /// This surface with the light of the lamps that it shows.
    pub(crate) fn with_glint(self, light: f32) -> Self {
        Self {
            glint: (light.to_bits() >> 16) as u16,
            ..self
        }
    }

    /// Light of the lamps that it shows as a mirror or as smooth glass, mean of the channels.
    pub(crate) fn glint(&self) -> f32 {
        f32::from_bits(u32::from(self.glint) << 16)
    }

    /// Squared logarithm of the ratio of two surfaces' glints, with `dark` added to both.
    pub(crate) fn contrast(&self, other: &Self, dark: f32) -> f32 {
        match self.glint == other.glint {
            true => 0.0,
            false => ((self.glint() + dark) / (other.glint() + dark))
                .ln()
                .powi(2),
        }
    }

    /// True if there is a surface.
    pub fn is_some(&self) -> bool {
        self.position.is_finite()
    }

    /// Squared distances between the normals and the reflectances of two surfaces.
    pub(crate) fn difference(&self, other: &Self) -> (f32, f32) {
        let square = |a: f32, b: f32, unit: f32| ((a - b) / unit).powi(2);
        let normals = self.normal.iter().zip(&other.normal);
        let albedos = self.albedo.iter().zip(&other.albedo);
        (
            normals
                .map(|(a, b)| square((*a).into(), (*b).into(), 127.0))
                .sum(),
            albedos
                .map(|(a, b)| square((*a).into(), (*b).into(), 255.0))
                .sum(),
        )
    }
}

/// The surfaces of a frame, pixel by pixel.
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    /// The surfaces.
    pub points: Vec<SurfacePoint>,
    /// Positions in the previous frame, in world space; `None` where nothing moves.
    pub before: Option<Vec<Vec3>>,
    /// Positions in the next frame, in world space; `None` where nothing moves.
    pub after: Option<Vec<Vec3>>,
}

/// Pixels of a window, rows one after another.
fn pixels<T: Send>(window: Window, f: impl Fn(u32, u32) -> T + Sync) -> Vec<T> {
    let rows = (0..window.h).into_par_iter();
    rows.flat_map_iter(|y| {
        let f = &f;
        (0..window.w).map(move |x| f(window.x + x, window.y + y))
    })
    .collect()
}

impl Surfaces {
    /// Traces the centre of every pixel of a view, and the lamps that it shows. Returns the hits, too, for [`places`].
    pub fn of(view: &View<'_>) -> (Self, Vec<Option<Hit>>) {
        let scene = view.scene;
        let met = pixels(view.window, |x, y| match centre(view, UVec2::new(x, y)) {
            Some((hit, mut surface)) => {
                let shown = glint(view, Vec2::new(x as f32, y as f32), &surface);
                let albedo = scene.bsdf(&mut surface, 0.5).reflectance();
                let albedo = albedo.clamp(Rgb::ZERO, Rgb::ONE);
                let point = SurfacePoint::new(surface.position, surface.ns, albedo);
                (point.with_glint(shown), Some(hit))
            }
            None => (SurfacePoint::NONE, None),
        });
        let (points, hits) = met.into_iter().unzip();
        let own = Self {
            points,
            before: None,
            after: None,
        };
        (own, hits)
    }
}

/// Positions in scene `other` of hits in `scene`, one file at two moments, by triangle and barycentric weights. Not
/// finite without a hit or where the triangle is another one in `other`; `None` if nothing has moved.
pub fn places(hits: &[Option<Hit>], scene: &Scene, other: &Scene) -> Option<Vec<Vec3>> {
    let (own, there) = (scene.geometry(), other.geometry());
    let alike = own.triangle_count() == there.triangle_count();
    let place = |hit: &Option<Hit>| {
        let Some(hit) = hit else {
            return (true, Vec3::INFINITY);
        };
        let i = hit.triangle;
        if !alike
            || own.triangle_mesh(i) != there.triangle_mesh(i)
            || own.triangle_material(i) != there.triangle_material(i)
        {
            return (false, Vec3::INFINITY);
        }
        let corners = there.triangle(i);
        let [a, b, c] = corners;
        let place = a + hit.u * (b - a) + hit.v * (c - a);
        (own.triangle(i) == corners, place)
    };
    let placed: Vec<(bool, Vec3)> = hits.par_iter().map(place).collect();
    let moved = placed.iter().any(|(still, _)| !still);
    moved.then(|| placed.into_iter().map(|(_, place)| place).collect())
}
