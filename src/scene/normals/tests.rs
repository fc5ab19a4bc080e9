use super::*;

/// Texture coordinates and edges of a triangle facing +z whose u runs along `u` and whose v runs along `v`.
fn mapped(u: Vec2, v: Vec2) -> ([Vec2; 3], [Vec3; 2]) {
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|p| Vec2::new(p.dot(u), p.dot(v)));
    (uvs, [Vec3::X, Vec3::Y])
}

#[test]
fn normal_map_red_points_along_u_and_green_against_v() {
    let map = TextureRef {
        texture: 0,
        second: false,
        transform: glam::Affine2::IDENTITY,
    };
    for (u, v) in [
        (Vec2::X, Vec2::NEG_Y),
        (Vec2::NEG_X, Vec2::NEG_Y),
        (Vec2::Y, Vec2::X),
        (Vec2::X, 3.0 * Vec2::Y),
    ] {
        let (uvs, edges) = mapped(u, v);
        let (t, hand) = tangent(None, Some(uvs), &[0.2, 0.3, 0.5], edges, &map, Vec3::Z)
            .expect("the coordinates span an area");
        let red = perturbed(Vec3::Z, t, hand, Vec3::X);
        let green = perturbed(Vec3::Z, t, hand, Vec3::Y);
        assert!(
            (red - u.normalize().extend(0.0)).length() < 1e-6,
            "{u} {v}: {red}"
        );
        assert!(
            (green + v.normalize().extend(0.0)).length() < 1e-6,
            "{u} {v}: {green}"
        );
        assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Z), Vec3::Z);
    }
    let (flat, edges) = mapped(Vec2::X, Vec2::X);
    assert!(tangent(None, Some(flat), &[1.0, 0.0, 0.0], edges, &map, Vec3::Z).is_none());
}

#[test]
fn normal_map_prefers_tangents_of_the_mesh() {
    let (uvs, edges) = mapped(Vec2::X, Vec2::NEG_Y);
    let own = Some([Vec4::new(0.0, 1.0, 0.0, -1.0); 3]);
    let map = TextureRef {
        texture: 0,
        second: false,
        transform: glam::Affine2::IDENTITY,
    };
    let (t, hand) = tangent(own, Some(uvs), &[0.2, 0.3, 0.5], edges, &map, Vec3::Z).expect("given");
    assert_eq!((t, hand), (Vec3::Y, -1.0));
    assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Y), Vec3::X);
}

/// The mirror image of `w` about `n`.
fn mirrored(w: Vec3, n: Vec3) -> Vec3 {
    2.0 * w.dot(n) * n - w
}

#[test]
fn bent_normal_mirrors_a_direction_to_its_own_side() {
    let ng = Vec3::Z;
    let mut bends = 0;
    for i in 0..20_000 {
        // Normals and directions down to grazing angles.
        let [a, b, c] = [0.618_034, 0.754_878, 0.569_84].map(|r: f32| (r * i as f32).fract());
        let lean = (1.0 - a * a).sqrt();
        let ns = Vec3::new(lean * (7.0 * b).cos(), lean * (7.0 * b).sin(), a);
        let height = c.powi(4).max(1e-4);
        let w = Vec3::new((1.0 - height * height).sqrt(), 0.0, height);
        for least in [MIN_COS_ROUGH, MIN_COS_SMOOTH, 0.0, -0.5, MIN_COS_MATT] {
            let n = bent(ns, ng, w, least);
            assert_eq!(n, bent(ns, ng, -w, least));
            let bound = least.clamp(-0.9 * height, 0.9 * height);
            let cos = mirrored(w, n).dot(ng);
            assert!((n.length() - 1.0).abs() < 1e-5 && n.dot(w) > 0.0, "{n}");
            assert!(cos >= bound - 1e-5, "{ns} {w}: {cos} for {bound}");
            if n == ns {
                continue;
            }
            bends += 1;
            // In the plane of both, between them, and no further than needed.
            assert!(n.dot(ns.cross(ng)).abs() < 1e-5, "{ns} {n}");
            assert!(n.dot(ng) >= ns.dot(ng) - 1e-6 && n.dot(ns) >= ns.dot(ng) - 1e-6);
            assert!((cos - bound).abs() < 1e-4, "{ns} {w}: {cos} for {bound}");
        }
    }
    assert!(bends > 5000, "{bends}");
}

#[test]
fn bent_normal_is_the_given_one_from_above_and_the_geometric_one_in_its_plane() {
    let (ng, ns) = (Vec3::Z, Vec3::new(-0.3, 0.0, 0.9539392));
    assert_eq!(bent(ns, ng, Vec3::Z, MIN_COS_ROUGH), ns);
    assert_eq!(bent(ng, ng, Vec3::X, MIN_COS_ROUGH), ng);
    // Edge on, nothing is visible, but the result is a unit normal.
    let n = bent(ns, ng, Vec3::X, MIN_COS_ROUGH);
    assert!(
        (n.length() - 1.0).abs() < 1e-5 && n.dot(Vec3::X) > -1e-6,
        "{n}"
    );
}
