use super::*;

#[test]
fn bvh_stack_on_the_heap_gives_the_same_hits() {
    let triangles: Vec<_> = (0..400)
        .map(|k| {
            let p = Vec3::new((k % 20) as f32, (k / 20) as f32, (k * k % 7) as f32);
            [p, p + Vec3::X, p + Vec3::new(0.3, 1.0, 0.5)]
        })
        .collect();
    let (short, mut long) = (Accel::new(&triangles), Accel::new(&triangles));
    long.tree.stack = 10_000;
    let mut hits = 0;
    for k in 0..1000 {
        let origin = Vec3::new((k % 37) as f32 * 0.5, (k % 41) as f32 * 0.5, 20.0);
        let ray = Ray::new(origin, Vec3::new(0.01, 0.02, -1.0).normalize());
        let key = |hit: Option<Hit>| hit.map(|h| (h.triangle, h.t.to_bits()));
        assert_eq!(key(short.closest(&ray)), key(long.closest(&ray)));
        assert_eq!(short.any(&ray), long.any(&ray));
        hits += usize::from(short.any(&ray));
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn bvh_reaches_as_far_as_its_triangles() {
    // A ball, whose boxes reach up to the square root of three times as far.
    let at = |k: u32| {
        let (z, turn) = (k as f32 / 1500.0 - 1.0, 2.4 * k as f32);
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * turn.cos(), r * turn.sin(), z)
    };
    let triangles: Vec<_> = (0..3000)
        .map(|k| [at(k), 0.99 * at(k), at(k) * Vec3::new(0.99, 0.98, 0.97)])
        .collect();
    let tree = Accel::new(&triangles);
    for k in 0..300 {
        let dir = (at(10 * k) * Vec3::new(1.0, 2.0, 3.0)).as_dvec3();
        let along = triangles.iter().flatten().map(|p| p.as_dvec3().dot(dir));
        let exact = along.fold(f64::NEG_INFINITY, f64::max);
        let reach = tree.reach(dir);
        assert!(
            reach >= exact && reach <= 1.05 * exact,
            "{dir} {reach} {exact}"
        );
    }
    let axis = tree.reach(DVec3::X);
    assert!((axis - f64::from(tree.bounds().1.x)).abs() < 1e-12);
}

#[test]
fn bvh_holds_every_triangle_once_inside_its_boxes() {
    let triangles: Vec<_> = (0..3000u32)
        .map(|k| {
            let f = |m: u32| (k.wrapping_mul(m) >> 8) as f32 / 16_777_216.0;
            let p = Vec3::new(f(2_654_435_761), f(2_246_822_519), f(3_266_489_917));
            [p, p + 0.02 * Vec3::X, p + 0.02 * Vec3::Y]
        })
        .collect();
    let tree = Wide::new(triangles.len(), |i| triangles[i as usize], &[]);
    let mut seen = vec![0; triangles.len()];
    for node in &tree.nodes {
        for (slot, &child) in node.children.iter().enumerate() {
            if child & wide::LEAF == 0 || node.planes[0][slot] == f32::INFINITY {
                continue;
            }
            for block in &tree.blocks[wide::leaf_blocks(child)] {
                for lane in (0..wide::LANES).filter(|&l| !block.corners[0][0][l].is_nan()) {
                    seen[block.ids[lane] as usize] += 1;
                    for (corner, axis) in (0..9).map(|i| (i / 3, i % 3)) {
                        let x = block.corners[corner][axis][lane];
                        assert!(node.planes[2 * axis][slot] <= x);
                        assert!(x <= node.planes[2 * axis + 1][slot]);
                    }
                }
            }
        }
    }
    assert!(seen.iter().all(|&n| n == 1));
    let filled = triangles.len() as f32 / (tree.blocks.len() * wide::LANES) as f32;
    assert!(filled > 0.6, "blocks are filled to {filled}");
}
