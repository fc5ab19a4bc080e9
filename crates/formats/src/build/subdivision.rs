//! Loop's subdivision of triangle meshes: a number of refinements, then the limit surface, as in pbrt `[PBRT3 §3.8]`.

use opsr::math::Vec3;
use opsr::scene::Mesh;
use std::f32::consts::{PI, TAU};

/// Neighbours of a vertex, counter-clockwise. Those of a boundary vertex go from one end of the boundary to the other.
struct Ring {
    around: Vec<u32>,
    open: bool,
}

/// Third corners of faces by their directed edges. The edges of a vertex are contiguous, sorted by their ends.
struct Corners {
    first: Vec<u32>,
    /// End and third corner.
    edges: Vec<[u32; 2]>,
}

impl Corners {
    fn place(&self, from: u32, to: u32) -> Option<usize> {
        let [begin, end] = [0, 1].map(|k| self.first[from as usize + k] as usize);
        let found = self.edges[begin..end].binary_search_by_key(&to, |edge| edge[0]);
        found.ok().map(|at| begin + at)
    }

    fn get(&self, from: u32, to: u32) -> Option<u32> {
        self.place(from, to).map(|at| self.edges[at][1])
    }
}

/// The edges of faces, and the rings of all vertices. `None` if two faces share a directed edge or if the faces at a
/// vertex are not one fan: the mesh is not a manifold, or its windings differ.
fn links(count: usize, faces: &[[u32; 3]]) -> Option<(Corners, Vec<Ring>)> {
    let mut first = vec![0u32; count + 1];
    for &v in faces.as_flattened() {
        first[v as usize + 1] += 1;
    }
    for v in 0..count {
        first[v + 1] += first[v];
    }
    let (mut free, mut edges) = (first.clone(), vec![[0; 2]; 3 * faces.len()]);
    // A neighbour of each vertex, and the number of its faces.
    let mut starts = vec![(0, 0); count];
    for &[a, b, c] in faces {
        for (v, next, third) in [(a, b, c), (b, c, a), (c, a, b)] {
            let at = &mut free[v as usize];
            edges[*at as usize] = [next, third];
            *at += 1;
            starts[v as usize] = (next, starts[v as usize].1 + 1);
        }
    }
    for v in 0..count {
        let of_one = &mut edges[first[v] as usize..first[v + 1] as usize];
        of_one.sort_unstable();
        let loops = of_one.iter().any(|edge| edge[0] as usize == v);
        let twice = of_one.windows(2).any(|pair| pair[0][0] == pair[1][0]);
        (!loops && !twice).then_some(())?;
    }
    let corners = Corners { first, edges };
    let ring = |(v, &(start, faces)): (usize, &(u32, usize))| {
        let v = v as u32;
        let (mut around, mut at, mut open) = (Vec::new(), start, faces == 0);
        // Clockwise to the start of the ring: the end of a boundary, or any neighbour of an inner vertex.
        for _ in 0..faces {
            match corners.get(at, v) {
                Some(before) => at = before,
                None => open = true,
            }
        }
        let begin = at;
        for _ in 0..faces {
            around.push(at);
            at = corners.get(v, at)?;
        }
        if open && faces > 0 {
            around.push(at);
        }
        // A ring that closes early misses the faces of another fan.
        let whole = open || (at == begin && around[1..].iter().all(|&other| other != begin));
        whole.then_some(Ring { around, open })
    };
    let rings: Option<Vec<Ring>> = starts.iter().enumerate().map(ring).collect();
    Some((corners, rings?))
}

/// A vertex averaged with its neighbours: (1 − n β) v + β Σ pᵢ. At a boundary only the neighbours along it count.
fn among(points: &[Vec3], v: usize, ring: &Ring, inner: impl Fn(f32) -> f32, edge: f32) -> Vec3 {
    let p = points[v];
    let at = |i: &u32| points[*i as usize];
    match (ring.open, ring.around.as_slice()) {
        (true, [a, .., b]) => (1.0 - 2.0 * edge) * p + edge * (at(a) + at(b)),
        (true, _) => p,
        (false, around) => {
            let n = around.len() as f32;
            let beta = inner(n);
            (1.0 - n * beta) * p + beta * around.iter().map(at).sum::<Vec3>()
        }
    }
}

/// Warren's weight of each of n neighbours: 3/16 for n = 3, 1/16 for n = 6.
fn beta(n: f32) -> f32 {
    let n = if n == 3.0 { 2.0 } else { n };
    3.0 / (8.0 * n)
}

/// Points and faces after one refinement.
fn refined(
    points: &[Vec3],
    faces: &[[u32; 3]],
    corners: &Corners,
    rings: &[Ring],
) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let even = rings.iter().enumerate();
    let mut next: Vec<Vec3> = even
        .map(|(v, ring)| among(points, v, ring, beta, 0.125))
        .collect();
    // New vertices by either direction of their edge.
    let mut middles = vec![u32::MAX; corners.edges.len()];
    let mut middle = |a: u32, b: u32, c: u32| {
        let (at, back) = (corners.place(a, b), corners.place(b, a));
        if let Some(known) = at.map(|at| middles[at]).filter(|at| *at != u32::MAX) {
            return known;
        }
        let p = |i: u32| points[i as usize];
        next.push(match back {
            Some(back) => 0.375 * (p(a) + p(b)) + 0.125 * (p(c) + p(corners.edges[back][1])),
            None => 0.5 * (p(a) + p(b)),
        });
        let made = next.len() as u32 - 1;
        for at in [at, back].into_iter().flatten() {
            middles[at] = made;
        }
        made
    };
    let mut out = Vec::with_capacity(4 * faces.len());
    for &[a, b, c] in faces {
        let [d, e, f] = [middle(a, b, c), middle(b, c, a), middle(c, a, b)];
        out.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    (next, out)
}

/// The normal of the limit surface. It points away from the side on which the faces are counter-clockwise, as in pbrt.
fn normal(points: &[Vec3], v: usize, ring: &Ring) -> Vec3 {
    let relative = |&i: &u32| points[i as usize] - points[v];
    let around: Vec<Vec3> = ring.around.iter().map(relative).collect();
    let n = around.len() as f32;
    let turn = if ring.open { PI / (n - 1.0) } else { TAU / n };
    let weighted = |of: fn(f32) -> f32| {
        let terms = around.iter().enumerate();
        terms.map(|(k, p)| of(turn * k as f32) * *p).sum::<Vec3>()
    };
    let (s, t) = match (ring.open, around.as_slice()) {
        (false, _) => (weighted(f32::cos), weighted(f32::sin)),
        (true, &[a, b]) => (a - b, a + b),
        (true, &[a, b, c]) => (a - c, b),
        (true, &[a, b, c, d]) => (a - d, 2.0 * (b + c) - a - d),
        (true, &[a, .., b]) => {
            let inner = (2.0 - 2.0 * turn.cos()) * weighted(f32::sin);
            (a - b, inner - turn.sin() * (a + b))
        }
        (true, _) => (Vec3::ZERO, Vec3::ZERO),
    };
    t.cross(s).normalize_or_zero()
}

/// A mesh refined `levels` times, with its vertices and normals on the limit surface. `None` if it is not a manifold of
/// one winding.
pub fn subdivided(mesh: &Mesh, levels: u32) -> Option<Mesh> {
    let (mut points, mut faces) = (mesh.positions.clone(), mesh.indices.clone());
    let (mut corners, mut rings) = links(points.len(), &faces)?;
    for _ in 0..levels {
        (points, faces) = refined(&points, &faces, &corners, &rings);
        (corners, rings) = links(points.len(), &faces)?;
    }
    let all = || rings.iter().enumerate();
    let gamma = |n: f32| 1.0 / (n + 3.0 / (8.0 * beta(n)));
    let limit: Vec<Vec3> = all()
        .map(|(v, ring)| among(&points, v, ring, gamma, 0.2))
        .collect();
    Some(Mesh {
        normals: all().map(|(v, ring)| normal(&limit, v, ring)).collect(),
        positions: limit,
        indices: faces,
        ..Mesh::default()
    })
}
