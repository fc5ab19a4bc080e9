//! The traversal in portable Rust: for processors without AVX2, and the reference for the AVX2 one.

use super::triangle::{Shear, intersect};
use super::wide::{LANES, LEAF, Node, WIDTH, Wide, leaf_blocks};
use crate::math::{Ray, Vec3};
use crate::scene::Hit;

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
/// result does not depend on the tree. Hits that `keep` rejects do not count.
pub(super) fn walk<const ANY: bool>(
    tree: &Wide,
    ray: &Ray,
    keep: impl Fn(&Hit) -> bool,
) -> Option<Hit> {
    if tree.nodes.is_empty() {
        return None;
    }
    let inv = reciprocal(ray.dir);
    let shear = Shear::new(ray.dir);
    let mut best = Hit {
        t: ray.t_max,
        triangle: 0,
        u: 0.0,
        v: 0.0,
    };
    let mut found = false;
    let mut stack = Vec::with_capacity(tree.stack);
    stack.push((0.0f32, 0u32));
    while let Some((near, entry)) = stack.pop() {
        if near > best.t {
            continue;
        }
        if entry & LEAF == 0 {
            let first = stack.len();
            push_children(&tree.nodes[entry as usize], ray, inv, best.t, &mut stack);
            if !ANY {
                stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            }
            continue;
        }
        for block in &tree.blocks[leaf_blocks(entry)] {
            for lane in 0..LANES {
                let Some((t, u, v)) = intersect(ray, &shear, |k, a| block.corners[k][a][lane])
                else {
                    continue;
                };
                let hit = Hit {
                    t,
                    triangle: block.ids[lane],
                    u,
                    v,
                };
                if t > 0.0 && closer(&hit, &best) && keep(&hit) {
                    best = hit;
                    found = true;
                    if ANY {
                        return Some(best);
                    }
                }
            }
        }
    }
    found.then_some(best)
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
