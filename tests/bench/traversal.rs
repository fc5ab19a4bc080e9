//! Times of rays through a displaced sphere of two million triangles, and through needles.
//!
//! With `OPSR_EMBREE` set to the path of an Embree 4 library, prints a comparison in CPU time, in alternating turns.

use clock::Contestant;
use opsr::math::{Ray, Vec3};
use opsr::scene::accel::Accel;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::hint::black_box;

mod clock;
mod embree;

/// A triangle mesh and three kinds of rays.
struct Bench {
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    /// Camera rays, in tiles of 8 x 8.
    coherent: Vec<Ray>,
    /// Rays between random points.
    incoherent: Vec<Ray>,
    /// The same rays, ending at the target: for any hit.
    segments: Vec<Ray>,
}

fn sphere(rings: u32, segments: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for i in 0..=rings {
        for j in 0..segments {
            let theta = std::f32::consts::PI * i as f32 / rings as f32;
            let phi = std::f32::consts::TAU * j as f32 / segments as f32;
            let (r, y) = theta.sin_cos();
            let d = Vec3::new(r * phi.cos(), y, r * phi.sin());
            let bump = 0.1 * (9.0 * d.x).sin() * (7.0 * d.y).cos() + 0.02 * (71.0 * d.z).sin();
            positions.push(d * (1.0 + bump));
        }
    }
    let mut indices = Vec::new();
    for i in 0..rings {
        for j in 0..segments {
            let at = |i: u32, j: u32| i * segments + j % segments;
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
            indices.extend([[a, b, d], [a, d, c]]);
        }
    }
    (positions, indices)
}

/// Long thin triangles across the cube, whose boxes are mostly empty.
fn needles(count: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut rng = Pcg32::seed_from_u64(2);
    let mut point = |s: f32| Vec3::from_array([(); 3].map(|()| s * (rng.random::<f32>() - 0.5)));
    let corners = |_| {
        let (a, b) = (point(2.0), point(2.0));
        [a, a.lerp(b, 0.5), a + point(0.02)]
    };
    let positions = (0..count).flat_map(corners).collect();
    let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (positions, indices)
}

impl Bench {
    fn new((positions, indices): (Vec<Vec3>, Vec<[u32; 3]>), count: usize) -> Self {
        let mut rng = Pcg32::seed_from_u64(1);
        let side = (count as f32).sqrt() as u32 / 8 * 8;
        let mut coherent = Vec::new();
        for tile in 0..(side / 8) * (side / 8) {
            for k in 0..64 {
                let x = (tile % (side / 8)) * 8 + k % 8;
                let y = (tile / (side / 8)) * 8 + k / 8;
                let at = |x: u32| 2.5 * (x as f32 / side as f32 - 0.5);
                let target = Vec3::new(at(x), at(y), 0.0);
                let origin = Vec3::new(0.3, 0.5, 3.0);
                coherent.push(Ray::new(origin, (target - origin).normalize()));
            }
        }
        let mut point = || Vec3::from_array([(); 3].map(|()| 2.6 * (rng.random::<f32>() - 0.5)));
        let pairs: Vec<_> = (0..count).map(|_| (point(), point())).collect();
        let toward = |&(a, b): &(Vec3, Vec3)| Ray::new(a, (b - a).normalize());
        let segment = |p: &(Vec3, Vec3)| Ray {
            t_max: (p.1 - p.0).length(),
            ..toward(p)
        };
        Self {
            coherent,
            incoherent: pairs.iter().map(toward).collect(),
            segments: pairs.iter().map(segment).collect(),
            positions,
            indices,
        }
    }

    fn triangles(&self) -> Vec<[Vec3; 3]> {
        let corner = |i: u32| self.positions[i as usize];
        self.indices.iter().map(|t| t.map(corner)).collect()
    }
}

fn closest(accel: &Accel, rays: &[Ray]) -> usize {
    rays.iter().filter(|r| accel.closest(r).is_some()).count()
}

fn any(accel: &Accel, rays: &[Ray]) -> usize {
    rays.iter().filter(|r| accel.any(r)).count()
}

/// Times of the two walks.
fn run() {
    let bench = Bench::new(sphere(700, 1400), 40_000);
    let triangles = bench.triangles();
    let accels = [
        ("fast", Accel::new(&triangles)),
        ("portable", Accel::portable(&triangles)),
    ];
    let kinds = [
        ("coherent", &bench.coherent, closest as fn(&_, &_) -> _),
        ("incoherent", &bench.incoherent, closest),
        ("any hit", &bench.segments, any),
    ];
    let mut contestants: Vec<Contestant> = Vec::new();
    for (kind, rays, walk) in kinds {
        for (name, accel) in &accels {
            let work = move || _ = black_box(walk(accel, rays));
            contestants.push((format!("{kind} {name}"), rays.len(), Box::new(work)));
        }
    }
    clock::in_turns(&contestants);
}

fn main() {
    if let Ok(path) = std::env::var("OPSR_EMBREE") {
        let sphere = Bench::new(sphere(700, 1400), 150_000);
        let needles = Bench::new(needles(50_000), 10_000);
        for (name, bench) in [("sphere", sphere), ("needles", needles)] {
            println!("{name}");
            embree::compare(&path, &bench, 4);
        }
        return;
    }
    run();
}
