//! The traversal in portable Rust: for processors without AVX2, and the reference for the AVX2 one.

use super::InstanceHits;
use super::triangle::{Shear, TreeRay, intersect};
use super::wide::{Block, LANES, LEAF, Node, WIDTH, Wide, leaf_blocks};
use crate::math::{Ray, Vec3};
use crate::scene::Hit;
use std::ops::ControlFlow;

/// Relative slack of a box test: a sum, a product and a reciprocal, each rounded, and one unit to spare.
pub(super) const SLACK: f32 = 4.0 * f32::EPSILON * 0.5;

/// Reciprocal direction; zero components become tiny ones so that no product is NaN.
#[inline]
pub(super) fn reciprocal(dir: Vec3) -> Vec3 {
    let safe = |d: f32| {
        if d.abs() < 1e-18 {
            1e-18f32.copysign(d)
        } else {
            d
        }
    };
    Vec3::new(1.0 / safe(dir.x), 1.0 / safe(dir.y), 1.0 / safe(dir.z))
}

/// Traverses the tree; with `ANY` stops at the first hit. Among equally distant hits the lowest index wins, so that the
/// result does not depend on the tree. Hits that `keep` rejects do not count. `enter` finds the hit in an instance that
/// is closer than the best one.
pub(super) fn find_hit<const ANY: bool, E: InstanceHits>(
    tree: &Wide,
    probe: &impl TreeRay,
    keep: impl Fn(&Hit) -> bool,
    enter: E,
) -> Option<Hit> {
    let shear = Shear::new(probe.ray().dir);
    let mut best = probe.best();
    let mut found = false;
    traverse::<ANY>(tree, probe.ray(), best.t, |block, _| {
        if E::SOME
            && let Some(instance) = block.instance()
        {
            if let Some(hit) = enter.hit(instance, &best) {
                best = hit;
                found = true;
            }
            return match ANY && found {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(best.t),
            };
        }
        for lane in 0..LANES {
            let Some((t, u, v)) = intersect(probe, &shear, |k, a| block.corners[k][a][lane]) else {
                continue;
            };
            let hit = Hit {
                t,
                triangle: probe.triangle(block.ids[lane]),
                u,
                v,
            };
            if t > 0.0 && closer(&hit, &best) && keep(&hit) {
                best = hit;
                found = true;
                if ANY {
                    return ControlFlow::Break(());
                }
            }
        }
        ControlFlow::Continue(best.t)
    });
    found.then_some(best)
}

/// Visits the blocks of the leaves that a ray hits before `t_max`, nearest leaf first unless `ANY`; `visit` is passed
/// the bound, and returns the next bound or stops.
fn traverse<const ANY: bool>(
    tree: &Wide,
    ray: &Ray,
    mut t_max: f32,
    mut visit: impl FnMut(&Block, f32) -> ControlFlow<(), f32>,
) {
    if tree.nodes.is_empty() {
        return;
    }
    let inv = reciprocal(ray.dir);
    let mut stack = Vec::with_capacity(tree.stack);
    stack.push((0.0f32, 0u32));
    while let Some((near, entry)) = stack.pop() {
        if near > t_max {
            continue;
        }
        if entry & LEAF == 0 {
            let first = stack.len();
            push_children(&tree.nodes[entry as usize], ray, inv, t_max, &mut stack);
            if !ANY {
                stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            }
            continue;
        }
        for block in &tree.blocks[leaf_blocks(entry)] {
            match visit(block, t_max) {
                ControlFlow::Continue(t) => t_max = t,
                ControlFlow::Break(()) => return,
            }
        }
    }
}

/// True if `hit` comes before `best`; false for NaN.
#[inline(always)]
pub(super) fn closer(hit: &Hit, best: &Hit) -> bool {
    hit.t < best.t || (hit.t == best.t && hit.triangle < best.triangle)
}

fn push_children(node: &Node, ray: &Ray, inv: Vec3, t_max: f32, stack: &mut Vec<(f32, u32)>) {
    let mut near = [0.0f32; WIDTH];
    let mut far = [t_max; WIDTH];
    for axis in 0..3 {
        let (o, i) = (ray.origin[axis], inv[axis]);
        let back = usize::from(i < 0.0);
        let (p, q) = (
            &node.planes[2 * axis + back],
            &node.planes[2 * axis + 1 - back],
        );
        for k in 0..WIDTH {
            near[k] = near[k].max((p[k] - o) * (i * (1.0 - SLACK)));
            far[k] = far[k].min((q[k] - o) * (i * (1.0 + SLACK)));
        }
    }
    for k in 0..WIDTH {
        if near[k] <= far[k] {
            stack.push((near[k], node.children[k]));
        }
    }
}
