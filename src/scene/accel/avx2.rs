//! The traversal with AVX2 and FMA. Only this module and `image::denoise` have unsafe code.
//!
//! Safety rests on four facts, each local to this folder:
//! - The kernel needs AVX2 and FMA: [`Avx2`] is only made by [`Avx2::detect`], which tests the processor.
//! - Node and block indices are in range: [`Wide`] is only made by its builder, is never changed afterwards, and refers
//!   only to nodes and blocks it has pushed itself.
//! - Loads are aligned and in bounds: [`Node`] and [`Block`] are `repr(C)` with alignment 256 and 32 and every row is
//!   32 or 16 bytes long; axis and side are at most 2 and 1.
//! - The stack suffices: a node pushes at most seven children beyond the one that is entered, and the builder measured
//!   the tree's depth (`Wide::stack`).
#![allow(unsafe_code)]

use super::InstanceHits;
use super::portable::{SLACK, closer, reciprocal};
use super::triangle::{Shear, TreeRay};
use super::wide::{Block, LANES, LEAF, Node, WIDTH, Wide, leaf_blocks};
use crate::math::Ray;
use crate::scene::Hit;
use std::arch::x86_64::*;
use std::mem::MaybeUninit;
use std::ops::ControlFlow;

/// Stack entries that fit on the machine stack; deeper trees use the heap.
const STACK: usize = 256;

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy)]
pub(super) struct Avx2(());

impl Avx2 {
    /// `None` if the processor does not support both.
    pub(super) fn detect() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Self(()))
    }

    /// See [`super::portable::find_hit`].
    #[inline]
    pub(super) fn find_hit<const ANY: bool>(
        self,
        tree: &Wide,
        probe: &impl TreeRay,
        keep: impl Fn(&Hit) -> bool,
        enter: impl InstanceHits,
    ) -> Option<Hit> {
        if tree.nodes.is_empty() {
            return None;
        }
        if tree.stack <= STACK {
            let mut stack = [MaybeUninit::uninit(); STACK];
            // SAFETY: `self` proves the features; the stack is long enough.
            unsafe { find_hit::<ANY, _>(tree, probe, &mut stack, keep, enter) }
        } else {
            let mut stack = vec![MaybeUninit::uninit(); tree.stack];
            // SAFETY: as above.
            unsafe { find_hit::<ANY, _>(tree, probe, &mut stack, keep, enter) }
        }
    }
}

/// An empty list of this capacity in memory for which the kernel is advised to use huge pages: incoherent rays spend
/// much of their time on address translation.
pub(super) fn huge_list<T>(capacity: usize) -> Vec<T> {
    const PAGE: usize = 4096;
    let list = Vec::<T>::with_capacity(capacity);
    let size = capacity * size_of::<T>();
    if cfg!(target_os = "linux") && size >= 2 << 20 {
        let start = (list.as_ptr() as usize).next_multiple_of(PAGE);
        let end = (list.as_ptr() as usize + size) / PAGE * PAGE;
        #[cfg(target_os = "linux")]
        // SAFETY: whole pages inside the list's allocation; the advice changes no content.
        unsafe {
            libc::madvise(start as *mut libc::c_void, end - start, libc::MADV_HUGEPAGE)
        };
    }
    list
}

/// Prefetches an item that will soon be read.
#[inline(always)]
pub(super) fn prefetch_item<T>(item: &T) {
    let start = std::ptr::from_ref(item).cast::<i8>();
    for line in (0..size_of::<T>()).step_by(64) {
        // SAFETY: every x86_64 processor has SSE, and a prefetch reads nothing.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line)) };
    }
}

/// The slabs of a ray: near and far plane of every axis as `plane * scale - offset`.
struct Slabs {
    /// Rows of [`Node::planes`] that are near and far.
    near: [usize; 3],
    far: [usize; 3],
    near_scale: [__m256; 3],
    far_scale: [__m256; 3],
    near_offset: [__m256; 3],
    far_offset: [__m256; 3],
}

impl Slabs {
    /// All rounding goes outwards: the offsets absorb the error of the product origin · scale, one unit in its last
    /// place, and the scales absorb the relative rest. The test itself then costs one fused operation per plane and
    /// never misses a box.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn new(ray: &Ray) -> Self {
        let inv = reciprocal(ray.dir);
        let back = |axis: usize| usize::from(inv[axis] < 0.0);
        let near = |axis: usize| inv[axis] * (1.0 - SLACK);
        let far = |axis: usize| inv[axis] * (1.0 + SLACK);
        let near_offset = |axis: usize| {
            let x = ray.origin[axis] * near(axis);
            x + SLACK * x.abs()
        };
        let far_offset = |axis: usize| {
            let x = ray.origin[axis] * far(axis);
            x - SLACK * x.abs()
        };
        let splat = |f: &dyn Fn(usize) -> f32| [0, 1, 2].map(|a| _mm256_set1_ps(f(a)));
        Self {
            near: [0, 1, 2].map(|a| 2 * a + back(a)),
            far: [0, 1, 2].map(|a| 2 * a + 1 - back(a)),
            near_scale: splat(&near),
            far_scale: splat(&far),
            near_offset: splat(&near_offset),
            far_offset: splat(&far_offset),
        }
    }

    /// Entry distances of the eight boxes, and the mask of those that the ray hits before `t_max`.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn test(&self, node: &Node, t_max: __m256) -> (__m256, u32) {
        let plane = |row: usize, scale, offset| {
            debug_assert!(row < 6);
            // SAFETY: `row` is below 6 by construction; rows are 32 bytes and aligned to that.
            let p = unsafe { _mm256_load_ps(node.planes.as_ptr().add(row).cast()) };
            _mm256_fmsub_ps(p, scale, offset)
        };
        let near = |a: usize| plane(self.near[a], self.near_scale[a], self.near_offset[a]);
        let far = |a: usize| plane(self.far[a], self.far_scale[a], self.far_offset[a]);
        let enter = _mm256_max_ps(
            _mm256_max_ps(near(0), near(1)),
            // Zero last: the sorting key must not be −0.
            _mm256_max_ps(near(2), _mm256_setzero_ps()),
        );
        let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), _mm256_min_ps(far(2), t_max));
        let met = _mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave);
        (enter, _mm256_movemask_ps(met) as u32)
    }
}

/// The test of [`super::triangle::intersect`] for four triangles, with the same operations in the same order.
struct Quad {
    axes: [usize; 3],
    origin: [__m128; 3],
    slope: [__m128; 2],
}

/// Distances and weights of four triangles.
#[derive(Default)]
#[repr(C, align(16))]
struct Found {
    t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Found {
    #[inline(always)]
    fn hit(&self, block: &Block, probe: &impl TreeRay, lane: usize) -> Hit {
        Hit {
            t: self.t[lane],
            triangle: probe.triangle(block.ids[lane]),
            u: self.u[lane],
            v: self.v[lane],
        }
    }
}

/// The four values of a corner's coordinate.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn load(block: &Block, corner: usize, axis: usize) -> __m128 {
    debug_assert!(corner < 3 && axis < 3);
    let rows = block.corners.as_ptr().cast::<f32>();
    // SAFETY: corner and axis are below 3; rows are 16 bytes and aligned to that.
    unsafe { _mm_load_ps(rows.add((3 * corner + axis) * LANES)) }
}

impl Quad {
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn new(ray: &Ray) -> Self {
        let shear = Shear::new(ray.dir);
        Self {
            axes: shear.axes,
            origin: shear.axes.map(|a| _mm_set1_ps(ray.origin[a])),
            slope: shear.slope.map(|s| _mm_set1_ps(s)),
        }
    }

    /// Mask of the triangles hit with 0 < t <= `t_max`; fills `found` if there are any.
    #[target_feature(enable = "avx2,fma")]
    #[inline]
    fn test(&self, block: &Block, probe: &impl TreeRay, t_max: f32, found: &mut Found) -> u32 {
        let map = |k: usize| {
            let at = |i: usize| _mm_sub_ps(load(block, k, self.axes[i]), self.origin[i]);
            let z = at(2);
            (
                _mm_sub_ps(at(0), _mm_mul_ps(self.slope[0], z)),
                _mm_sub_ps(at(1), _mm_mul_ps(self.slope[1], z)),
            )
        };
        let ((ax, ay), (bx, by), (cx, cy)) = (map(0), map(1), map(2));
        let u = _mm_sub_ps(_mm_mul_ps(cx, by), _mm_mul_ps(cy, bx));
        let v = _mm_sub_ps(_mm_mul_ps(ax, cy), _mm_mul_ps(ay, cx));
        let w = _mm_sub_ps(_mm_mul_ps(bx, ay), _mm_mul_ps(by, ax));
        let zero = _mm_setzero_ps();
        let front = _mm_cmpge_ps(_mm_min_ps(_mm_min_ps(u, v), w), zero);
        let back = _mm_cmple_ps(_mm_max_ps(_mm_max_ps(u, v), w), zero);
        let sum = _mm_add_ps(_mm_add_ps(u, v), w);
        let inside = _mm_and_ps(_mm_or_ps(front, back), _mm_cmpneq_ps(sum, zero));
        if _mm_movemask_ps(inside) == 0 {
            return 0;
        }
        let t = distances(block, probe);
        let ahead = _mm_and_ps(_mm_cmpgt_ps(t, zero), _mm_cmple_ps(t, _mm_set1_ps(t_max)));
        let mask = _mm_movemask_ps(_mm_and_ps(inside, ahead)) as u32;
        if mask != 0 {
            let r = _mm_div_ps(_mm_set1_ps(1.0), sum);
            // SAFETY: each row of `found` is 16 bytes and aligned to that.
            unsafe {
                _mm_store_ps(found.t.as_mut_ptr(), t);
                _mm_store_ps(found.u.as_mut_ptr(), _mm_mul_ps(v, r));
                _mm_store_ps(found.v.as_mut_ptr(), _mm_mul_ps(w, r));
            }
        }
        mask
    }
}

/// Distances to the planes of four triangles, in double precision; not fused, as in plain Rust.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn distances(block: &Block, probe: &impl TreeRay) -> __m128 {
    let point = |k: usize| [0, 1, 2].map(|axis| _mm256_cvtps_pd(load(block, k, axis)));
    let minus = |p: [__m256d; 3], q: [__m256d; 3]| [0, 1, 2].map(|i| _mm256_sub_pd(p[i], q[i]));
    let splat = |p: crate::math::DVec3| p.to_array().map(|x| _mm256_set1_pd(x));
    let (origin, dir) = probe.exact();
    let a = point(0);
    let (e, f) = (minus(point(1), a), minus(point(2), a));
    let n = [(1, 2), (2, 0), (0, 1)]
        .map(|(i, j)| _mm256_sub_pd(_mm256_mul_pd(e[i], f[j]), _mm256_mul_pd(e[j], f[i])));
    let along = |d: [__m256d; 3]| {
        let xy = _mm256_add_pd(_mm256_mul_pd(n[0], d[0]), _mm256_mul_pd(n[1], d[1]));
        _mm256_add_pd(xy, _mm256_mul_pd(n[2], d[2]))
    };
    let above = along(minus(a, splat(origin)));
    _mm256_cvtpd_ps(_mm256_div_pd(above, along(splat(dir))))
}

/// A child and its distance in one sortable word; distances are not negative, so their bits sort as they do.
#[inline(always)]
fn entry(near: f32, child: u32) -> u64 {
    u64::from(near.to_bits()) << 32 | u64::from(child)
}

/// Prefetches the first cache lines of a child.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn prefetch(tree: &Wide, child: u32) {
    let (base, lines) = if child & LEAF == 0 {
        (
            tree.nodes
                .as_ptr()
                .wrapping_add(child as usize)
                .cast::<i8>(),
            4,
        )
    } else {
        let first = leaf_blocks(child).start;
        (tree.blocks.as_ptr().wrapping_add(first).cast::<i8>(), 3)
    };
    for line in 0..lines {
        _mm_prefetch::<_MM_HINT_T0>(base.wrapping_add(64 * line));
    }
}

/// Pushes the children in `mask` except the nearest, which it returns.
///
/// # Safety
/// `stack` must have room above `top` for as many as `mask` has bits.
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn descend<const ANY: bool>(
    tree: &Wide,
    node: &Node,
    enter: __m256,
    mut mask: u32,
    stack: *mut u64,
    top: &mut usize,
) -> u32 {
    let mut near = Row([0.0; WIDTH]);
    // SAFETY: 32 bytes, aligned to that.
    unsafe { _mm256_store_ps(near.0.as_mut_ptr(), enter) };
    let mut next = || {
        let k = mask.trailing_zeros() as usize % WIDTH;
        mask &= mask.wrapping_sub(1);
        prefetch(tree, node.children[k]);
        (entry(near.0[k], node.children[k]), mask != 0)
    };
    let base = *top;
    let (mut nearest, mut more) = next();
    while more {
        let e;
        (e, more) = next();
        let far = e.max(nearest);
        nearest = e.min(nearest);
        let mut at = *top;
        // SAFETY: everything from `base` to `top` has been written, and there is room for one more.
        unsafe {
            // Sorted with the nearest on top; for shadow rays the order does not matter.
            while !ANY && at > base && stack.add(at - 1).read() < far {
                stack.add(at).write(stack.add(at - 1).read());
                at -= 1;
            }
            stack.add(at).write(far);
        }
        *top += 1;
    }
    nearest as u32
}

/// Eight floats, aligned for a register.
#[repr(C, align(32))]
struct Row([f32; WIDTH]);

/// # Safety
/// The processor must have AVX2 and FMA, and `stack` must hold `tree.stack` entries.
#[target_feature(enable = "avx2,fma")]
unsafe fn find_hit<const ANY: bool, E: InstanceHits>(
    tree: &Wide,
    probe: &impl TreeRay,
    stack: &mut [MaybeUninit<u64>],
    keep: impl Fn(&Hit) -> bool,
    enter: E,
) -> Option<Hit> {
    let ray = probe.ray();
    let quad = Quad::new(ray);
    let mut best = probe.best();
    let start = best.t;
    let mut any = false;
    let mut found = Found::default();
    let visit = |block: &Block, t_max: f32| {
        if E::SOME
            && let Some(instance) = block.instance()
        {
            if let Some(hit) = enter.hit(instance, &best) {
                best = hit;
                any = true;
                if ANY {
                    return ControlFlow::Break(());
                }
            }
            return ControlFlow::Continue(best.t);
        }
        let mut mask = quad.test(block, probe, t_max, &mut found);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % LANES;
            let hit = found.hit(block, probe, lane);
            mask &= mask - 1;
            if closer(&hit, &best) && keep(&hit) {
                best = hit;
                any = true;
                if ANY {
                    return ControlFlow::Break(());
                }
            }
        }
        ControlFlow::Continue(best.t)
    };
    // SAFETY: as required of the caller.
    unsafe { traverse::<ANY>(tree, ray, start, stack, visit) };
    any.then_some(best)
}

/// # Safety
/// The processor must have AVX2 and FMA; the tree must have nodes, and `stack` hold `tree.stack` entries.
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn traverse<const ANY: bool>(
    tree: &Wide,
    ray: &Ray,
    mut t_max: f32,
    stack: &mut [MaybeUninit<u64>],
    mut visit: impl FnMut(&Block, f32) -> ControlFlow<(), f32>,
) {
    debug_assert!(stack.len() >= tree.stack);
    let stack = stack.as_mut_ptr().cast::<u64>();
    let slabs = Slabs::new(ray);
    let (mut top, mut current) = (0usize, 0u32);
    loop {
        // ── boxes, down to a leaf or to nothing
        let mut miss = false;
        while current & LEAF == 0 && !miss {
            // SAFETY: an index the builder made.
            let node = unsafe { tree.nodes.get_unchecked(current as usize) };
            let (enter, mask) = slabs.test(node, _mm256_set1_ps(t_max));
            if mask.is_power_of_two() {
                current = node.children[mask.trailing_zeros() as usize % WIDTH];
            } else if mask != 0 {
                // SAFETY: the builder measured how much room the deepest path needs.
                current = unsafe { descend::<ANY>(tree, node, enter, mask, stack, &mut top) };
            } else {
                miss = true;
            }
        }
        // ── blocks
        let blocks = if miss { 0..0 } else { leaf_blocks(current) };
        // SAFETY: a range the builder made.
        for block in unsafe { tree.blocks.get_unchecked(blocks) } {
            match visit(block, t_max) {
                ControlFlow::Continue(t) => t_max = t,
                ControlFlow::Break(()) => return,
            }
        }
        // ── the topmost entry that is not behind the bound
        loop {
            if top == 0 {
                return;
            }
            top -= 1;
            // SAFETY: below `top` everything has been written.
            let e = unsafe { stack.add(top).read() };
            if f32::from_bits((e >> 32) as u32) <= t_max {
                current = e as u32;
                break;
            }
        }
    }
}
