use super::*;

fn bent(height: f64) -> Patch {
    let up = DVec3::Y * height;
    Patch {
        corners: [
            DVec3::new(-1.0, 0.1, -0.8) + up,
            DVec3::new(1.2, -0.1, -0.7) + up,
            DVec3::new(0.1, 0.2, 1.1) + up,
        ],
        normals: [
            DVec3::new(-0.3, 1.0, -0.2),
            DVec3::new(0.4, 1.0, -0.1),
            DVec3::new(0.1, 1.0, 0.5),
        ]
        .map(DVec3::normalize),
    }
}

fn flat(height: f64) -> Patch {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Z];
    Patch {
        corners: corners.map(|p| 10.0 * p - 3.0 * (DVec3::X + DVec3::Z) + height * DVec3::Y),
        normals: [-DVec3::Y; 3],
    }
}

fn vertex(patch: &Patch, at: DVec3, indices: [f64; 2]) -> ChainVertex {
    ChainVertex {
        at: patch.at(at).expect("area"),
        indices,
    }
}

/// Point at which a ray hits the plane of a patch.
fn meet(patch: &Patch, from: DVec3, dir: DVec3) -> DVec3 {
    let at = patch.at(from).expect("area");
    from + dir * ((at.position - from).dot(at.facet) / dir.dot(at.facet))
}

/// The chain through `at`, traced from `from` over all patches.
fn traced(from: DVec3, at: DVec3, patches: &[Patch], indices: &[[f64; 2]]) -> Vec<ChainVertex> {
    let mut chain = vec![vertex(&patches[0], at, indices[0])];
    let mut before = from;
    for (patch, indices) in patches.iter().zip(indices).skip(1) {
        let last = chain[chain.len() - 1];
        let w0 = (before - last.at.position).normalize();
        let next = last.refracted(w0).expect("a refraction");
        before = last.at.position;
        chain.push(vertex(patch, meet(patch, before, next), *indices));
    }
    chain
}

/// The tangential part of the last half vector, in the tangents of `base`.
fn value(base: &PatchPoint, from: DVec3, chain: &[ChainVertex], end: End) -> DVec2 {
    let last = chain[chain.len() - 1];
    let before = chain
        .len()
        .checked_sub(2)
        .map_or(from, |i| chain[i].at.position);
    let w0 = (before - last.at.position).normalize();
    let h = last.indices[0] * w0 + last.indices[1] * end.from(last.at.position).0;
    let across = h - last.at.normal * last.at.normal.dot(h);
    let [s, t] = base.tangents();
    DVec2::new(s.dot(across), t.dot(across))
}

/// Chains of one vertex and of two, to a point and to a direction.
#[test]
fn manifold_derivatives_are_finite_differences() {
    let from = DVec3::new(-0.4, 1.5, 0.3);
    let ends = [
        End::Point(DVec3::new(0.3, -2.6, 0.2)),
        End::Direction(DVec3::new(0.3, -1.0, 0.2).normalize()),
    ];
    let one = ([bent(0.0)].to_vec(), [[1.0, 1.5]].to_vec());
    let two = (
        [bent(0.0), bent(-1.1)].to_vec(),
        [[1.0, 1.5], [1.5, 1.2]].to_vec(),
    );
    let step = 1e-6;
    for (patches, indices) in [one, two] {
        for end in ends {
            let at = patches[0].at(DVec3::new(0.2, 0.0, -0.1)).expect("area");
            let vertices = traced(from, at.position, &patches, &indices);
            let found = chain(from, &vertices, end).expect("a chain");
            let last = vertices[vertices.len() - 1].at;
            for k in 0..2 {
                let [a, b] = [step, -step].map(|d| {
                    let moved = at.position + at.axes[k] * d;
                    let vertices = traced(from, moved, &patches, &indices);
                    value(&last, from, &vertices, end)
                });
                let expected = (a - b) / (2.0 * step);
                let error = (found.jacobian.col(k) - expected).length();
                assert!(error < 1e-7, "{} {end:?}: {error}", patches.len());
            }
            let w = end.from(last.position).0;
            let (u, v) = w.any_orthonormal_pair();
            for (k, d) in [u, v].into_iter().enumerate() {
                let [a, b] = [step, -step].map(|x| {
                    let end = match end {
                        End::Point(p) => End::Point(p + d * x),
                        End::Direction(w) => End::Direction((w + d * x).normalize()),
                    };
                    value(&last, from, &vertices, end)
                });
                let expected = (a - b) / (2.0 * step);
                assert!((found.by_end.col(k) - expected).length() < 1e-7);
            }
        }
    }
}

/// Newton's method from the middle of a patch, through chains that are traced.
fn solved(from: DVec3, patches: &[Patch], indices: &[[f64; 2]], end: End) -> Chain {
    let mut at = patches[0].at(DVec3::ZERO).expect("area");
    for _ in 0..50 {
        let vertices = traced(from, at.position, patches, indices);
        let step = chain(from, &vertices, end).and_then(|c| c.step());
        let step = 0.8 * step.expect("a step");
        let moved = at.position + at.axes[0] * step.x + at.axes[1] * step.y;
        at = patches[0].at(moved).expect("area");
    }
    let vertices = traced(from, at.position, patches, indices);
    let found = chain(from, &vertices, end).expect("a chain");
    assert!(found.value.length() < 1e-9, "{found:?}");
    found
}

/// Light over a flat mirror spreads as over the unfolded path to the mirrored point.
#[test]
fn manifold_spread_of_a_flat_mirror_is_that_of_the_mirrored_point() {
    let (from, to) = (DVec3::new(0.0, 1.0, 0.0), DVec3::new(2.0, 3.0, 1.0));
    let found = solved(from, &[flat(0.0)], &[[1.0, 1.0]], End::Point(to));
    let mirrored = DVec3::new(to.x, -to.y, to.z);
    assert!((found.spread() * from.distance_squared(mirrored) - 1.0).abs() < 1e-9);
}

/// Light from infinity leaves a plane-parallel plate as it came; through one side n₀² cos θ₀ dω₀ = n₂² cos θ₂ dω₂.
#[test]
fn manifold_spread_through_plane_sides_is_that_of_snells_law() {
    let from = DVec3::new(0.1, 1.0, 0.2);
    let towards = DVec3::new(0.3, -1.0, -0.2).normalize();
    let end = End::Direction(towards);
    let plate = solved(
        from,
        &[flat(0.0), flat(-0.7)],
        &[[1.0, 1.5], [1.5, 1.0]],
        end,
    );
    assert!((plate.spread() - 1.0).abs() < 1e-9, "{}", plate.spread());
    let water = solved(from, &[flat(0.0)], &[[1.33, 1.0]], end);
    let sin = (1.0 - towards.y * towards.y).sqrt() / 1.33;
    let expected = -towards.y / (1.33 * 1.33 * (1.0 - sin * sin).sqrt());
    assert!((water.spread() - expected).abs() < 1e-9);
}

/// The closed form for light from infinity that a ball reflects: 1 / ((1 + 2 d / (r cos θ)) (1 + 2 d cos θ / r)).
#[test]
fn manifold_spread_of_a_mirror_ball_is_the_closed_form() {
    let (radius, distance) = (0.7, 1.3);
    for angle in [0.2f64, 0.8, 1.3] {
        let normal = DVec3::new(0.4, 0.8, -0.3).normalize();
        let (s, t) = normal.any_orthonormal_pair();
        let sun = angle.cos() * normal + angle.sin() * s;
        let out = angle.cos() * normal - angle.sin() * s;
        let corner = |a: f64, b: f64| (normal + 1e-4 * (a * s + b * t)).normalize();
        let normals = [corner(-1.0, -0.8), corner(1.1, -0.7), corner(0.1, 1.2)];
        let ball = Patch {
            corners: normals.map(|n| n * radius),
            normals,
        };
        let at = ball.at(radius * normal).expect("area");
        let from = at.position + distance * out;
        let found = [vertex(&ball, at.position, [1.0, 1.0])];
        let found = chain(from, &found, End::Direction(sun)).expect("a chain");
        assert!(found.value.length() < 1e-3);
        let curved = 2.0 * distance / radius;
        let expected = 1.0 / ((1.0 + curved / angle.cos()) * (1.0 + curved * angle.cos()));
        let ratio = found.spread() / expected;
        assert!((ratio - 1.0).abs() < 1e-3, "{angle}: {ratio}");
    }
}
