//! Light of a scene's own surfaces and of surroundings at points that its camera sees, estimated with at most 1024
//! paths. It decides if emissive surfaces are lamps or decoration.

use super::{Camera, Environment, LightSample, Scene, Surface};
use crate::math::{Frame, Ray, Rgb, UVec2, Vec2, Vec3, luminance, warp};
use crate::sampler::{Independent, LightU, SampleSource, Sampler, Seed};

/// Number of film positions along each side of the picture whose rays find the points.
const GRID: u32 = 16;

/// Number of paths from each point.
const PATHS: u32 = 4;

/// Largest number of diffuse surfaces on a path.
const BOUNCES: u32 = 6;

/// Albedo of every surface: materials hardly change the ratio of own light to all light.
const ALBEDO: f64 = 0.5;

/// Largest number of glass surfaces through which a segment passes straight.
const PANES: u32 = 16;

/// Share of the light above which surfaces of a radiance above 1, which a file must set explicitly, are lamps.
const FAINT: f64 = 1e-4;

/// [`FAINT`] for surfaces of a radiance of at most 1 and without a texture.
const GLOW: f64 = 0.01;

/// [`FAINT`] for textures of a radiance of at most 1: screens, dials and labels give up to 0.04 of the light nearby.
const SCREEN: f64 = 0.25;

/// Least share of the points that the lamps of an open scene light: the rear lamps of a car light few.
const REACHED: f64 = 0.1;

/// Share of points that emit without a texture, above which the emission itself is the picture.
const PICTURE: f64 = 0.5;

/// Least ratio of emitted to reflected radiance at which emission is the picture: less is a tint of reflected light.
const VISIBLE: f64 = 0.25;

/// Light of a scene's surfaces and of surroundings, at the points that its camera sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lighting {
    /// Points that the camera sees and that emit nothing.
    pub points: u32,
    /// Points among them at which light of the scene's own surfaces arrives.
    pub reached: u32,
    /// Mean over the points of the irradiance by the scene's own surfaces, over π.
    pub own: f64,
    /// Mean over the points of the irradiance by the surroundings, over π.
    pub around: f64,
    /// Points that the camera sees and that emit, by a material without an emissive texture.
    pub emitting: u32,
    /// Sums over these points of the emitted radiance, and of the reflected radiance of the surroundings.
    pub emitted: f64,
    pub reflected: f64,
    /// Share of the light above which the scene's own surfaces are its lamps.
    pub least: f64,
    /// True if no path from any point leaves the scene.
    pub enclosed: bool,
}

impl Lighting {
    /// Share in [0, 1] of the light at the points that is the scene's own; 0 where none arrives.
    pub(crate) fn share(&self) -> f64 {
        let all = self.own + self.around;
        if all > 0.0 { self.own / all } else { 0.0 }
    }

    /// True if the scene's own surfaces are its lamps.
    pub(crate) fn is_lit(&self) -> bool {
        let seen = f64::from(self.points + self.emitting);
        let is_picture =
            f64::from(self.emitting) > PICTURE * seen && self.emitted >= VISIBLE * self.reflected;
        let reaches = f64::from(self.reached) >= REACHED * f64::from(self.points);
        is_picture || self.own > 0.0 && (self.enclosed || reaches && self.share() >= self.least)
    }
}

impl Scene {
    /// Estimates the light of the own surfaces of a scene without environment, and that of `around`, at points seen by
    /// its first camera or [`Scene::framing_camera`]. Paths scatter diffusely and pass straight through glass.
    pub(crate) fn lighting(&self, around: &Environment) -> Lighting {
        let camera =
            (self.parts.cameras.first().cloned()).unwrap_or_else(|| self.framing_camera(1.0));
        let emitters = (self.parts.materials.iter()).filter(|m| m.emission != Rgb::ZERO);
        let least = emitters.map(|m| match m.emission.max_element() {
            bright if bright > 1.0 => FAINT,
            _ if m.emissive_texture.is_none() => GLOW,
            _ => SCREEN,
        });
        let mut light = Lighting {
            least: least.fold(1.0, f64::min),
            enclosed: true,
            ..Lighting::default()
        };
        for y in 0..GRID {
            for x in 0..GRID {
                self.light_at(&camera, UVec2::new(x, y), around, &mut light);
            }
        }
        let points = f64::from(light.points.max(1));
        light.enclosed &= light.points > 0;
        (light.own, light.around) = (light.own / points, light.around / points);
        light
    }

    /// Adds the light at the point that the camera sees in a cell of the grid.
    fn light_at(&self, camera: &Camera, cell: UVec2, around: &Environment, light: &mut Lighting) {
        let film = (cell.as_vec2() + 0.5) / GRID as f32;
        let ray = camera.ray(film, camera.aspect.unwrap_or(1.0));
        let Some(mut first) = self.opaque(&ray, true) else {
            return;
        };
        let emitted = self.lights.emitted(&first, -ray.dir);
        let is_lamp = emitted != Rgb::ZERO;
        if is_lamp && self.material(&first).emissive_texture.is_some() {
            return;
        }
        let source = Independent { seed: Seed(0) };
        let mut sums = [0.0; 2];
        let mut leaves = false;
        for path in 0..PATHS {
            let mut stream = source.stream(cell, path);
            leaves |= self.walk(first, -ray.dir, around, &mut stream, &mut sums);
        }
        if is_lamp {
            light.emitting += 1;
            // Of the largest channel, since a blue surface of low luminance may emit more than it reflects.
            let albedo = self.bsdf(&mut first, 0.5).reflectance().max_element();
            light.emitted += f64::from(emitted.max_element());
            light.reflected += f64::from(albedo) * sums[1] / f64::from(PATHS);
            return;
        }
        light.enclosed &= !leaves;
        light.points += 1;
        light.reached += u32::from(sums[0] > 0.0);
        light.own += sums[0] / f64::from(PATHS);
        light.around += sums[1] / f64::from(PATHS);
    }

    /// Adds the light that a path from a surface finds: of the scene's own surfaces, and of the surroundings. True if
    /// the path leaves the scene.
    fn walk(
        &self,
        mut at: Surface,
        mut wo: Vec3,
        around: &Environment,
        stream: &mut impl Sampler,
        [own, surroundings]: &mut [f64; 2],
    ) -> bool {
        let mut throughput = 1.0;
        for _ in 0..BOUNCES {
            let (u, to) = (stream.vertex(), [stream.next_1d(), stream.next_1d()]);
            let n = if at.ng.dot(wo) >= 0.0 { at.ng } else { -at.ng };
            *own += throughput * self.diffuse_light(&at, n, u.light);
            let dir = Frame::from_normal(n).to_world(warp::cosine_hemisphere(Vec2::from(to)));
            let Some(next) = self.opaque(&at.spawn(dir), false) else {
                *surroundings += throughput * f64::from(luminance(around.radiance(dir)));
                return true;
            };
            throughput *= ALBEDO;
            (at, wo) = (next, -dir);
        }
        false
    }

    /// Estimate of the irradiance over π on a surface with the normal `n` by one light.
    fn diffuse_light(&self, at: &Surface, n: Vec3, u: LightU) -> f64 {
        let Some(sample) = self.lights.sample(at.position, u) else {
            return 0.0;
        };
        let cos = sample.wi.dot(n);
        if cos <= 0.0 || !self.passes(at, &sample) {
            return 0.0;
        }
        let light = f64::from(luminance(sample.radiance)) / f64::from(sample.density.value());
        light * f64::from(cos / std::f32::consts::PI)
    }

    /// True if nothing but glass stands between a surface and a light.
    fn passes(&self, at: &Surface, light: &LightSample) -> bool {
        let ray = at.spawn_to_light(light);
        !self.occluded(&ray) || self.opaque(&ray, false).is_none()
    }

    /// The first surface along a ray that is not glass; `seen` for a ray of the camera.
    fn opaque(&self, ray: &Ray, seen: bool) -> Option<Surface> {
        let mut rest = *ray;
        for _ in 0..PANES {
            let hit = match seen {
                true => self.intersect_seen(&rest)?,
                false => self.intersect(&rest)?,
            };
            let surface = self.surface(&hit);
            let material = self.material(&surface);
            let share = material.transmitted(&self.parts.textures, surface.uv);
            if share < 0.5 && !material.is_null() {
                return Some(surface);
            }
            let t_max = rest.t_max - hit.t;
            rest = surface.spawn(ray.dir);
            rest.t_max = t_max;
        }
        None
    }
}
