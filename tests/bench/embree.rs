//! Embree 4 through its C interface, loaded at run time: the baseline of the traversal benchmark.
#![allow(unsafe_code)]

use super::{Bench, any, closest};
use libloading::{Library, Symbol};
use opsr::math::Ray;
use opsr::scene::accel::Accel;
use std::ffi::{c_char, c_uint, c_void};
use std::ptr::null;

type Handle = *mut c_void;

#[repr(C, align(16))]
struct RayHit {
    origin: [f32; 3],
    t_near: f32,
    dir: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id_flags: [u32; 2],
    /// Normal, u, v, primitive, geometry, instances, padded.
    hit: [u32; 12],
}

impl RayHit {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_near: 0.0,
            dir: ray.dir.to_array(),
            time: 0.0,
            t_far: ray.t_max,
            mask: u32::MAX,
            id_flags: [0; 2],
            hit: [u32::MAX; 12],
        }
    }
}

struct Embree<'a> {
    scene: Handle,
    intersect: Symbol<'a, unsafe extern "C" fn(Handle, *mut RayHit, *const c_void)>,
    occluded: Symbol<'a, unsafe extern "C" fn(Handle, *mut RayHit, *const c_void)>,
}

impl<'a> Embree<'a> {
    /// # Safety
    /// `lib` must be Embree 4.
    unsafe fn new(
        lib: &'a Library,
        bench: &Bench,
        robust: bool,
    ) -> Result<Self, libloading::Error> {
        type One = unsafe extern "C" fn(Handle);
        type Make = unsafe extern "C" fn(Handle) -> Handle;
        type Buffer =
            unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void;
        // SAFETY: signatures as in rtcore_*.h; buffers are filled within the size asked for.
        unsafe {
            let device = lib
                .get::<unsafe extern "C" fn(*const c_char) -> Handle>(b"rtcNewDevice")?(
                c"threads=1".as_ptr(),
            );
            let scene = lib.get::<Make>(b"rtcNewScene")?(device);
            if robust {
                lib.get::<unsafe extern "C" fn(Handle, c_uint)>(b"rtcSetSceneFlags")?(scene, 4);
            }
            let geometry = lib
                .get::<unsafe extern "C" fn(Handle, c_uint) -> Handle>(b"rtcNewGeometry")?(
                device, 0,
            );
            let buffer = lib.get::<Buffer>(b"rtcSetNewGeometryBuffer")?;
            let indices = buffer(geometry, 0, 0, 0x5003, 12, bench.indices.len());
            null_check(indices);
            indices
                .copy_from_nonoverlapping(bench.indices.as_ptr().cast(), 12 * bench.indices.len());
            let vertices = buffer(geometry, 1, 0, 0x9003, 12, bench.positions.len());
            null_check(vertices);
            vertices.copy_from_nonoverlapping(
                bench.positions.as_ptr().cast(),
                12 * bench.positions.len(),
            );
            lib.get::<One>(b"rtcCommitGeometry")?(geometry);
            lib.get::<unsafe extern "C" fn(Handle, Handle) -> c_uint>(b"rtcAttachGeometry")?(
                scene, geometry,
            );
            lib.get::<One>(b"rtcCommitScene")?(scene);
            Ok(Self {
                scene,
                intersect: lib.get(b"rtcIntersect1")?,
                occluded: lib.get(b"rtcOccluded1")?,
            })
        }
    }

    fn closest(&self, rays: &[Ray]) -> usize {
        let hits = rays.iter().filter(|ray| {
            let mut r = RayHit::new(ray);
            // SAFETY: the scene is committed and lives on.
            unsafe { (self.intersect)(self.scene, &raw mut r, null()) };
            r.hit[6] != u32::MAX
        });
        hits.count()
    }

    fn any(&self, rays: &[Ray]) -> usize {
        let hits = rays.iter().filter(|ray| {
            let mut r = RayHit::new(ray);
            // SAFETY: as above; the hit part is not touched.
            unsafe { (self.occluded)(self.scene, &raw mut r, null()) };
            r.t_far < 0.0
        });
        hits.count()
    }
}

fn null_check(p: *mut c_void) {
    assert!(!p.is_null(), "Embree gave no buffer");
}

/// CPU seconds of this thread.
fn cpu_seconds() -> f64 {
    seconds(libc::CLOCK_THREAD_CPUTIME_ID)
}

fn seconds(clock: libc::clockid_t) -> f64 {
    let mut t = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: writes to `t` only.
    unsafe { libc::clock_gettime(clock, &raw mut t) };
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

/// Runs the candidates in turns and prints the best of `rounds` of each in Mrays/s, the hits, and the ratio to the first.
fn race(name: &str, rays: usize, rounds: usize, runners: &[(&str, &dyn Fn() -> usize)]) {
    let mut best = vec![(f64::INFINITY, 0); runners.len()];
    for _ in 0..rounds {
        for (b, (_, run)) in best.iter_mut().zip(runners) {
            let start = cpu_seconds();
            b.1 = run();
            b.0 = b.0.min(cpu_seconds() - start);
        }
    }
    for (b, (who, _)) in best.iter().zip(runners) {
        let (rate, share) = (rays as f64 / b.0 / 1e6, best[0].0 / b.0);
        println!(
            "{name:>10} {who:>15}: {rate:6.2} Mrays/s, {:7} hits, {share:.2} of Embree",
            b.1
        );
    }
}

/// Never unloaded: its threads stay.
fn library(path: &str) -> &'static Library {
    // SAFETY: the user says that this is Embree 4.
    let loaded = unsafe { Library::new(path) };
    Box::leak(Box::new(loaded.expect("OPSR_EMBREE must name a library")))
}

/// Prints rates of Embree (default and robust) and of this crate's two traversals.
pub(crate) fn compare(path: &str, bench: &Bench, rounds: usize) {
    let triangles = bench.triangles();
    // Of all threads.
    let process = || seconds(libc::CLOCK_PROCESS_CPUTIME_ID);
    let lib = library(path);
    // SAFETY: the user says that this is Embree 4.
    let embree = unsafe { Embree::new(lib, bench, false) }.expect("an Embree 4 library");
    let start = process();
    // SAFETY: as above.
    let robust = unsafe { Embree::new(lib, bench, true) }.expect("an Embree 4 library");
    let between = process();
    let fast = Accel::new(&triangles);
    println!(
        "build, CPU seconds: {:.2}; Embree robust, with the copy of the mesh: {:.2}",
        process() - between,
        between - start
    );
    let portable = Accel::portable(&triangles);
    for (name, rays) in [
        ("coherent", &bench.coherent),
        ("incoherent", &bench.incoherent),
    ] {
        race(
            name,
            rays.len(),
            rounds,
            &[
                ("Embree", &|| embree.closest(rays)),
                ("Embree robust", &|| robust.closest(rays)),
                ("fast", &|| closest(&fast, rays)),
                ("portable", &|| closest(&portable, rays)),
            ],
        );
    }
    let rays = &bench.segments;
    race(
        "any hit",
        rays.len(),
        rounds,
        &[
            ("Embree", &|| embree.any(rays)),
            ("Embree robust", &|| robust.any(rays)),
            ("fast", &|| any(&fast, rays)),
            ("portable", &|| any(&portable, rays)),
        ],
    );
}
